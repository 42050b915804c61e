/* SPDX-License-Identifier: MIT */
/** @file uart.h  What blw_port_uart needs of a board: one serial line and one clock. */
#ifndef UART_H
#define UART_H
#include <stdbool.h>
#include <stdint.h>

void uart_start(void);
/** Take one received byte.  @return false if there is none. */
bool uart_get(uint8_t *byte);
/** Hand one byte over.  @return false if the transmitter is busy. */
bool uart_put(uint8_t byte);
/** Microseconds since uart_start(); to be called more often than the hardware counter wraps. */
uint64_t uart_clock_us(void);

#endif
