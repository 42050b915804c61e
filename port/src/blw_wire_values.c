/* SPDX-License-Identifier: MIT */
#include "blw_wire_internal.h"
#include <string.h>

#define FLAG_VALID 0x01U
#define FD_HEADER  8U

size_t blw_wire_span(blw_wire_kind_t kind, blw_wire_format_t format)
{
    switch (kind) {
    case BLW_WIRE_MEASUREMENT:
    case BLW_WIRE_INPUT:
    case BLW_WIRE_ZETA:
        return (format == BLW_WIRE_FD) ? BLW_WIRE_VALUES : 1U;
    case BLW_WIRE_ESTIMATE:
        return (format == BLW_WIRE_FD) ? BLW_WIRE_VALUES : 2U;
    case BLW_WIRE_FOREIGN:
    case BLW_WIRE_SYNC:
    case BLW_WIRE_STATUS:
    case BLW_WIRE_SENSOR_BITS:
    default:
        return 0U;
    }
}

static size_t most_values(uint8_t kind)
{
    switch ((blw_wire_kind_t)kind) {
    case BLW_WIRE_MEASUREMENT:
        return BLW_WIRE_MAX_SENSORS;
    case BLW_WIRE_INPUT:
        return BLW_WIRE_MAX_INPUTS;
    case BLW_WIRE_ESTIMATE:
        return BLW_WIRE_MAX_STATES;
    case BLW_WIRE_ZETA:
        return BLW_WIRE_MAX_ZETA;
    case BLW_WIRE_FOREIGN:
    case BLW_WIRE_SYNC:
    case BLW_WIRE_STATUS:
    case BLW_WIRE_SENSOR_BITS:
    default:
        return 0U;
    }
}

/* The next length that CAN FD has, for a header and count values. */
static size_t fd_length(size_t count)
{
    const size_t used = FD_HEADER + (4U * count);

    if (used <= 24U) {
        return used;
    }
    if (used <= 32U) {
        return 32U;
    }
    return (used <= 48U) ? 48U : 64U;
}

static bool values_ok(const blw_wire_values_t *values, blw_wire_format_t format)
{
    const size_t span = blw_wire_span((blw_wire_kind_t)values->kind, format);

    return (span != 0U) && (values->count >= 1U) && (values->count <= span)
           && ((values->first % span) == 0U)
           && (((size_t)values->first + values->count) <= most_values(values->kind))
           && (values->sensor < BLW_WIRE_MAX_SENSORS);
}

static void put_estimate(const blw_wire_values_t *values, uint16_t base, blw_frame_t *frame)
{
    blw_wire_begin((uint16_t)(base + (values->first / 2U)), 4U * (size_t)values->count, frame);
    for (size_t j = 0U; j < values->count; j++) {
        blw_wire_put_float(values->value[j], &frame->data[4U * j]);
    }
}

static void put_one(const blw_wire_values_t *values, uint16_t base, blw_frame_t *frame)
{
    const bool     zeta  = values->kind == (uint8_t)BLW_WIRE_ZETA;
    const unsigned at    = zeta ? values->sensor : values->first;
    const unsigned index = zeta ? values->first : 0U;

    blw_wire_begin((uint16_t)(base + at), BLW_FRAME_CLASSIC_MAX, frame);
    blw_wire_put_float(values->value[0], frame->data);
    blw_wire_put_u16(values->seq, &frame->data[4]);
    frame->data[6] = (uint8_t)((index << 1) | (values->valid & FLAG_VALID));
    blw_wire_seal(frame);
}

static void put_fd(const blw_wire_values_t *values, uint16_t base, blw_frame_t *frame)
{
    const unsigned block = values->first / BLW_WIRE_VALUES;
    const bool     zeta  = values->kind == (uint8_t)BLW_WIRE_ZETA;
    const unsigned at    = zeta ? ((BLW_WIRE_MAX_SENSORS * block) + values->sensor) : block;

    blw_wire_begin((uint16_t)(base + at), fd_length(values->count), frame);
    blw_wire_put_u16(values->seq, frame->data);
    blw_wire_put_u16((uint16_t)(values->valid & ((1U << values->count) - 1U)), &frame->data[2]);
    frame->data[4] = values->count;
    for (size_t j = 0U; j < values->count; j++) {
        blw_wire_put_float(values->value[j], &frame->data[FD_HEADER + (4U * j)]);
    }
    blw_wire_seal(frame);
}

bool blw_wire_put_values(const blw_wire_values_t *values, blw_wire_format_t format,
                         blw_frame_t *frame)
{
    const blw_wire_range_t *const range = blw_wire_range_of_kind(values->kind, format);

    if ((range == NULL) || !values_ok(values, format)) {
        return false;
    }
    if (format == BLW_WIRE_FD) {
        put_fd(values, range->base, frame);
    } else if (values->kind == (uint8_t)BLW_WIRE_ESTIMATE) {
        put_estimate(values, range->base, frame);
    } else {
        put_one(values, range->base, frame);
    }
    return true;
}

static blw_wire_result_t get_estimate(const blw_frame_t *frame, unsigned at, blw_wire_values_t *out)
{
    if ((frame->len != 4U) && (frame->len != 8U)) {
        return BLW_WIRE_ERR_LAYOUT;
    }
    out->kind   = (uint8_t)BLW_WIRE_ESTIMATE;
    out->sensor = 0U;
    out->first  = (uint8_t)(2U * at);
    out->count  = (uint8_t)(frame->len / 4U);
    out->seq    = 0U;
    out->valid  = (uint16_t)((1U << out->count) - 1U);
    for (size_t j = 0U; j < out->count; j++) {
        out->value[j] = blw_wire_get_float(&frame->data[4U * j]);
    }
    return ((out->first + out->count) <= BLW_WIRE_MAX_STATES) ? BLW_WIRE_OK : BLW_WIRE_ERR_LAYOUT;
}

static blw_wire_result_t get_one(const blw_frame_t *frame, uint8_t kind, unsigned at,
                                 blw_wire_values_t *out)
{
    const bool              zeta   = kind == (uint8_t)BLW_WIRE_ZETA;
    const blw_wire_result_t result = blw_wire_check_eight(frame);

    if (result != BLW_WIRE_OK) {
        return result;
    }
    const unsigned index = (unsigned)frame->data[6] >> 1;
    if (index >= (zeta ? BLW_WIRE_MAX_ZETA : 1U)) {
        return BLW_WIRE_ERR_LAYOUT;
    }
    out->kind     = kind;
    out->sensor   = (uint8_t)(zeta ? at : 0U);
    out->first    = (uint8_t)(zeta ? index : at);
    out->count    = 1U;
    out->seq      = blw_wire_get_u16(&frame->data[4]);
    out->valid    = frame->data[6] & FLAG_VALID;
    out->value[0] = blw_wire_get_float(frame->data);
    return BLW_WIRE_OK;
}

static bool all_zero(const uint8_t *data, size_t len)
{
    uint8_t bits = 0U;

    for (size_t i = 0U; i < len; i++) {
        bits |= data[i];
    }
    return bits == 0U;
}

/* Header and padding of an FD frame are consistent with its length, which is at most 64. */
static bool fd_layout_ok(const blw_frame_t *frame)
{
    const size_t count = frame->data[4];
    const size_t used  = FD_HEADER + (4U * count);

    return (count >= 1U) && (count <= BLW_WIRE_VALUES) && (frame->len == fd_length(count))
           && (((unsigned)blw_wire_get_u16(&frame->data[2]) >> count) == 0U)
           && all_zero(&frame->data[5], 2U) && all_zero(&frame->data[used], frame->len - used);
}

static blw_wire_result_t get_fd(const blw_frame_t *frame, uint8_t kind, unsigned at,
                                blw_wire_values_t *out)
{
    const bool     zeta  = kind == (uint8_t)BLW_WIRE_ZETA;
    const unsigned block = zeta ? (at / BLW_WIRE_MAX_SENSORS) : at;
    const unsigned first = BLW_WIRE_VALUES * block;

    if ((frame->len > BLW_FRAME_MAX) || (frame->len <= FD_HEADER) || !fd_layout_ok(frame)
        || ((first + frame->data[4]) > most_values(kind))) {
        return BLW_WIRE_ERR_LAYOUT;
    }
    if (frame->data[CRC_BYTE] != blw_wire_crc(frame)) {
        return BLW_WIRE_ERR_CRC;
    }
    out->kind   = kind;
    out->sensor = (uint8_t)(zeta ? (at % BLW_WIRE_MAX_SENSORS) : 0U);
    out->first  = (uint8_t)first;
    out->count  = frame->data[4];
    out->seq    = blw_wire_get_u16(frame->data);
    out->valid  = blw_wire_get_u16(&frame->data[2]);
    for (size_t j = 0U; j < out->count; j++) {
        out->value[j] = blw_wire_get_float(&frame->data[FD_HEADER + (4U * j)]);
    }
    return BLW_WIRE_OK;
}

blw_wire_result_t blw_wire_get_values(const blw_frame_t *frame, blw_wire_values_t *out)
{
    const blw_wire_range_t *const range = blw_wire_range_of_id(frame->id);
    blw_wire_values_t             read;

    if ((range == NULL) || (most_values(range->kind) == 0U)) {
        return BLW_WIRE_ERR_KIND;
    }
    const unsigned    at     = (unsigned)frame->id - range->base;
    blw_wire_result_t result = BLW_WIRE_OK;
    (void)memset(&read, 0, sizeof read);
    if (range->format == (uint8_t)BLW_WIRE_FD) {
        result = get_fd(frame, range->kind, at, &read);
    } else if (range->kind == (uint8_t)BLW_WIRE_ESTIMATE) {
        result = get_estimate(frame, at, &read);
    } else {
        result = get_one(frame, range->kind, at, &read);
    }
    if (result == BLW_WIRE_OK) {
        *out = read;
    }
    return result;
}
