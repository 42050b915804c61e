/* SPDX-License-Identifier: MIT */
/* Any bytes: what is read as a frame can be written, and reads the same again. */
#include <stdlib.h>
#include <string.h>
#include "blw/blw_slcan.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void expect(bool holds)
{
    if (!holds) {
        abort();
    }
}

static void expect_round_trip(const blw_frame_t *frame)
{
    uint8_t           line[BLW_SLCAN_LINE_MAX];
    blw_slcan_t       other = {.len = 0U};
    blw_frame_t       again;
    blw_slcan_event_t event   = BLW_SLCAN_NOTHING;
    const size_t      written = blw_slcan_write(frame, line);

    expect(written != 0U);
    for (size_t i = 0U; i < written; i++) {
        expect(event == BLW_SLCAN_NOTHING);
        event = blw_slcan_push(&other, line[i], &again);
    }
    expect((event == BLW_SLCAN_FRAME) && (again.id == frame->id) && (again.len == frame->len)
           && (memcmp(again.data, frame->data, frame->len) == 0));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    blw_slcan_t slcan = {.len = 0U};
    blw_frame_t frame;

    for (size_t i = 0U; i < size; i++) {
        if (blw_slcan_push(&slcan, data[i], &frame) == BLW_SLCAN_FRAME) {
            expect_round_trip(&frame);
        }
        expect(slcan.len <= BLW_SLCAN_LINE_MAX);
    }
    return 0;
}
