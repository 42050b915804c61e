/* SPDX-License-Identifier: MIT */
/** @file blw_slcan.h  Frames as lines of text, for a serial line: the Lawicel protocol (SLCAN).
 *
 *      t iii n dd...\r    classic frame: 11-bit identifier, n = 0..8 bytes, all in hex
 *      d iii n dd...\r    CAN FD frame; b: with a second bit rate.  n = 0..8, 9..F for 12, 16, 20,
 *                         24, 32, 48, 64 bytes (the convention of CANable's firmware)
 *  A time stamp of four digits after the data is accepted and dropped.  Every other line is a
 *  command (C, Sn, O, V, ... of a host, or an answer) and is told by its first letter.  Lines may
 *  arrive in pieces of any size; a line that is too long or not of this form counts as malformed
 *  and the next one is read normally.
 */
#ifndef BLW_SLCAN_H
#define BLW_SLCAN_H
#include "blw/blw_port.h"
#ifdef __cplusplus
extern "C" {
#endif

/** Longest line of a frame, without \r: letter, identifier, length, 64 bytes, time stamp. */
#define BLW_SLCAN_LINE_MAX (1U + 3U + 1U + (2U * BLW_FRAME_MAX) + 4U)

typedef enum blw_slcan_event {
    BLW_SLCAN_NOTHING   = 0, /**< the line goes on */
    BLW_SLCAN_FRAME     = 1, /**< *frame was written: id, len, data; not t_us */
    BLW_SLCAN_COMMAND   = 2, /**< a line that is no frame; its letter is in self->line[0], or the
                                  line was empty: the other side's "done", then self->len = 0 */
    BLW_SLCAN_ERROR     = 3, /**< the other side's BEL: it refused a command */
    BLW_SLCAN_MALFORMED = 4  /**< a line was dropped */
} blw_slcan_event_t;

/** A receiver.  Set it to {0}. */
typedef struct blw_slcan {
    uint8_t  line[BLW_SLCAN_LINE_MAX];
    uint8_t  len;       /**< bytes of the last line, until the next byte is pushed */
    bool     ended;     /* the line is complete */
    bool     overrun;   /* it is too long; waiting for its end */
    uint32_t malformed; /**< lines dropped so far; stays at UINT32_MAX */
} blw_slcan_t;

/** Take one byte.  Carriage returns end a line; line feeds are ignored. */
blw_slcan_event_t blw_slcan_push(blw_slcan_t *self, uint8_t byte, blw_frame_t *frame);

/** Write a frame as a line, \r included.  A frame of up to 8 bytes is written as t, a longer one as
 *  d, which exists only for the lengths of CAN FD.
 *  @param line [BLW_SLCAN_LINE_MAX]
 *  @return bytes written; 0 if the identifier or the length cannot be sent. */
size_t blw_slcan_write(const blw_frame_t *frame, uint8_t *line);
#ifdef __cplusplus
}
#endif
#endif
