/* SPDX-License-Identifier: MIT */
#include "blw_wire_internal.h"
#include <string.h>

#define ID_SYNC    0x080U
#define ID_STATUS  0x280U
#define ID_SENSORS 0x281U

static const blw_wire_range_t ranges[] = {
    {ID_SYNC, 1U, (uint8_t)BLW_WIRE_SYNC, (uint8_t)BLW_WIRE_CLASSIC},
    {0x090U, 5U, (uint8_t)BLW_WIRE_MEASUREMENT, (uint8_t)BLW_WIRE_FD},
    {0x0A0U, 10U, (uint8_t)BLW_WIRE_INPUT, (uint8_t)BLW_WIRE_FD},
    {0x0C0U, 19U, (uint8_t)BLW_WIRE_ESTIMATE, (uint8_t)BLW_WIRE_FD},
    {0x100U, 64U, (uint8_t)BLW_WIRE_MEASUREMENT, (uint8_t)BLW_WIRE_CLASSIC},
    {0x140U, 64U, (uint8_t)BLW_WIRE_ZETA, (uint8_t)BLW_WIRE_CLASSIC},
    {0x180U, 128U, (uint8_t)BLW_WIRE_INPUT, (uint8_t)BLW_WIRE_CLASSIC},
    {0x200U, 128U, (uint8_t)BLW_WIRE_ESTIMATE, (uint8_t)BLW_WIRE_CLASSIC},
    {ID_STATUS, 1U, (uint8_t)BLW_WIRE_STATUS, (uint8_t)BLW_WIRE_CLASSIC},
    {ID_SENSORS, 8U, (uint8_t)BLW_WIRE_SENSOR_BITS, (uint8_t)BLW_WIRE_CLASSIC},
    {0x300U, 320U, (uint8_t)BLW_WIRE_ZETA, (uint8_t)BLW_WIRE_FD},
};
#define N_RANGES (sizeof ranges / sizeof ranges[0])

/* CRC-8 of polynomial 0x1D, four bits at a time. */
static const uint8_t crc_nibble[16] = {
    0x00U, 0x1DU, 0x3AU, 0x27U, 0x74U, 0x69U, 0x4EU, 0x53U,
    0xE8U, 0xF5U, 0xD2U, 0xCFU, 0x9CU, 0x81U, 0xA6U, 0xBBU,
};

static uint8_t crc_byte(uint8_t crc, uint8_t byte)
{
    uint8_t rest = (uint8_t)(crc ^ byte);

    for (unsigned nibble = 0U; nibble < 2U; nibble++) {
        rest = (uint8_t)((uint8_t)(rest << 4) ^ crc_nibble[rest >> 4]);
    }
    return rest;
}

uint8_t blw_wire_crc(const blw_frame_t *frame)
{
    uint8_t crc = crc_byte(0xFFU, (uint8_t)(frame->id & 0xFFU));

    crc = crc_byte(crc, (uint8_t)(frame->id >> 8));
    for (size_t i = 0U; i < frame->len; i++) {
        if (i != CRC_BYTE) {
            crc = crc_byte(crc, frame->data[i]);
        }
    }
    return (uint8_t)(crc ^ 0xFFU);
}

void blw_wire_put_u16(uint16_t value, uint8_t *to)
{
    to[0] = (uint8_t)(value & 0xFFU);
    to[1] = (uint8_t)(value >> 8);
}

uint16_t blw_wire_get_u16(const uint8_t *from)
{
    return (uint16_t)((unsigned)from[0] | ((unsigned)from[1] << 8));
}

void blw_wire_put_u32(uint32_t value, uint8_t *to)
{
    blw_wire_put_u16((uint16_t)(value & 0xFFFFU), to);
    blw_wire_put_u16((uint16_t)(value >> 16), &to[2]);
}

uint32_t blw_wire_get_u32(const uint8_t *from)
{
    return (uint32_t)blw_wire_get_u16(from) | ((uint32_t)blw_wire_get_u16(&from[2]) << 16);
}

void blw_wire_put_float(float value, uint8_t *to)
{
    uint32_t bits;

    (void)memcpy(&bits, &value, sizeof bits);
    blw_wire_put_u32(bits, to);
}

float blw_wire_get_float(const uint8_t *from)
{
    const uint32_t bits = blw_wire_get_u32(from);
    float          value;

    (void)memcpy(&value, &bits, sizeof value);
    return value;
}

const blw_wire_range_t *blw_wire_range_of_id(uint16_t id)
{
    for (size_t i = 0U; i < N_RANGES; i++) {
        if ((id >= ranges[i].base) && (id < (ranges[i].base + ranges[i].size))) {
            return &ranges[i];
        }
    }
    return NULL;
}

const blw_wire_range_t *blw_wire_range_of_kind(uint8_t kind, blw_wire_format_t format)
{
    for (size_t i = 0U; i < N_RANGES; i++) {
        if ((kind == ranges[i].kind) && ((uint8_t)format == ranges[i].format)) {
            return &ranges[i];
        }
    }
    return NULL;
}

void blw_wire_begin(uint16_t id, size_t len, blw_frame_t *frame)
{
    frame->id  = id;
    frame->len = (uint8_t)len;
    (void)memset(frame->data, 0, sizeof frame->data);
}

void blw_wire_seal(blw_frame_t *frame)
{
    frame->data[CRC_BYTE] = blw_wire_crc(frame);
}

blw_wire_result_t blw_wire_check_eight(const blw_frame_t *frame)
{
    if (frame->len != BLW_FRAME_CLASSIC_MAX) {
        return BLW_WIRE_ERR_LAYOUT;
    }
    return (frame->data[CRC_BYTE] == blw_wire_crc(frame)) ? BLW_WIRE_OK : BLW_WIRE_ERR_CRC;
}

blw_wire_kind_t blw_wire_kind(const blw_frame_t *frame)
{
    const blw_wire_range_t *const range = blw_wire_range_of_id(frame->id);

    return (range != NULL) ? (blw_wire_kind_t)range->kind : BLW_WIRE_FOREIGN;
}

void blw_wire_put_sync(const blw_wire_sync_t *sync, blw_frame_t *frame)
{
    blw_wire_begin(ID_SYNC, BLW_FRAME_CLASSIC_MAX, frame);
    blw_wire_put_u32(sync->k, frame->data);
    blw_wire_put_u32(sync->model & BLW_WIRE_MODEL_BITS,
                     &frame->data[4]); /* byte 7 is then the CRC's */
    blw_wire_seal(frame);
}

blw_wire_result_t blw_wire_get_sync(const blw_frame_t *frame, blw_wire_sync_t *out)
{
    if (blw_wire_kind(frame) != BLW_WIRE_SYNC) {
        return BLW_WIRE_ERR_KIND;
    }
    const blw_wire_result_t result = blw_wire_check_eight(frame);
    if (result == BLW_WIRE_OK) {
        out->k     = blw_wire_get_u32(frame->data);
        out->model = blw_wire_get_u32(&frame->data[4]) & BLW_WIRE_MODEL_BITS;
    }
    return result;
}

void blw_wire_put_status(const blw_wire_status_t *status, blw_frame_t *frame)
{
    blw_wire_begin(ID_STATUS, BLW_FRAME_CLASSIC_MAX, frame);
    blw_wire_put_u16(status->seq, frame->data);
    frame->data[2] = status->outcome;
    frame->data[3] = status->flags;
    frame->data[4] = status->events;
    frame->data[5] = status->iterations;
    frame->data[6] = status->estimate;
    blw_wire_seal(frame);
}

blw_wire_result_t blw_wire_get_status(const blw_frame_t *frame, blw_wire_status_t *out)
{
    if (blw_wire_kind(frame) != BLW_WIRE_STATUS) {
        return BLW_WIRE_ERR_KIND;
    }
    const blw_wire_result_t result = blw_wire_check_eight(frame);
    if (result == BLW_WIRE_OK) {
        out->seq        = blw_wire_get_u16(frame->data);
        out->outcome    = frame->data[2];
        out->flags      = frame->data[3];
        out->events     = frame->data[4];
        out->iterations = frame->data[5];
        out->estimate   = frame->data[6];
    }
    return result;
}

void blw_wire_put_sensors(const blw_wire_sensors_t *sensors, blw_frame_t *frame)
{
    blw_wire_begin((uint16_t)(ID_SENSORS + sensors->group), BLW_FRAME_CLASSIC_MAX, frame);
    blw_wire_put_u16(sensors->seq, frame->data);
    frame->data[2] = sensors->excluded;
    frame->data[3] = sensors->missing;
    frame->data[4] = sensors->rejected;
    frame->data[5] = sensors->suspicious;
    blw_wire_seal(frame);
}

blw_wire_result_t blw_wire_get_sensors(const blw_frame_t *frame, blw_wire_sensors_t *out)
{
    if (blw_wire_kind(frame) != BLW_WIRE_SENSOR_BITS) {
        return BLW_WIRE_ERR_KIND;
    }
    const blw_wire_result_t result = blw_wire_check_eight(frame);
    if (result != BLW_WIRE_OK) {
        return result;
    }
    if (frame->data[6] != 0U) {
        return BLW_WIRE_ERR_LAYOUT;
    }
    out->seq        = blw_wire_get_u16(frame->data);
    out->group      = (uint8_t)(frame->id - ID_SENSORS);
    out->excluded   = frame->data[2];
    out->missing    = frame->data[3];
    out->rejected   = frame->data[4];
    out->suspicious = frame->data[5];
    return BLW_WIRE_OK;
}

uint8_t blw_wire_sum_values(uint8_t sum, const float *value, size_t count)
{
    uint8_t crc = (uint8_t)(sum ^ 0xFFU);
    uint8_t bytes[4];

    for (size_t i = 0U; i < count; i++) {
        blw_wire_put_float(value[i], bytes);
        for (size_t j = 0U; j < sizeof bytes; j++) {
            crc = crc_byte(crc, bytes[j]);
        }
    }
    return (uint8_t)(crc ^ 0xFFU);
}
