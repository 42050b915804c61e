/* SPDX-License-Identifier: MIT */
/* The 16550 and the machine timer of QEMU's machine `virt`. */
#include "uart.h"

#define UART_DATA    (*(volatile uint8_t *)0x10000000U)
#define UART_FIFO    (*(volatile uint8_t *)0x10000002U)
#define UART_STATE   (*(volatile uint8_t *)0x10000005U)
#define MTIME_LOW    (*(volatile uint32_t *)0x0200BFF8U)
#define MTIME_HIGH   (*(volatile uint32_t *)0x0200BFFCU)
#define FIFO_ENABLE  1U
#define STATE_RX     0x01U
#define STATE_TX     0x20U
#define TICKS_PER_US 10U

static uint64_t machine_time(void)
{
    uint32_t high;
    uint32_t low;

    do {
        high = MTIME_HIGH;
        low  = MTIME_LOW;
    } while (high != MTIME_HIGH);
    return ((uint64_t)high << 32) | low;
}

void uart_start(void)
{
    UART_FIFO = FIFO_ENABLE;
}

bool uart_get(uint8_t *byte)
{
    const bool here = (UART_STATE & STATE_RX) != 0U;

    if (here) {
        *byte = UART_DATA;
    }
    return here;
}

bool uart_put(uint8_t byte)
{
    const bool room = (UART_STATE & STATE_TX) != 0U;

    if (room) {
        UART_DATA = byte;
    }
    return room;
}

uint64_t uart_clock_us(void)
{
    return machine_time() / TICKS_PER_US;
}
