/* SPDX-License-Identifier: MIT */
/* A node on a bus where anybody sends anything, true frames among them: its estimate stays a number
 * and every step is accounted for. */
#include <stdlib.h>
#include <string.h>
#include "blw/blw_kalman.h"
#include "blw/blw_node.h"
#include "blw/blw_port_ring.h"
#include "blw_wire_internal.h"

#define SLOTS 16U
#define CHUNK 12U

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const blw_real_t A[1]      = {BLW_R(0.5)};
static const blw_real_t ones[2]   = {BLW_R(1.0), BLW_R(1.0)};
static const blw_real_t zeros[2]  = {BLW_R(0.0), BLW_R(0.0)};
static const blw_real_t lowest[2] = {-BLW_REAL_MAX, -BLW_REAL_MAX};
static const blw_real_t most[2]   = {BLW_REAL_MAX, BLW_REAL_MAX};
static const blw_real_t K[2]      = {BLW_R(0.25), BLW_R(0.25)};

static const blw_plant_t plant = {.n      = 1U,
                                  .m      = 2U,
                                  .l      = 1U,
                                  .p      = 1U,
                                  .A      = A,
                                  .Bu     = ones,
                                  .C      = ones,
                                  .offset = zeros,
                                  .y_min  = lowest,
                                  .y_max  = most,
                                  .x0     = zeros};

static const blw_node_config_t config = {.model       = 0x010203U,
                                         .period_us   = 100U,
                                         .deadline_us = 20U,
                                         .settle_us   = 5U,
                                         .quarantine  = 3U,
                                         .max_gap     = 4U,
                                         .babbling    = 3U,
                                         .collects    = (uint8_t)BLW_WIRE_MEASUREMENT,
                                         .width       = 1U};

static void expect(bool holds)
{
    if (!holds) {
        abort();
    }
}

static void make_filter(blw_kalman_t *filter, blw_kalman_model_t *model, blw_real_t *mem)
{
    blw_table_check_t check;

    *model = (blw_kalman_model_t){
        .head = {.abi = BLW_MODEL_ABI, .method = (uint8_t)BLW_METHOD_KALMAN, .plant = &plant},
        .K    = K};
    expect(blw_model_begin(&model->head, BLW_METHOD_KALMAN, &check) == BLW_OK);
    blw_table_add(&check, model->K, 2U);
    model->head.crc = check.crc;
    expect(blw_kalman_init(filter, model, mem, BLW_KALMAN_MEM(1, 2)) == BLW_OK);
}

/* A sync near the node's step, a frame near the model, or anything at all. */
static void make_frame(const uint8_t *chunk, uint32_t k, blw_frame_t *frame)
{
    const blw_wire_sync_t sync = {.k = k + (uint32_t)(chunk[1] % 4U) - 1U, .model = config.model};

    (void)memset(frame, 0, sizeof *frame);
    if ((chunk[0] & 3U) == 0U) {
        blw_wire_put_sync(&sync, frame);
        return;
    }
    frame->id  = (uint16_t)(chunk[1] | ((unsigned)(chunk[2] & 7U) << 8));
    frame->len = (uint8_t)(chunk[3] % (BLW_FRAME_MAX + 1U));
    (void)memcpy(frame->data, &chunk[4], 8U);
    if ((chunk[0] & 3U) == 1U) {
        frame->id      = (uint16_t)(((chunk[1] & 1U) == 0U) ? 0x100U : 0x180U) + (chunk[2] & 3U);
        frame->len     = 8U;
        frame->data[4] = (uint8_t)(k & UINT8_MAX);
        frame->data[5] = (uint8_t)((k >> 8) & UINT8_MAX);
        frame->data[6] = 1U;
    }
    blw_wire_seal(frame);
}

static void check_report(const blw_node_report_t *report, const blw_node_t *node, uint32_t steps)
{
    if (report == NULL) {
        expect(node->counters.steps == steps);
        return;
    }
    const blw_real_t x_hat = report->out.x_hat[0];
    expect(node->counters.steps == (steps + 1U));
    expect((x_hat <= BLW_SIGNAL_MAX) && (x_hat >= -BLW_SIGNAL_MAX));
    expect((report->rejected & ~report->missing) == 0U);
    expect((report->missing & ~(blw_mask_t)3U) == 0U);
    expect((report->rejected == 0U) || (node->counters.conflict > 0U));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    blw_kalman_model_t model;
    blw_kalman_t       filter;
    blw_real_t         filter_mem[BLW_KALMAN_MEM(1, 2)];
    blw_real_t         node_mem[BLW_NODE_MEM(2, 1, 1)];
    blw_ring_slot_t    slots[SLOTS];
    blw_ring_t         ring;
    blw_ring_port_t    sender;
    blw_ring_port_t    receiver;
    blw_node_t         node;
    blw_frame_t        frame;

    make_filter(&filter, &model, filter_mem);
    blw_ring_init(&ring, slots, SLOTS);
    blw_ring_attach(&ring, &sender);
    blw_ring_attach(&ring, &receiver);
    expect(blw_node_init(&node, &config, &plant, &filter.base, &receiver.base, node_mem,
                         BLW_NODE_MEM(2, 1, 1))
           == BLW_OK);
    for (size_t at = 0U; (at + CHUNK) <= size; at += CHUNK) {
        const uint32_t steps = node.counters.steps;
        make_frame(&data[at], node.k, &frame);
        (void)blw_port_send(&sender.base, &frame);
        blw_ring_wait(&ring, (uint64_t)data[at] >> 2);
        check_report(blw_node_poll(&node), &node, steps);
    }
    return 0;
}
