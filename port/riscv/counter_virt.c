/* SPDX-License-Identifier: MIT */
/* The counter of retired instructions that every core has; QEMU with -icount gives its time, ns. */
#include "counter.h"

void counter_start(void) {}

uint32_t counter_read(void)
{
    uint32_t ticks;

    __asm volatile(".option push\n.option arch, +zicsr\ncsrr %0, minstret\n.option pop"
                   : "=r"(ticks));
    return ticks;
}
