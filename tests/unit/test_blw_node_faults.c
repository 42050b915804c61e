/* SPDX-License-Identifier: MIT */
/* A node among attackers and broken neighbours: nothing changes an estimate silently. */
#include "node_bench.h"

static bench_t bench;

void setUp(void)
{
    bench_start(&bench);
    bench_run(&bench, 1U, 1U);
}

void tearDown(void) {}

/* Step 2 with an extra frame for sensor 1 before or after its own; all before the node looks. */
static const blw_node_report_t *step_with(float extra, bool before)
{
    bench_input(&bench, 2U);
    bench_sync(&bench, 2U);
    bench_sample(&bench, 2U, 0U);
    if (before) {
        bench_value(&bench, BLW_WIRE_MEASUREMENT, 2U, 1U, extra);
    }
    bench_sample(&bench, 2U, 1U);
    if (!before) {
        bench_value(&bench, BLW_WIRE_MEASUREMENT, 2U, 1U, extra);
    }
    bench_sample(&bench, 2U, 2U);
    return bench_expect(&bench, 2U);
}

static void test_poll_given_the_same_value_twice_uses_it_and_says_so(void)
{
    const blw_node_report_t *const report = step_with(8.0F, true);

    TEST_ASSERT_EQUAL_HEX64(0U, report->missing | report->rejected);
    TEST_ASSERT_EQUAL_HEX8(BLW_NODE_EVENT_DUPLICATE, report->events);
    TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.duplicate);
}

static void test_poll_given_two_values_rejects_the_sensor_and_says_so(void)
{
    for (unsigned before = 0U; before <= 1U; before++) {
        setUp();
        const blw_node_report_t *const report = step_with(8.5F, before == 1U);
        TEST_ASSERT_EQUAL_HEX64(2U, report->rejected);
        TEST_ASSERT_EQUAL_HEX64(2U, report->missing);
        TEST_ASSERT_EQUAL_HEX8(BLW_NODE_EVENT_CONFLICT, report->events);
        TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.conflict);
    }
}

static void test_poll_given_two_values_keeps_the_sensor_in_quarantine(void)
{
    (void)step_with(8.5F, true);
    for (uint32_t k = 3U; k <= 6U; k++) {
        blw_ring_wait(&bench.ring, 1000U);
        bench_send_step(&bench, k);
        const blw_node_report_t *const report = bench_expect(&bench, k);
        TEST_ASSERT_EQUAL_HEX64((k <= 4U) ? 2U : 0U, report->rejected); /* quarantine = 2 */
        TEST_ASSERT_EQUAL_HEX64(report->rejected, report->missing);
    }
}

static void test_poll_given_a_nan_twice_is_a_contradiction(void)
{
    bench_sync(&bench, 2U);
    bench_value(&bench, BLW_WIRE_MEASUREMENT, 2U, 1U, (float)support_nan);
    bench_value(&bench, BLW_WIRE_MEASUREMENT, 2U, 1U, (float)support_nan);
    bench_expect_none(&bench);
    TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.conflict);
}

static void test_poll_given_a_contradiction_after_the_step_rejects_the_next_ones(void)
{
    bench_send_step(&bench, 2U);
    TEST_ASSERT_EQUAL_HEX64(0U, bench_expect(&bench, 2U)->rejected);
    bench_value(&bench, BLW_WIRE_MEASUREMENT, 2U, 1U, 99.0F);
    bench_sample(&bench, 2U, 0U); /* only a repetition */
    for (uint32_t k = 3U; k <= 5U; k++) {
        blw_ring_wait(&bench.ring, 1000U);
        bench_send_step(&bench, k);
        const blw_node_report_t *const report = bench_expect(&bench, k);
        TEST_ASSERT_EQUAL_HEX64((k <= 4U) ? 2U : 0U, report->rejected);
        TEST_ASSERT_EQUAL_HEX8(
            (k == 3U) ? (BLW_NODE_EVENT_CONFLICT | BLW_NODE_EVENT_DUPLICATE) : 0U, report->events);
    }
}

static void test_poll_given_time_to_settle_sees_the_contradiction_before_the_step(void)
{
    bench.config.settle_us = 100U;
    bench_send_step(&bench, 2U);
    bench_expect_none(&bench);
    blw_ring_wait(&bench.ring, 99U);
    bench_value(&bench, BLW_WIRE_MEASUREMENT, 2U, 1U, 99.0F);
    bench_expect_none(&bench);
    blw_ring_wait(&bench.ring, 1U);
    TEST_ASSERT_EQUAL_HEX64(2U, bench_expect(&bench, 2U)->rejected);
}

static void test_poll_given_two_inputs_keeps_the_last_one(void)
{
    bench_value(&bench, BLW_WIRE_INPUT, 2U, 0U, 5.0F);
    bench_send_step(&bench, 2U);
    const blw_node_report_t *const report = bench_expect(&bench, 2U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 4.625, report->out.x_hat[0]); /* with u = 1 */
    TEST_ASSERT_EQUAL_HEX8(BLW_NODE_EVENT_CONFLICT, report->events);
    blw_ring_wait(&bench.ring, 1000U);
    bench_input(&bench, 3U);
    bench_input(&bench, 3U); /* the same twice does no harm */
    bench_sync(&bench, 3U);
    for (size_t i = 0U; i < 3U; i++) {
        bench_sample(&bench, 3U, i);
    }
    TEST_ASSERT_EQUAL_HEX8(BLW_NODE_EVENT_DUPLICATE, bench_expect(&bench, 3U)->events);
}

static void test_poll_given_inputs_that_are_no_numbers_keeps_the_last_one(void)
{
    bench_value(&bench, BLW_WIRE_INPUT, 2U, 0U, (float)support_nan);
    bench_value(&bench, BLW_WIRE_INPUT, 2U, 0U, (float)support_inf);
    bench_send_step(&bench, 2U);
    const blw_node_report_t *const report = bench_expect(&bench, 2U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 4.625, report->out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX8(BLW_NODE_EVENT_CORRUPT, report->events);
    TEST_ASSERT_EQUAL_UINT32(2U, bench.node.counters.bad_value);
}

/* The estimate of step 2 of an undisturbed node. */
static const double undisturbed = 4.625;

static void test_poll_given_corrupt_frames_changes_no_estimate_and_says_so(void)
{
    blw_frame_t frame = {.id = 0x101U, .len = 8U};

    bench_sync(&bench, 2U);
    bench_put(&bench, &frame); /* its CRC is wrong */
    frame.len = 7U;
    bench_put(&bench, &frame);
    frame = (blw_frame_t){.id = 0x080U, .len = 8U};
    bench_put(&bench, &frame);
    bench_value(&bench, BLW_WIRE_MEASUREMENT, 2U, 3U, 1.0F); /* there is no fourth sensor, */
    bench_value(&bench, BLW_WIRE_INPUT, 2U, 1U, 1.0F);       /* and no second input */
    bench_input(&bench, 2U);
    for (size_t i = 0U; i < 3U; i++) {
        bench_sample(&bench, 2U, i);
    }
    const blw_node_report_t *const report = bench_expect(&bench, 2U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, undisturbed, report->out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX8(BLW_NODE_EVENT_CORRUPT, report->events);
    TEST_ASSERT_EQUAL_UINT32(2U, bench.node.counters.bad_crc);
    TEST_ASSERT_EQUAL_UINT32(3U, bench.node.counters.bad_layout);
}

static void test_poll_given_stale_and_early_frames_changes_no_estimate_and_says_so(void)
{
    bench_value(&bench, BLW_WIRE_MEASUREMENT, 0U, 1U, 99.0F);
    bench_value(&bench, BLW_WIRE_MEASUREMENT, 3U, 1U, 99.0F);
    bench_value(&bench, BLW_WIRE_MEASUREMENT, 1U + 32768U, 1U, 99.0F);
    bench_value(&bench, BLW_WIRE_INPUT, 1U, 0U, 99.0F);
    bench_value(&bench, BLW_WIRE_INPUT, 3U, 0U, 99.0F);
    bench_send_step(&bench, 2U);
    const blw_node_report_t *const report = bench_expect(&bench, 2U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, undisturbed, report->out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX8(BLW_NODE_EVENT_ORDER, report->events);
    TEST_ASSERT_EQUAL_UINT32(2U, bench.node.counters.stale);
    TEST_ASSERT_EQUAL_UINT32(3U, bench.node.counters.out_of_order);
}

static void test_poll_given_a_babbling_sensor_still_steps_in_time_and_says_so(void)
{
    bench_input(&bench, 2U);
    bench_sync(&bench, 2U);
    bench_sample(&bench, 2U, 0U);
    for (size_t round = 0U; round < 20U; round++) { /* 1000 frames, 20 at a look */
        for (size_t i = 0U; i < 50U; i++) {
            bench_sample(&bench, 2U, 1U);
        }
        bench_expect_none(&bench);
    }
    bench_sample(&bench, 2U, 2U);
    const blw_node_report_t *const report = bench_expect(&bench, 2U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, undisturbed, report->out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX8(BLW_NODE_EVENT_DUPLICATE | BLW_NODE_EVENT_BABBLING, report->events);
    TEST_ASSERT_EQUAL_UINT32(996U, bench.node.counters.babbling);
    TEST_ASSERT_EQUAL_UINT32(999U, bench.node.counters.duplicate);
}

/* A link on which the same frame waits for ever, and time passes with every one received. */
typedef struct flood_port {
    blw_port_t  base;
    blw_frame_t frame;
    uint64_t    now_us;
} flood_port_t;

static uint64_t flood_now_us(blw_port_t *self)
{
    return ((flood_port_t *)(void *)self)->now_us;
}

static bool flood_recv(blw_port_t *self, blw_frame_t *frame)
{
    flood_port_t *const port = (flood_port_t *)(void *)self;

    *frame      = port->frame;
    frame->t_us = port->now_us;
    port->now_us++;
    return true;
}

static bool flood_send(blw_port_t *self, const blw_frame_t *frame)
{
    (void)self;
    (void)frame;
    return true;
}

static void test_poll_given_a_flood_makes_its_steps_in_time(void)
{
    static const blw_port_ops_t ops   = {flood_now_us, flood_recv, flood_send};
    flood_port_t                flood = {.base = {&ops}};
    const blw_wire_sync_t       sync  = {.k = 2U, .model = BENCH_MODEL};
    size_t                      polls = 0U;

    bench_run(&bench, 2U, 2U);
    blw_wire_put_sync(&sync, &flood.frame); /* the last sync again and again */
    flood.now_us    = bench.ring.now_us;
    bench.node.port = &flood.base;
    while (bench.node.counters.steps < 12U) {
        (void)blw_node_poll(&bench.node);
        polls++;
        TEST_ASSERT_LESS_THAN_size_t(100U, polls);
    }
    TEST_ASSERT_EQUAL_UINT32(10U, bench.node.counters.no_sync);
    TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.restarts);
}

static void test_poll_given_false_syncs_keeps_its_time_and_says_so(void)
{
    bench_sync(&bench, 2U);
    bench_expect_none(&bench);
    bench_sync(&bench, 3U);    /* too early after 2 */
    bench_sync(&bench, 1000U); /* of another time */
    bench_sync(&bench, 1001U);
    bench_expect_none(&bench);
    bench_send_step(&bench, 2U); /* its sync comes twice now */
    const blw_node_report_t *const report = bench_expect(&bench, 2U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, undisturbed, report->out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX8(BLW_NODE_EVENT_TIME, report->events);
    TEST_ASSERT_EQUAL_UINT32(4U, bench.node.counters.bad_sync);
    blw_ring_wait(&bench.ring, 1000U);
    bench_sync(&bench, 1000U); /* before the true one, once a period */
    bench_send_step(&bench, 3U);
    TEST_ASSERT_EQUAL_HEX64(0U, bench_expect(&bench, 3U)->missing);
    blw_ring_wait(&bench.ring, 1000U);
    bench_sync(&bench, 1001U); /* confirms nothing: the true one came in between */
    bench_send_step(&bench, 4U);
    TEST_ASSERT_EQUAL_HEX64(0U, bench_expect(&bench, 4U)->missing);
    TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.restarts);
}

static void test_poll_given_false_syncs_in_a_row_waits_for_the_sensors_to_follow(void)
{
    bench.config.period_us = 0U; /* no clock that could find them too early */
    for (uint32_t k = 1000U; k < 1010U; k++) {
        bench_sync(&bench, k);
        bench_value(&bench, BLW_WIRE_MEASUREMENT, k, 0U, 1.0F); /* one liar is not most sensors */
    }
    bench_expect_none(&bench);
    bench_send_step(&bench, 2U);
    const blw_node_report_t *const report = bench_expect(&bench, 2U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, undisturbed, report->out.x_hat[0]);
    TEST_ASSERT_EQUAL_UINT32(10U, bench.node.counters.bad_sync);
    TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.restarts);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_poll_given_the_same_value_twice_uses_it_and_says_so);
    RUN_TEST(test_poll_given_two_values_rejects_the_sensor_and_says_so);
    RUN_TEST(test_poll_given_two_values_keeps_the_sensor_in_quarantine);
    RUN_TEST(test_poll_given_a_nan_twice_is_a_contradiction);
    RUN_TEST(test_poll_given_a_contradiction_after_the_step_rejects_the_next_ones);
    RUN_TEST(test_poll_given_time_to_settle_sees_the_contradiction_before_the_step);
    RUN_TEST(test_poll_given_two_inputs_keeps_the_last_one);
    RUN_TEST(test_poll_given_inputs_that_are_no_numbers_keeps_the_last_one);
    RUN_TEST(test_poll_given_corrupt_frames_changes_no_estimate_and_says_so);
    RUN_TEST(test_poll_given_stale_and_early_frames_changes_no_estimate_and_says_so);
    RUN_TEST(test_poll_given_a_babbling_sensor_still_steps_in_time_and_says_so);
    RUN_TEST(test_poll_given_a_flood_makes_its_steps_in_time);
    RUN_TEST(test_poll_given_false_syncs_keeps_its_time_and_says_so);
    RUN_TEST(test_poll_given_false_syncs_in_a_row_waits_for_the_sensors_to_follow);
    return UNITY_END();
}
