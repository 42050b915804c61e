/* SPDX-License-Identifier: MIT */
#include "blw_port_uart.h"
#include "uart.h"

static void transmit(blw_port_uart_t *self)
{
    while ((self->out_len > 0U) && uart_put(self->out[self->out_first])) {
        self->out_first = (uint16_t)((self->out_first + 1U) % BLW_PORT_UART_BUFFER);
        self->out_len--;
    }
}

static bool queue(blw_port_uart_t *self, const uint8_t *bytes, size_t len)
{
    if (len > (BLW_PORT_UART_BUFFER - (size_t)self->out_len)) {
        return false;
    }
    for (size_t i = 0U; i < len; i++) {
        self->out[(self->out_first + self->out_len) % BLW_PORT_UART_BUFFER] = bytes[i];
        self->out_len++;
    }
    return true;
}

static uint64_t now_us(blw_port_t *base)
{
    (void)base;
    return uart_clock_us();
}

static bool receive(blw_port_t *base, blw_frame_t *frame)
{
    static const uint8_t   done = (uint8_t)'\r';
    blw_port_uart_t *const self = (blw_port_uart_t *)(void *)base;
    uint8_t                byte;

    transmit(self);
    while (uart_get(&byte)) {
        const blw_slcan_event_t event = blw_slcan_push(&self->slcan, byte, frame);
        const bool              taken = (event == BLW_SLCAN_FRAME);

        if (taken || ((event == BLW_SLCAN_COMMAND) && (self->slcan.len > 0U))) {
            (void)queue(self, &done, 1U); /* without room the host goes without */
        }
        if (taken) {
            frame->t_us = uart_clock_us();
            return true;
        }
    }
    return false;
}

static bool enqueue(blw_port_t *base, const blw_frame_t *frame)
{
    blw_port_uart_t *const self = (blw_port_uart_t *)(void *)base;
    uint8_t                line[BLW_SLCAN_LINE_MAX];

    return queue(self, line, blw_slcan_write(frame, line));
}

static const blw_port_ops_t ops = {
    .now_us = now_us,
    .recv   = receive,
    .send   = enqueue,
};

void blw_port_uart_open(blw_port_uart_t *self)
{
    self->base.ops = &ops;
    uart_start();
}
