/* SPDX-License-Identifier: MIT */
/* Three stations and a fusion node on one bus, against the central estimator on the same data. */
#include "blw/blw_node.h"
#include "blw/blw_port_ring.h"
#include "blw/blw_station.h"
#include "support.h"

#define M     3U
#define MEM   BLW_LASSO_MEM(1, M, 3, 2, 3, 0)
#define MODEL 0x00c0ffeeU
#define SLOTS 64U

static support_lasso_t     made;
static blw_lasso_t         central;
static blw_real_t          central_mem[MEM];
static blw_lasso_t         fusion;
static blw_real_t          fusion_mem[MEM];
static blw_local_t         filter[M];
static blw_real_t          filter_mem[M][BLW_LOCAL_MEM(1, 1)];
static blw_station_t       station[M];
static blw_real_t          station_mem[M][BLW_STATION_MEM(1, 1)];
static blw_ring_slot_t     slots[SLOTS];
static blw_ring_t          ring;
static blw_ring_port_t     plant_port;
static blw_ring_port_t     node_port;
static blw_ring_port_t     station_port[M];
static blw_node_config_t   config;
static blw_real_t          node_mem[BLW_NODE_MEM(M, 1, 1)];
static blw_node_t          node;
static blw_estimator_out_t out;
static blw_mask_t          silent; /* stations that do not hear the bus */

static void make_station(uint8_t i)
{
    TEST_ASSERT_EQUAL_INT(
        BLW_OK, blw_local_init(&filter[i], &made.model, i, filter_mem[i], BLW_LOCAL_MEM(1, 1)));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_station_init(&station[i], MODEL, BLW_WIRE_CLASSIC, &filter[i],
                                                   &station_port[i].base, station_mem[i],
                                                   BLW_STATION_MEM(1, 1)));
}

void setUp(void)
{
    support_lasso_make(&made, BLW_METHOD_LASSO);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_init(&central, &made.model, central_mem, MEM));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_init(&fusion.base, &blw_lasso_fusion_ops,
                                                     &made.model.head, fusion_mem, MEM));
    blw_ring_init(&ring, slots, SLOTS);
    blw_ring_attach(&ring, &plant_port);
    blw_ring_attach(&ring, &node_port);
    for (uint8_t i = 0U; i < M; i++) {
        blw_ring_attach(&ring, &station_port[i]);
        make_station(i);
    }
    config = (blw_node_config_t){.model       = MODEL,
                                 .deadline_us = 200U,
                                 .max_gap     = 5U,
                                 .babbling    = 4U,
                                 .collects    = (uint8_t)BLW_WIRE_ZETA,
                                 .width       = 1U};
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_node_init(&node, &config, &made.plant, &fusion.base,
                                                &node_port.base, node_mem, BLW_NODE_MEM(M, 1, 1)));
    silent = 0U;
}

void tearDown(void) {}

static void put_value(blw_wire_kind_t kind, uint32_t k, size_t i, float value)
{
    const blw_wire_values_t values = {.kind  = (uint8_t)kind,
                                      .first = (uint8_t)i,
                                      .count = 1U,
                                      .seq   = (uint16_t)(k & UINT16_MAX),
                                      .valid = 1U,
                                      .value = {value}};
    blw_frame_t             frame;

    TEST_ASSERT_TRUE(blw_wire_put_values(&values, BLW_WIRE_CLASSIC, &frame));
    TEST_ASSERT_TRUE(blw_port_send(&plant_port.base, &frame));
}

static float y_of(uint32_t k, size_t i)
{
    return 5.0F + (float)i + (0.25F * (float)((k * (7U + (uint32_t)i)) % 13U));
}

/* What waits on the bus, to the stations that hear it. */
static void stations_listen(uint32_t k, bool sampled)
{
    blw_frame_t frame;

    for (size_t i = 0U; i < M; i++) {
        while (blw_port_recv(&station_port[i].base, &frame)) {
            if (((silent >> i) & 1U) == 0U) {
                if (sampled && (blw_wire_kind(&frame) == BLW_WIRE_SYNC)) {
                    (void)blw_station_take(&station[i], &frame);
                    blw_station_sample(&station[i], (uint16_t)(k & UINT16_MAX),
                                       (blw_real_t)y_of(k, i), true);
                }
                (void)blw_station_take(&station[i], &frame);
            }
        }
    }
}

/* Step k of plant, stations, fusion node and central estimator; valid: who is heard in time. */
static void step(uint32_t k, blw_mask_t valid)
{
    const blw_wire_sync_t sync = {.k = k, .model = MODEL};
    const blw_real_t      u[1] = {BLW_R(0.125) * (blw_real_t)(k % 5U)};
    blw_real_t            y[M];
    blw_frame_t           frame;

    blw_wire_put_sync(&sync, &frame);
    TEST_ASSERT_TRUE(blw_port_send(&plant_port.base, &frame));
    put_value(BLW_WIRE_INPUT, k, 0U, 0.125F * (float)(k % 5U));
    stations_listen(k, true);
    (void)blw_node_poll(&node);
    blw_ring_wait(&ring, 1000U);
    (void)blw_node_poll(&node);
    TEST_ASSERT_EQUAL_UINT32(k, node.report.k);
    stations_listen(k, false);
    for (size_t i = 0U; i < M; i++) {
        y[i] = (blw_real_t)y_of(k, i);
    }
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_step(&central, u, y, valid, &out));
}

static void assert_same_estimate(void)
{
#ifdef BLW_REAL_DOUBLE
    TEST_ASSERT_REAL_WITHIN(1e-5, out.x_hat[0], node.report.out.x_hat[0]); /* float32 on the bus */
#else
    TEST_ASSERT_EQUAL_MEMORY(out.x_hat, node.report.out.x_hat, sizeof(blw_real_t));
    TEST_ASSERT_EQUAL_MEMORY(out.suspicion, node.report.out.suspicion, M * sizeof(blw_real_t));
#endif
}

static void test_stations_given_every_frame_yield_the_bits_of_the_central_estimator(void)
{
    for (uint32_t k = 1U; k <= 300U; k++) {
        step(k, 7U);
        assert_same_estimate();
    }
    TEST_ASSERT_EQUAL_UINT32(0U, node.counters.lost);
    TEST_ASSERT_EQUAL_UINT32(300U, station[2].counters.steps);
    TEST_ASSERT_EQUAL_UINT32(0U, station[2].counters.restarts);
}

static void test_station_given_a_gap_starts_again_about_an_estimate(void)
{
    for (uint32_t k = 1U; k <= 60U; k++) {
        silent = ((k > 20U) && (k <= 30U)) ? 2U : 0U;
        step(k, 7U);
    }
    TEST_ASSERT_EQUAL_UINT32(11U, node.counters.lost); /* 21..30, and 31 without a reference */
    TEST_ASSERT_EQUAL_UINT32(1U, station[1].counters.restarts);
    TEST_ASSERT_EQUAL_HEX64(0U, node.report.missing);
    TEST_ASSERT_REAL_WITHIN(0.2, out.x_hat[0], node.report.out.x_hat[0]);
}

static void test_station_given_a_late_start_waits_for_an_estimate(void)
{
    silent = 4U;
    for (uint32_t k = 1U; k <= 10U; k++) {
        step(k, 3U);
        assert_same_estimate();
    }
    silent = 0U;
    step(11U, 3U);
    assert_same_estimate();
    step(12U, 7U);
    TEST_ASSERT_EQUAL_HEX64(0U, node.report.missing);
}

static void test_sample_given_two_values_has_none(void)
{
    const blw_wire_sync_t sync = {.k = 1U, .model = MODEL};
    blw_frame_t           frame;

    blw_wire_put_sync(&sync, &frame);
    TEST_ASSERT_FALSE(blw_station_take(&station[0], &frame));
    blw_station_sample(&station[0], 1U, BLW_R(5.0), true);
    blw_station_sample(&station[0], 1U, BLW_R(5.0), true);
    TEST_ASSERT_EQUAL_UINT32(0U, station[0].counters.conflict);
    blw_station_sample(&station[0], 1U, BLW_R(50.0), true);
    blw_station_sample(&station[0], 2U, BLW_R(50.0), true); /* of another step */
    put_value(BLW_WIRE_INPUT, 1U, 0U, 1.0F);
    TEST_ASSERT_TRUE(blw_port_recv(&station_port[0].base, &frame));
    TEST_ASSERT_TRUE(blw_station_take(&station[0], &frame));
    TEST_ASSERT_EQUAL_UINT32(1U, station[0].counters.conflict);
    TEST_ASSERT_EQUAL_UINT32(1U, station[0].counters.no_sample);
}

static void test_take_given_bad_frames_counts_them(void)
{
    const blw_wire_sync_t stranger = {.k = 1U, .model = MODEL + 1U};
    const blw_wire_sync_t sync     = {.k = 1U, .model = MODEL};
    static const uint16_t ids[]    = {0x080U, 0x180U, 0x200U, 0x280U};
    blw_frame_t           frame;

    for (size_t i = 0U; i < 4U; i++) {
        frame = (blw_frame_t){.id = ids[i], .len = 3U};
        TEST_ASSERT_FALSE(blw_station_take(&station[0], &frame));
    }
    TEST_ASSERT_EQUAL_UINT32(4U, station[0].counters.bad_frame);
    blw_wire_put_sync(&stranger, &frame);
    TEST_ASSERT_FALSE(blw_station_take(&station[0], &frame));
    TEST_ASSERT_EQUAL_UINT32(1U, station[0].counters.wrong_model);
    blw_wire_put_sync(&sync, &frame);
    TEST_ASSERT_FALSE(blw_station_take(&station[0], &frame));
    put_value(BLW_WIRE_INPUT, 1U, 0U, (float)support_nan);
    TEST_ASSERT_TRUE(blw_port_recv(&station_port[0].base, &frame));
    TEST_ASSERT_FALSE(blw_station_take(&station[0], &frame));
    TEST_ASSERT_EQUAL_UINT32(5U, station[0].counters.bad_frame);
}

static void test_init_given_wrong_arguments_refuses(void)
{
    blw_port_t *const port = &station_port[0].base;
    blw_real_t *const mem  = station_mem[0];

    TEST_ASSERT_EQUAL_INT(
        BLW_ERR_ARG, blw_station_init(NULL, MODEL, BLW_WIRE_CLASSIC, &filter[0], port, mem, 3U));
    TEST_ASSERT_EQUAL_INT(
        BLW_ERR_ARG, blw_station_init(&station[0], MODEL, BLW_WIRE_CLASSIC, NULL, port, mem, 3U));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MEM, blw_station_init(&station[0], MODEL, BLW_WIRE_CLASSIC,
                                                        &filter[0], port, mem, 2U));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_stations_given_every_frame_yield_the_bits_of_the_central_estimator);
    RUN_TEST(test_station_given_a_gap_starts_again_about_an_estimate);
    RUN_TEST(test_station_given_a_late_start_waits_for_an_estimate);
    RUN_TEST(test_sample_given_two_values_has_none);
    RUN_TEST(test_take_given_bad_frames_counts_them);
    RUN_TEST(test_init_given_wrong_arguments_refuses);
    return UNITY_END();
}
