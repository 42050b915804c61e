/* SPDX-License-Identifier: MIT */
#include "blw/blw_port_ring.h"

static uint64_t now_us(blw_port_t *self)
{
    return ((const blw_ring_port_t *)(const void *)self)->ring->now_us;
}

static bool recv(blw_port_t *self, blw_frame_t *frame)
{
    blw_ring_port_t *const  port = (blw_ring_port_t *)(void *)self;
    const blw_ring_t *const ring = port->ring;

    if ((ring->written - port->read) > ring->len) {
        const uint64_t oldest = ring->written - ring->len;
        port->overruns += oldest - port->read;
        port->read = oldest;
    }
    while (port->read < ring->written) {
        const blw_ring_slot_t *const slot = &ring->slots[port->read % ring->len];
        port->read++;
        if (slot->sender != port->number) {
            *frame = slot->frame;
            return true;
        }
    }
    return false;
}

static bool send(blw_port_t *self, const blw_frame_t *frame)
{
    const blw_ring_port_t *const port = (const blw_ring_port_t *)(const void *)self;
    blw_ring_t *const            ring = port->ring;
    blw_ring_slot_t *const       slot = &ring->slots[ring->written % ring->len];

    slot->frame      = *frame;
    slot->frame.t_us = ring->now_us;
    slot->sender     = port->number;
    ring->written++;
    return true;
}

static const blw_port_ops_t ring_ops = {.now_us = now_us, .recv = recv, .send = send};

void blw_ring_init(blw_ring_t *self, blw_ring_slot_t *slots, size_t len)
{
    self->slots   = slots;
    self->len     = len;
    self->written = 0U;
    self->now_us  = 0U;
    self->ports   = 0U;
}

void blw_ring_attach(blw_ring_t *self, blw_ring_port_t *port)
{
    port->base.ops = &ring_ops;
    port->ring     = self;
    port->read     = self->written;
    port->overruns = 0U;
    port->number   = self->ports;
    self->ports++;
}

void blw_ring_wait(blw_ring_t *self, uint64_t time_us)
{
    self->now_us += time_us;
}
