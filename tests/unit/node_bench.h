/* SPDX-License-Identifier: MIT */
/** @file node_bench.h  A node of the Kalman filter of support.h on a ring bus, and what a test does
 *  to it: sending frames for the plant, moving the time, reading what the node sends.
 *
 *  One period is 1000 us, the deadline 200 us after the sync; u = 1, and y = (10, 8, 6) unless told
 *  otherwise.
 */
#ifndef NODE_BENCH_H
#define NODE_BENCH_H
#include "blw/blw_node.h"
#include "blw/blw_port_ring.h"
#include "support.h"

#define BENCH_MODEL 0x12abcdefU
#define BENCH_SLOTS 64U

typedef struct bench {
    support_kalman_t  made;
    blw_real_t        filter_mem[BLW_KALMAN_MEM(1, 3)];
    blw_kalman_t      filter;
    blw_ring_slot_t   slots[BENCH_SLOTS];
    blw_ring_t        ring;
    blw_ring_port_t   plant_port;
    blw_ring_port_t   node_port;
    blw_node_config_t config;
    blw_real_t        mem[BLW_NODE_MEM(3, 1, 1)];
    blw_node_t        node;
} bench_t;

/** Everything new; the node has heard nothing. */
static inline void bench_start(bench_t *self)
{
    support_kalman_make(&self->made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_init(&self->filter, &self->made.model,
                                                  self->filter_mem, BLW_KALMAN_MEM(1, 3)));
    blw_ring_init(&self->ring, self->slots, BENCH_SLOTS);
    blw_ring_attach(&self->ring, &self->plant_port);
    blw_ring_attach(&self->ring, &self->node_port);
    self->config = (blw_node_config_t){.model       = BENCH_MODEL,
                                       .period_us   = 1000U,
                                       .deadline_us = 200U,
                                       .quarantine  = 2U,
                                       .max_gap     = 5U,
                                       .babbling    = 4U,
                                       .collects    = (uint8_t)BLW_WIRE_MEASUREMENT,
                                       .width       = 1U};
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_node_init(&self->node, &self->config, &self->made.plant,
                                                &self->filter.base, &self->node_port.base,
                                                self->mem, BLW_NODE_MEM(3, 1, 1)));
}

static inline void bench_put(bench_t *self, const blw_frame_t *frame)
{
    TEST_ASSERT_TRUE(blw_port_send(&self->plant_port.base, frame));
}

static inline void bench_sync(bench_t *self, uint32_t k)
{
    const blw_wire_sync_t sync = {.k = k, .model = BENCH_MODEL};
    blw_frame_t           frame;

    blw_wire_put_sync(&sync, &frame);
    bench_put(self, &frame);
}

static inline void bench_value(bench_t *self, blw_wire_kind_t kind, uint32_t seq, size_t i, float v)
{
    const blw_wire_values_t values = {.kind  = (uint8_t)kind,
                                      .first = (uint8_t)i,
                                      .count = 1U,
                                      .seq   = (uint16_t)(seq & UINT16_MAX),
                                      .valid = 1U,
                                      .value = {v}};
    blw_frame_t             frame;

    TEST_ASSERT_TRUE(blw_wire_put_values(&values, BLW_WIRE_CLASSIC, &frame));
    bench_put(self, &frame);
}

static inline void bench_sample(bench_t *self, uint32_t k, size_t i)
{
    static const float y[3] = {10.0F, 8.0F, 6.0F};

    bench_value(self, BLW_WIRE_MEASUREMENT, k, i, y[i]);
}

/** u(k-1), which step k needs. */
static inline void bench_input(bench_t *self, uint32_t k)
{
    bench_value(self, BLW_WIRE_INPUT, k, 0U, 1.0F);
}

/** All frames of step k. */
static inline void bench_send_step(bench_t *self, uint32_t k)
{
    bench_sync(self, k);
    bench_input(self, k);
    for (size_t i = 0U; i < 3U; i++) {
        bench_sample(self, k, i);
    }
}

/** The node makes exactly one step, and it is k. */
static inline const blw_node_report_t *bench_expect(bench_t *self, uint32_t k)
{
    const blw_node_report_t *const report = blw_node_poll(&self->node);

    TEST_ASSERT_NOT_NULL(report);
    TEST_ASSERT_EQUAL_UINT32(k, report->k);
    return report;
}

/** The node makes no step. */
static inline void bench_expect_none(bench_t *self)
{
    TEST_ASSERT_NULL(blw_node_poll(&self->node));
}

/** Steps from..to without any fault, one period apart, ending at the end of the last period. */
static inline void bench_run(bench_t *self, uint32_t from, uint32_t to)
{
    for (uint32_t k = from; k <= to; k++) {
        bench_send_step(self, k);
        (void)bench_expect(self, k);
        blw_ring_wait(&self->ring, 1000U);
    }
}
#endif
