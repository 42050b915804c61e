/* SPDX-License-Identifier: MIT */
/** @file blw_port_ring.h  A bus inside one process: a ring of frames and any number of ports on it.
 *
 *  Every frame that one port sends is received by all the others in the same order.  A port that
 *  reads too slowly loses the oldest frames, and counts them.  Time stands still until the owner
 *  moves it, so that a run depends on nothing but its data.  Not for several threads.
 */
#ifndef BLW_PORT_RING_H
#define BLW_PORT_RING_H
#include "blw/blw_port.h"
#ifdef __cplusplus
extern "C" {
#endif

typedef struct blw_ring_slot {
    blw_frame_t frame;
    uint16_t    sender;
} blw_ring_slot_t;

typedef struct blw_ring {
    blw_ring_slot_t *slots;
    size_t           len;
    uint64_t         written; /* frames so far */
    uint64_t         now_us;
    uint16_t         ports;
} blw_ring_t;

typedef struct blw_ring_port {
    blw_port_t  base;
    blw_ring_t *ring;
    uint64_t    read;     /* number of the next frame to be received */
    uint64_t    overruns; /**< frames lost because they were not received in time */
    uint16_t    number;
} blw_ring_port_t;

/** An empty bus at time 0 that holds the last len >= 1 frames. */
void blw_ring_init(blw_ring_t *self, blw_ring_slot_t *slots, size_t len);
/** Attach a port.  It hears what is sent from now on. */
void blw_ring_attach(blw_ring_t *self, blw_ring_port_t *port);
/** Move the time forward. */
void blw_ring_wait(blw_ring_t *self, uint64_t time_us);
#ifdef __cplusplus
}
#endif
#endif
