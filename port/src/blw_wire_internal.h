/* SPDX-License-Identifier: MIT */
/** @file blw_wire_internal.h  Private: what both halves of the codec use. */
#ifndef BLW_WIRE_INTERNAL_H
#define BLW_WIRE_INTERNAL_H
#include "blw/blw_wire.h"

#define CRC_BYTE 7U

/** Identifiers base .. base + size - 1 of one kind in one format. */
typedef struct blw_wire_range {
    uint16_t base;
    uint16_t size;
    uint8_t  kind;
    uint8_t  format;
} blw_wire_range_t;

/** The range that holds an identifier; NULL if it is not ours. */
const blw_wire_range_t *blw_wire_range_of_id(uint16_t id);
/** The identifiers of a kind in a format; NULL if it has none. */
const blw_wire_range_t *blw_wire_range_of_kind(uint8_t kind, blw_wire_format_t format);

/** Start a frame: zeros, so that what is not written is zero on the wire. */
void blw_wire_begin(uint16_t id, size_t len, blw_frame_t *frame);
/** End it: write the CRC. */
void blw_wire_seal(blw_frame_t *frame);
/** CRC of the identifier and of all bytes but the CRC's own; len <= BLW_FRAME_MAX. */
uint8_t blw_wire_crc(const blw_frame_t *frame);
/** Length and CRC of a frame of eight bytes. */
blw_wire_result_t blw_wire_check_eight(const blw_frame_t *frame);

void     blw_wire_put_u16(uint16_t value, uint8_t *to);
uint16_t blw_wire_get_u16(const uint8_t *from);
void     blw_wire_put_u32(uint32_t value, uint8_t *to);
uint32_t blw_wire_get_u32(const uint8_t *from);
void     blw_wire_put_float(float value, uint8_t *to);
float    blw_wire_get_float(const uint8_t *from);

#endif
