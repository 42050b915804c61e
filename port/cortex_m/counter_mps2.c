/* SPDX-License-Identifier: MIT */
/* Timer 0 of the CMSDK, the first device of the MPS2 boards' peripheral bus: 32 bits, counts down.
 * SysTick has the same clock, but its 24 bits are too few for a long step without an FPU. */
#include "counter.h"

#define TIMER_CTRL   (*(volatile uint32_t *)0x40000000U)
#define TIMER_VALUE  (*(volatile uint32_t *)0x40000004U)
#define TIMER_RELOAD (*(volatile uint32_t *)0x40000008U)

#define TIMER_ENABLE 1U

void counter_start(void)
{
    TIMER_RELOAD = UINT32_MAX;
    TIMER_VALUE  = UINT32_MAX;
    TIMER_CTRL   = TIMER_ENABLE;
}

uint32_t counter_read(void)
{
    return UINT32_MAX - TIMER_VALUE;
}
