/* SPDX-License-Identifier: MIT */
/** @file blw_port_uart.h  Frames as SLCAN text on a microcontroller's serial line.
 *
 *  Polled: recv() takes the bytes that the line has and hands over those that wait to be sent, so
 *  it has to be called at least once per byte time, or the board's uart_get() has to read from a
 *  buffer that an interrupt fills.  Frames and commands of the host (C, S6, O, ...) are answered
 *  with "\r", as an adapter does, so that slcand takes the device for one.
 */
#ifndef BLW_PORT_UART_H
#define BLW_PORT_UART_H
#include "blw/blw_slcan.h"

/** Bytes that wait to be sent: the report of a step with 64 sensors and 32 states. */
#define BLW_PORT_UART_BUFFER 1024U

/** The caller owns it; set it to {0} and open it. */
typedef struct blw_port_uart {
    blw_port_t  base;
    blw_slcan_t slcan;
    uint16_t    out_first; /* oldest byte of the ring */
    uint16_t    out_len;
    uint8_t     out[BLW_PORT_UART_BUFFER];
} blw_port_uart_t;

void blw_port_uart_open(blw_port_uart_t *self);

#endif
