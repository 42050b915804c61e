/* SPDX-License-Identifier: MIT */
/* UART 0 and timer 0 of the MPS2 boards (CMSDK), both at 25 MHz.  The receiver holds one byte, so
 * on hardware an interrupt has to collect the bytes; QEMU waits until the byte has been taken. */
#include "uart.h"

#define UART_DATA    (*(volatile uint32_t *)0x40004000U)
#define UART_STATE   (*(volatile uint32_t *)0x40004004U)
#define UART_CTRL    (*(volatile uint32_t *)0x40004008U)
#define UART_BAUDDIV (*(volatile uint32_t *)0x40004010U)

#define STATE_TX_FULL 1U
#define STATE_RX_FULL 2U
#define CTRL_TX_RX    3U
#define CLOCK_HZ      25000000U
#define BAUD          115200U

#define TIMER_CTRL   (*(volatile uint32_t *)0x40000000U)
#define TIMER_VALUE  (*(volatile uint32_t *)0x40000004U)
#define TIMER_RELOAD (*(volatile uint32_t *)0x40000008U)

#define TIMER_ENABLE 1U
#define TICKS_PER_US 25U

static uint32_t last_value;
static uint64_t ticks;

void uart_start(void)
{
    UART_BAUDDIV = CLOCK_HZ / BAUD;
    UART_CTRL    = CTRL_TX_RX;
    TIMER_RELOAD = UINT32_MAX;
    TIMER_VALUE  = UINT32_MAX;
    TIMER_CTRL   = TIMER_ENABLE;
    last_value   = UINT32_MAX;
}

bool uart_get(uint8_t *byte)
{
    const bool here = (UART_STATE & STATE_RX_FULL) != 0U;

    if (here) {
        *byte = (uint8_t)UART_DATA;
    }
    return here;
}

bool uart_put(uint8_t byte)
{
    const bool room = (UART_STATE & STATE_TX_FULL) == 0U;

    if (room) {
        UART_DATA = byte;
    }
    return room;
}

uint64_t uart_clock_us(void)
{
    const uint32_t value = TIMER_VALUE; /* counts down, wraps after 171 s */

    ticks += last_value - value;
    last_value = value;
    return ticks / TICKS_PER_US;
}
