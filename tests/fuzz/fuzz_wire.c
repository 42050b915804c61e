/* SPDX-License-Identifier: MIT */
/* Whatever can be decoded is encoded to the same bytes again; everything else is refused. */
#include <stdlib.h>
#include <string.h>
#include "blw_wire_internal.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void expect(bool holds)
{
    if (!holds) {
        abort();
    }
}

static void expect_same(const blw_frame_t *frame, const blw_frame_t *again)
{
    expect((frame->id == again->id) && (frame->len == again->len)
           && (memcmp(frame->data, again->data, frame->len) == 0));
}

static void values(const blw_frame_t *frame)
{
    blw_wire_values_t             read;
    blw_frame_t                   again;
    const blw_wire_range_t *const range = blw_wire_range_of_id(frame->id);

    if (blw_wire_get_values(frame, &read) != BLW_WIRE_OK) {
        return;
    }
    expect(range != NULL);
    expect(blw_wire_put_values(&read, (blw_wire_format_t)range->format, &again));
    expect_same(frame, &again);
}

static void others(const blw_frame_t *frame)
{
    blw_wire_sync_t    sync;
    blw_wire_status_t  status;
    blw_wire_sensors_t sensors;
    blw_frame_t        again;

    if (blw_wire_get_sync(frame, &sync) == BLW_WIRE_OK) {
        blw_wire_put_sync(&sync, &again);
        expect_same(frame, &again);
    }
    if (blw_wire_get_status(frame, &status) == BLW_WIRE_OK) {
        blw_wire_put_status(&status, &again);
        expect_same(frame, &again);
    }
    if (blw_wire_get_sensors(frame, &sensors) == BLW_WIRE_OK) {
        blw_wire_put_sensors(&sensors, &again);
        expect_same(frame, &again);
    }
}

/* data: identifier, length, whether to make the CRC right, bytes of the frame. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    blw_frame_t frame = {0};

    if (size < 4U) {
        return 0;
    }
    const size_t bytes = size - 4U;
    frame.id           = (uint16_t)(data[0] | ((unsigned)(data[1] & 0x07U) << 8));
    frame.len          = data[2];
    (void)memcpy(frame.data, &data[4], (bytes < BLW_FRAME_MAX) ? bytes : BLW_FRAME_MAX);
    if (((data[3] & 1U) != 0U) && (frame.len <= BLW_FRAME_MAX)) {
        blw_wire_seal(&frame);
    }
    values(&frame);
    others(&frame);
    return 0;
}
