/* SPDX-License-Identifier: MIT */
/** @file blw_port.h  What a node needs of a machine: a clock and a link.
 *
 *  A back end is an object whose first member is a blw_port_t; its functions cast the base back to
 *  the object (MISRA C:2012 deviation D-1).  Neither receiving nor sending ever blocks, so a node
 *  can be driven from a main loop, an interrupt-driven scheduler or a test with its own time.
 */
#ifndef BLW_PORT_H
#define BLW_PORT_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif

/** Most bytes in a frame: those of CAN FD. */
#define BLW_FRAME_MAX 64U
/** Most bytes in a frame of classic CAN.  A longer frame is one of CAN FD. */
#define BLW_FRAME_CLASSIC_MAX 8U

typedef struct blw_port blw_port_t;

typedef struct blw_frame {
    uint64_t t_us;                /**< reception time on the port's clock; not used for sending */
    uint16_t id;                  /**< 11-bit identifier, see blw_wire.h */
    uint8_t  len;                 /**< bytes used in data, 0..BLW_FRAME_MAX */
    uint8_t  data[BLW_FRAME_MAX]; /**< layout owned by blw_wire.h */
} blw_frame_t;

typedef struct blw_port_ops {
    /** Monotonic time in microseconds; never fails, never goes back. */
    uint64_t (*now_us)(blw_port_t *self);
    /** Take one frame if one is waiting; never blocks.  @return false if none. */
    bool (*recv)(blw_port_t *self, blw_frame_t *frame);
    /** Queue one frame; never blocks.  @return false if the link has no room. */
    bool (*send)(blw_port_t *self, const blw_frame_t *frame);
} blw_port_ops_t;

struct blw_port {
    const blw_port_ops_t *ops;
};

static inline uint64_t blw_port_now_us(blw_port_t *self)
{
    return self->ops->now_us(self);
}

static inline bool blw_port_recv(blw_port_t *self, blw_frame_t *frame)
{
    return self->ops->recv(self, frame);
}

static inline bool blw_port_send(blw_port_t *self, const blw_frame_t *frame)
{
    return self->ops->send(self, frame);
}
#ifdef __cplusplus
}
#endif
#endif
