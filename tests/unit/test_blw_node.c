/* SPDX-License-Identifier: MIT */
/* The life of a node without attackers: time, losses of frames and of contact, what it sends. */
#include "node_bench.h"

static bench_t bench;

void setUp(void)
{
    bench_start(&bench);
}

void tearDown(void) {}

static void test_init_given_wrong_arguments_refuses(void)
{
    blw_node_config_t      config;
    const blw_node_t       before = bench.node;
    blw_estimator_t *const filter = &bench.filter.base;
    blw_port_t *const      port   = &bench.node_port.base;
    const size_t           len    = BLW_NODE_MEM(3, 1, 1);

    TEST_ASSERT_EQUAL_INT(BLW_ERR_MEM, blw_node_init(&bench.node, &bench.config, &bench.made.plant,
                                                     filter, port, bench.mem, len - 1U));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_node_init(&bench.node, NULL, &bench.made.plant, filter,
                                                     port, bench.mem, len));
    for (size_t c = 0U; c < 6U; c++) {
        config             = bench.config;
        config.deadline_us = (c == 0U) ? 0U : config.deadline_us;
        config.babbling    = (c == 1U) ? 1U : config.babbling;
        config.width       = (c == 2U) ? 0U : ((c == 3U) ? 2U : config.width);
        config.collects    = (uint8_t)((c == 4U) ? BLW_WIRE_INPUT : BLW_WIRE_MEASUREMENT);
        config.format      = (c == 5U) ? 2U : config.format;
        TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_node_init(&bench.node, &config, &bench.made.plant,
                                                         filter, port, bench.mem, len));
    }
    TEST_ASSERT_EQUAL_MEMORY(&before, &bench.node, sizeof before);
}

static void test_poll_given_all_frames_steps_at_once_with_the_input_before(void)
{
    bench_send_step(&bench, 1U);
    const blw_node_report_t *const report = bench_expect(&bench, 1U);

    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 4.5, report->out.x_hat[0]); /* 3 + 9/6, as the filter's */
    TEST_ASSERT_EQUAL_HEX8(BLW_NODE_EVENT_RESTART, report->events);
    TEST_ASSERT_EQUAL_HEX64(0U, report->missing | report->rejected);
    bench_expect_none(&bench);
    TEST_ASSERT_EQUAL_UINT32(4U, bench.node.counters.taken);
    TEST_ASSERT_EQUAL_UINT32(0U, bench.node.counters.lost);
}

static void test_poll_given_many_steps_yields_the_bits_of_the_estimator_alone(void)
{
    static const blw_real_t u[1]  = {BLW_R(1.0)};
    static const blw_real_t y[3]  = {BLW_R(10.0), BLW_R(8.0), BLW_R(6.0)};
    const uint32_t          last  = 67000U;
    const uint32_t          steps = (SUPPORT_LONG_RUN < last) ? SUPPORT_LONG_RUN : last;
    blw_real_t              mem[BLW_KALMAN_MEM(1, 3)];
    blw_kalman_t            alone;
    blw_estimator_out_t     out;

    TEST_ASSERT_EQUAL_INT(BLW_OK,
                          blw_kalman_init(&alone, &bench.made.model, mem, BLW_KALMAN_MEM(1, 3)));
    for (uint32_t k = last - steps + 1U; k <= last; k++) { /* seq wraps at 65536 */
        bench_run(&bench, k, k);
        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&alone, u, y, 7U, &out));
        TEST_ASSERT_EQUAL_MEMORY(out.x_hat, bench.node.report.out.x_hat, sizeof(blw_real_t));
    }
    TEST_ASSERT_EQUAL_UINT32(steps, bench.node.counters.steps);
    TEST_ASSERT_EQUAL_UINT32(4U * steps, bench.node.counters.taken);
    TEST_ASSERT_EQUAL_UINT32(0U, bench.node.counters.lost + bench.node.counters.stale);
    TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.restarts);
    TEST_ASSERT_EQUAL_UINT64(0U, bench.node_port.overruns);
}

static void test_poll_given_a_missing_sample_waits_for_the_deadline_and_says_so(void)
{
    bench_run(&bench, 1U, 1U);
    bench_input(&bench, 2U);
    bench_sync(&bench, 2U);
    bench_sample(&bench, 2U, 0U);
    bench_sample(&bench, 2U, 2U);
    bench_expect_none(&bench);
    blw_ring_wait(&bench.ring, 199U);
    bench_expect_none(&bench);
    blw_ring_wait(&bench.ring, 1U);
    const blw_node_report_t *const report = bench_expect(&bench, 2U);
    TEST_ASSERT_EQUAL_HEX64(2U, report->missing);
    TEST_ASSERT_EQUAL_HEX64(0U, report->rejected);
    TEST_ASSERT_EQUAL_HEX8(BLW_NODE_EVENT_LOST, report->events);
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING, report->out.flags);
    TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.lost);
    bench_sample(&bench, 2U, 1U); /* too late */
    bench_expect_none(&bench);
    TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.stale);
}

static void test_poll_given_a_sensor_without_sample_waits_but_does_not_count_it_as_lost(void)
{
    const blw_wire_values_t none = {
        .kind = BLW_WIRE_MEASUREMENT, .first = 1U, .count = 1U, .seq = 2U, .valid = 0U};
    blw_frame_t frame;

    bench_run(&bench, 1U, 1U);
    bench_input(&bench, 2U);
    bench_sync(&bench, 2U);
    bench_sample(&bench, 2U, 0U);
    TEST_ASSERT_TRUE(blw_wire_put_values(&none, BLW_WIRE_CLASSIC, &frame));
    bench_put(&bench, &frame);
    bench_sample(&bench, 2U, 2U);
    bench_expect_none(&bench);
    blw_ring_wait(&bench.ring, 200U);
    const blw_node_report_t *const report = bench_expect(&bench, 2U);
    TEST_ASSERT_EQUAL_HEX64(2U, report->missing);
    TEST_ASSERT_EQUAL_HEX8(0U, report->events);
    TEST_ASSERT_EQUAL_UINT32(0U, bench.node.counters.lost);
}

static void test_poll_given_a_missing_input_keeps_the_last_one(void)
{
    bench_run(&bench, 1U, 1U); /* x_hat = 4.5 */
    bench_sync(&bench, 2U);
    for (size_t i = 0U; i < 3U; i++) {
        bench_sample(&bench, 2U, i);
    }
    bench_expect_none(&bench);
    blw_ring_wait(&bench.ring, 200U);
    const blw_node_report_t *const report = bench_expect(&bench, 2U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 4.625, report->out.x_hat[0]); /* 3.25 + 8.25/6 */
    TEST_ASSERT_EQUAL_HEX8(BLW_NODE_EVENT_LOST, report->events);
    TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.lost);
}

static void test_poll_given_the_next_sync_makes_the_open_step_first(void)
{
    bench_run(&bench, 1U, 1U);
    bench_input(&bench, 2U);
    bench_sync(&bench, 2U);
    bench_sample(&bench, 2U, 0U);
    bench_expect_none(&bench);
    bench.config.deadline_us = 5000U;
    blw_ring_wait(&bench.ring, 1000U);
    bench_send_step(&bench, 3U);
    TEST_ASSERT_EQUAL_HEX64(6U, bench_expect(&bench, 2U)->missing);
    TEST_ASSERT_EQUAL_HEX64(0U, bench_expect(&bench, 3U)->missing);
}

static void test_poll_given_no_sync_goes_on_by_its_own_clock(void)
{
    bench_run(&bench, 1U, 1U); /* step 1 began at 0; now it is 1000 */
    bench_input(&bench, 2U);
    for (size_t i = 0U; i < 3U; i++) {
        bench_sample(&bench, 2U, i);
    }
    blw_ring_wait(&bench.ring, 199U);
    bench_expect_none(&bench);
    blw_ring_wait(&bench.ring, 1U);
    TEST_ASSERT_EQUAL_HEX64(0U, bench_expect(&bench, 2U)->missing); /* only the sync was lost */
    blw_ring_wait(&bench.ring, 1000U);
    const blw_node_report_t *const blind = bench_expect(&bench, 3U);
    TEST_ASSERT_EQUAL_HEX8(BLW_NODE_EVENT_LOST | BLW_NODE_EVENT_TIME, blind->events);
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING | BLW_FLAG_DEGRADED | BLW_FLAG_BLIND, blind->out.flags);
    blw_ring_wait(&bench.ring, 800U);
    bench_run(&bench, 4U, 9U);
    TEST_ASSERT_EQUAL_UINT32(2U, bench.node.counters.no_sync);
    TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.blind);
    TEST_ASSERT_EQUAL_UINT32(0U, bench.node.counters.bad_sync);
}

static void test_poll_given_a_small_gap_predicts_over_it_once_it_is_confirmed(void)
{
    bench.config.period_us = 0U;
    bench_run(&bench, 1U, 2U);
    bench_send_step(&bench, 5U);
    bench_expect_none(&bench);
    TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.bad_sync);
    bench_send_step(&bench, 6U);
    for (uint32_t k = 3U; k <= 5U; k++) {
        TEST_ASSERT_EQUAL_HEX64(7U, bench_expect(&bench, k)->missing);
    }
    TEST_ASSERT_EQUAL_HEX64(0U, bench_expect(&bench, 6U)->missing);
    bench_run(&bench, 7U, 8U);
    TEST_ASSERT_EQUAL_UINT32(3U, bench.node.counters.blind);
    TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.restarts);
}

static void test_poll_given_a_plant_that_starts_again_starts_again_too(void)
{
    bench.config.period_us = 0U;
    bench_run(&bench, 1U, 50U);
    bench_send_step(&bench, 1U);
    bench_expect_none(&bench);
    bench_send_step(&bench, 2U);
    const blw_node_report_t *const report = bench_expect(&bench, 2U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 4.5, report->out.x_hat[0]);
    TEST_ASSERT_TRUE((report->events & BLW_NODE_EVENT_RESTART) != 0U);
    TEST_ASSERT_EQUAL_UINT32(2U, bench.node.counters.restarts);
}

static void test_poll_given_an_end_is_done_and_joins_the_next_run_at_once(void)
{
    bench_run(&bench, 1U, 3U);
    TEST_ASSERT_FALSE(blw_node_done(&bench.node));
    bench_sync(&bench, BLW_WIRE_K_END);
    bench_expect_none(&bench);
    TEST_ASSERT_TRUE(blw_node_done(&bench.node));
    blw_ring_wait(&bench.ring, 10000U);
    bench_expect_none(&bench);
    bench_send_step(&bench, 1U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 4.5, bench_expect(&bench, 1U)->out.x_hat[0]);
    TEST_ASSERT_FALSE(blw_node_done(&bench.node));
    bench_sync(&bench, BLW_WIRE_K_END); /* a false one: the run goes on */
    bench_expect_none(&bench);
    blw_ring_wait(&bench.ring, 1000U);
    bench_send_step(&bench, 2U);
    TEST_ASSERT_EQUAL_HEX8(0U, bench_expect(&bench, 2U)->events);
}

static void test_poll_given_the_sync_of_the_initial_state_makes_no_step_of_it(void)
{
    bench_sync(&bench, 0U);
    bench_expect_none(&bench);
    blw_ring_wait(&bench.ring, 1000U);
    bench_send_step(&bench, 1U);
    const blw_node_report_t *const report = bench_expect(&bench, 1U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 4.5, report->out.x_hat[0]);
    TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.steps);
}

static void test_poll_given_a_sync_behind_the_end_shows_the_end_first(void)
{
    bench_run(&bench, 1U, 3U);
    bench_sync(&bench, BLW_WIRE_K_END);
    bench_sync(&bench, 1000U);
    bench_expect_none(&bench);
    TEST_ASSERT_TRUE(blw_node_done(&bench.node));
    bench_expect_none(&bench);
    TEST_ASSERT_FALSE(blw_node_done(&bench.node));
}

static void test_poll_given_a_restarted_node_takes_the_step_from_the_sync(void)
{
    bench_input(&bench, 776U); /* the node starts in the middle of a step */
    bench_sample(&bench, 776U, 2U);
    bench_expect_none(&bench);
    bench_send_step(&bench, 777U);
    const blw_node_report_t *const report = bench_expect(&bench, 777U);
    TEST_ASSERT_EQUAL_HEX8(BLW_NODE_EVENT_RESTART, report->events);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 4.5, report->out.x_hat[0]);
    blw_ring_wait(&bench.ring, 1000U);
    bench_run(&bench, 778U, 800U);
    TEST_ASSERT_EQUAL_UINT32(0U, bench.node.counters.lost);
}

static void test_poll_given_a_sync_of_another_model_refuses_it(void)
{
    const blw_wire_sync_t sync = {.k = 1U, .model = BENCH_MODEL ^ 0x800000U};
    blw_frame_t           frame;

    blw_wire_put_sync(&sync, &frame);
    bench_put(&bench, &frame);
    for (size_t i = 0U; i < 3U; i++) {
        bench_sample(&bench, 1U, i);
    }
    bench_expect_none(&bench);
    blw_ring_wait(&bench.ring, 100000U);
    bench_expect_none(&bench);
    TEST_ASSERT_EQUAL_UINT32(1U, bench.node.counters.wrong_model);
    TEST_ASSERT_EQUAL_UINT32(0U, bench.node.counters.steps);
}

/* The frames of one report, as the plant's port hears them. */
static void assert_report_on_the_wire(uint32_t k, float x_hat, uint8_t missing)
{
    blw_frame_t        frame;
    blw_wire_values_t  estimate;
    blw_wire_status_t  status;
    blw_wire_sensors_t sensors;

    TEST_ASSERT_TRUE(blw_port_recv(&bench.plant_port.base, &frame));
    TEST_ASSERT_EQUAL_INT(BLW_WIRE_OK, blw_wire_get_values(&frame, &estimate));
    TEST_ASSERT_EQUAL_INT(BLW_WIRE_ESTIMATE, estimate.kind);
    TEST_ASSERT_EQUAL_UINT(1U, estimate.count);
    TEST_ASSERT_EQUAL_FLOAT(x_hat, estimate.value[0]);
    TEST_ASSERT_TRUE(blw_port_recv(&bench.plant_port.base, &frame));
    TEST_ASSERT_EQUAL_INT(BLW_WIRE_OK, blw_wire_get_status(&frame, &status));
    TEST_ASSERT_EQUAL_HEX16(k, status.seq);
    TEST_ASSERT_EQUAL_HEX8(blw_wire_sum_values(0U, estimate.value, 1U), status.estimate);
    TEST_ASSERT_EQUAL_HEX8(bench.node.report.events, status.events);
    TEST_ASSERT_TRUE(blw_port_recv(&bench.plant_port.base, &frame));
    TEST_ASSERT_EQUAL_INT(BLW_WIRE_OK, blw_wire_get_sensors(&frame, &sensors));
    TEST_ASSERT_EQUAL_HEX16(k, sensors.seq);
    TEST_ASSERT_EQUAL_HEX8(missing, sensors.missing);
    TEST_ASSERT_EQUAL_HEX8(missing, sensors.suspicious);
    TEST_ASSERT_FALSE(blw_port_recv(&bench.plant_port.base, &frame));
}

static void test_poll_given_a_step_sends_estimate_status_and_sensors(void)
{
    for (unsigned format = 0U; format <= 1U; format++) {
        bench_start(&bench);
        bench.config.format = (uint8_t)format;
        bench_send_step(&bench, 1U);
        (void)bench_expect(&bench, 1U);
        assert_report_on_the_wire(1U, 4.5F, 0U);
        blw_ring_wait(&bench.ring, 1000U);
        bench_input(&bench, 2U);
        bench_sync(&bench, 2U);
        bench_sample(&bench, 2U, 0U);
        bench_sample(&bench, 2U, 2U);
        bench_expect_none(&bench);
        blw_ring_wait(&bench.ring, 200U);
        (void)bench_expect(&bench, 2U);
        assert_report_on_the_wire(2U, (float)bench.node.report.out.x_hat[0], 2U);
    }
}

/* A link that takes `room` more frames. */
typedef struct narrow_port {
    blw_port_t   base;
    blw_port_t  *inner;
    unsigned int room;
} narrow_port_t;

static uint64_t narrow_now_us(blw_port_t *self)
{
    return blw_port_now_us(((narrow_port_t *)self)->inner);
}

static bool narrow_recv(blw_port_t *self, blw_frame_t *frame)
{
    return blw_port_recv(((narrow_port_t *)self)->inner, frame);
}

static bool narrow_send(blw_port_t *self, const blw_frame_t *frame)
{
    narrow_port_t *const port = (narrow_port_t *)self;

    if (port->room == 0U) {
        return false;
    }
    port->room--;
    return blw_port_send(port->inner, frame);
}

static void test_poll_given_a_full_link_sends_the_rest_later_and_counts_what_it_drops(void)
{
    static const blw_port_ops_t ops = {narrow_now_us, narrow_recv, narrow_send};
    narrow_port_t narrow            = {.base = {&ops}, .inner = &bench.node_port.base, .room = 1U};

    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_node_init(&bench.node, &bench.config, &bench.made.plant,
                                                &bench.filter.base, &narrow.base, bench.mem,
                                                BLW_NODE_MEM(3, 1, 1)));
    bench_send_step(&bench, 1U);
    (void)bench_expect(&bench, 1U);
    bench_sync(&bench, BLW_WIRE_K_END);
    bench_expect_none(&bench);
    TEST_ASSERT_FALSE(blw_node_done(&bench.node));
    narrow.room = 2U;
    bench_expect_none(&bench);
    TEST_ASSERT_TRUE(blw_node_done(&bench.node));
    assert_report_on_the_wire(1U, 4.5F, 0U);
    TEST_ASSERT_EQUAL_UINT32(0U, bench.node.counters.unsent);
    blw_ring_wait(&bench.ring, 1000U);
    bench_run(&bench, 2U, 3U);
    TEST_ASSERT_EQUAL_UINT32(3U, bench.node.counters.unsent);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_given_wrong_arguments_refuses);
    RUN_TEST(test_poll_given_all_frames_steps_at_once_with_the_input_before);
    RUN_TEST(test_poll_given_many_steps_yields_the_bits_of_the_estimator_alone);
    RUN_TEST(test_poll_given_a_missing_sample_waits_for_the_deadline_and_says_so);
    RUN_TEST(test_poll_given_a_sensor_without_sample_waits_but_does_not_count_it_as_lost);
    RUN_TEST(test_poll_given_a_missing_input_keeps_the_last_one);
    RUN_TEST(test_poll_given_the_next_sync_makes_the_open_step_first);
    RUN_TEST(test_poll_given_no_sync_goes_on_by_its_own_clock);
    RUN_TEST(test_poll_given_a_small_gap_predicts_over_it_once_it_is_confirmed);
    RUN_TEST(test_poll_given_a_plant_that_starts_again_starts_again_too);
    RUN_TEST(test_poll_given_an_end_is_done_and_joins_the_next_run_at_once);
    RUN_TEST(test_poll_given_the_sync_of_the_initial_state_makes_no_step_of_it);
    RUN_TEST(test_poll_given_a_sync_behind_the_end_shows_the_end_first);
    RUN_TEST(test_poll_given_a_restarted_node_takes_the_step_from_the_sync);
    RUN_TEST(test_poll_given_a_sync_of_another_model_refuses_it);
    RUN_TEST(test_poll_given_a_step_sends_estimate_status_and_sensors);
    RUN_TEST(test_poll_given_a_full_link_sends_the_rest_later_and_counts_what_it_drops);
    return UNITY_END();
}
