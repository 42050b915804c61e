/* SPDX-License-Identifier: MIT */
/* Models that are refused, and samples that are missing, huge or not numbers. */
#include <string.h>
#include "decentral_model.h"

#define MEM           BLW_DECENTRAL_MEM(1, 3, 3, 2, 0)
#define MEM_RECURSIVE BLW_DECENTRAL_MEM(1, 3, 3, 2, 1)

static decentral_made_t    made;
static blw_real_t          mem[MEM_RECURSIVE];
static blw_decentral_t     filter;
static blw_estimator_out_t out;

void setUp(void)
{
    decentral_make(&made, false);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_init(&filter, &made.model, mem, MEM));
}

void tearDown(void) {}

static void step(const blw_real_t *y, blw_mask_t valid)
{
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_step(&filter, NULL, y, valid, &out));
}

/* y with the innovations 0 as long as x_hat = 0. */
static const blw_real_t calm[3] = {BLW_R(1.0), BLW_R(2.0), BLW_R(3.0)};

static void assert_refused(blw_status_t expected, size_t len)
{
    const blw_decentral_t before = filter;

    TEST_ASSERT_EQUAL_INT(expected, blw_decentral_init(&filter, &made.model, mem, len));
    TEST_ASSERT_EQUAL_MEMORY(&before, &filter, sizeof before);
}

/* Refused as broken, also with the right sum; then whole again. */
static void assert_broken(void)
{
    decentral_seal(&made);
    assert_refused(BLW_ERR_MODEL, MEM_RECURSIVE);
    decentral_make(&made, made.model.steady == NULL);
}

static void test_init_given_null_or_little_memory_refuses(void)
{
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_decentral_init(NULL, &made.model, mem, MEM));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_decentral_init(&filter, NULL, mem, MEM));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_decentral_init(&filter, &made.model, NULL, MEM));
    assert_refused(BLW_ERR_MEM, MEM - 1U);
    decentral_make(&made, true);
    assert_refused(BLW_ERR_MEM, MEM_RECURSIVE - 1U);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_init(&filter, &made.model, mem, MEM_RECURSIVE));
}

static void test_init_given_a_wrong_head_or_sum_refuses(void)
{
    made.model.head.abi++;
    assert_refused(BLW_ERR_MODEL, MEM);
    decentral_make(&made, false);
    made.model.head.crc ^= 1U;
    assert_refused(BLW_ERR_MODEL, MEM);
}

static void test_init_given_wrong_sizes_refuses(void)
{
    made.model.first = NULL;
    assert_refused(BLW_ERR_MODEL, MEM);
    decentral_make(&made, false);
    made.model.sets = NULL;
    assert_refused(BLW_ERR_MODEL, MEM);
    decentral_make(&made, false);
    made.model.ranking = NULL;
    assert_refused(BLW_ERR_MODEL, MEM);
    decentral_make(&made, false);
    made.model.mu = 1U;
    assert_broken();
    made.first[0] = 1U;
    assert_broken();
    made.first[3] = 4U;
    assert_broken();
    made.first[1] = 2U;
    assert_broken();
    made.model.max_gap = 0U;
    assert_broken();
    made.model.reseed = 2U;
    assert_broken();
    made.model.recursive = &made.recursive;
    assert_broken();
    made.model.gains = NULL;
    assert_broken();
    made.model.gains = &blw_decentral_recursive_ops;
    assert_broken();
    made.steady.d = 3U;
    assert_broken();
}

static void test_init_given_wrong_sets_refuses(void)
{
    made.sets.n_sets = 0U;
    assert_refused(BLW_ERR_MODEL, MEM);
    decentral_make(&made, false);
    made.sets.parent = NULL;
    assert_refused(BLW_ERR_MODEL, MEM);
    decentral_make(&made, false);
    made.sets.sensor = NULL;
    assert_refused(BLW_ERR_MODEL, MEM);
    decentral_make(&made, false);
    made.sets.candidate = NULL;
    assert_broken();
    made.parent[0] = 1U;
    assert_broken();
    made.parent[2] = 2U;
    assert_broken();
    made.sensor[3] = 3U;
    assert_broken();
    made.sensor[4] = 0U;
    assert_broken();
    made.model.rows = 1U;
    assert_broken();
    made.candidate[1] = 5U;
    assert_broken();
}

static void test_init_given_wrong_thresholds_refuses(void)
{
    made.ranking.removed = NULL;
    assert_broken();
    made.ranking.n_ranked = 4U;
    assert_refused(BLW_ERR_MODEL, MEM);
    decentral_make(&made, false);
    made.ranking.n_ranked = 1U;
    made.ranking.n_knots  = 1U;
    assert_broken();
    made.removed[1] = 3U;
    assert_broken();
    made.ranking.n_ranked = 1U;
    made.ranking.n_knots  = 3U;
    made.removed[0]       = 2U;
    made.removed[2]       = 1U;
    assert_broken();
    made.thr[0] = BLW_R(0.0);
    assert_broken();
    made.thr[1] = support_nan;
    assert_broken();
    made.scale[2] = -made.scale[2];
    assert_broken();
    made.ranking.n_ranked = 1U;
    made.ranking.n_knots  = 3U;
    made.knots[2]         = made.knots[1];
    assert_broken();
}

static void test_init_given_wrong_gains_refuses(void)
{
    made.steady.at = NULL;
    assert_refused(BLW_ERR_MODEL, MEM);
    decentral_make(&made, false);
    made.at[0] = 1U;
    assert_broken();
    made.at[5] = 3U;
    assert_refused(BLW_ERR_MODEL, MEM);
    decentral_make(&made, false);
    made.steady.N = NULL;
    assert_broken();
    decentral_make(&made, true);
    made.model.gains = &blw_decentral_steady_ops;
    assert_broken();
    made.E[2] = BLW_R(0.0);
    assert_broken();
    made.model.reseed = 1U;
    assert_broken();
    made.model.warm_up = 1U;
    assert_broken();
    made.recursive.V = NULL;
    assert_broken();
}

static void test_reset_given_bad_arguments_changes_nothing(void)
{
    const blw_real_t bad[1] = {support_nan};

    step(calm, 7U);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_decentral_reset(NULL, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_decentral_reset(&filter, bad));
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, filter.x_hat[0]);
}

static void test_step_given_bad_arguments_refuses(void)
{
    const blw_real_t u[1] = {support_inf};

    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_decentral_step(NULL, NULL, calm, 7U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_decentral_step(&filter, NULL, calm, 7U, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_decentral_step(&filter, NULL, NULL, 7U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_decentral_step(&filter, NULL, calm, 8U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_INPUT, blw_decentral_step(&filter, u, calm, 7U, &out));
}

static void test_step_given_a_missing_sample_coasts_on_its_prediction(void)
{
    const blw_real_t bad[4] = {support_nan, support_inf, -support_inf, BLW_REAL_MAX};

    for (size_t i = 0U; i < 5U; i++) {
        const blw_real_t y[3] = {bad[i % 4U], BLW_R(4.0), BLW_R(5.0)}; /* nu = 0, 2, 2 */

        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_reset(&filter, NULL));
        step(y, (i < 4U) ? 7U : 6U);
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.0 / 3.0, out.x_hat[0]);
        TEST_ASSERT_EQUAL_HEX64(6U, out.used);
        TEST_ASSERT_EQUAL_HEX64(0U, out.excluded);
        TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING, out.flags);
        TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.suspicion[0]);
    }
}

static void test_step_given_a_long_gap_leaves_the_sensor_out_until_it_passes(void)
{
    for (size_t k = 1U; k <= 20U; k++) {
        step(calm, 6U);
        TEST_ASSERT_EQUAL_HEX64((k <= 2U) ? 0U : 1U, out.excluded); /* max_gap = 2 */
    }
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_CONVERGED, out.outcome);
    for (size_t k = 1U; k <= DECENTRAL_READMIT; k++) {
        TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
        step(calm, 7U);
    }
    TEST_ASSERT_EQUAL_HEX64(0U, out.excluded);
}

static void test_step_given_two_silent_sensors_leaves_both_out(void)
{
    const blw_real_t y[3] = {BLW_R(0.0), BLW_R(0.0), BLW_R(5.0)}; /* nu_2 = 2 */

    for (size_t k = 0U; k < 3U; k++) {
        step(calm, 4U);
    }
    step(y, 4U);
    TEST_ASSERT_EQUAL_HEX64(3U, out.excluded);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 1.0, out.x_hat[0]); /* delta_2 alone */
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING | BLW_FLAG_DEGRADED, out.flags);
}

static void test_step_given_a_silent_sensor_keeps_it_out_in_a_search(void)
{
    const blw_real_t y[3] = {BLW_R(1.0), BLW_R(42.0), BLW_R(103.0)};

    for (size_t k = 0U; k < 3U; k++) {
        step(calm, 6U);
    }
    step(y, 6U); /* no two of the three agree, 0 and 1 least badly: it is {0}, which was silent */
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
    TEST_ASSERT_EQUAL_UINT(4U, out.iterations);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_HELD, out.outcome);
}

static void test_step_given_a_misfit_that_is_not_gross_leaves_the_silent_sensor_out(void)
{
    blw_real_t lie = BLW_R(0.0);

    for (size_t k = 0U; k < 3U; k++) {
        step(calm, 6U);
    }
    while (out.outcome != (uint8_t)BLW_OUTCOME_HELD) { /* the least that {0} does not explain */
        const blw_real_t y[3] = {BLW_R(1.0), BLW_R(2.0), BLW_R(3.0) + lie};
        lie += BLW_R(0.25);
        TEST_ASSERT_TRUE(lie < BLW_R(100.0));
        step(y, 6U);
        TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
    }
    TEST_ASSERT_EQUAL_UINT(1U, out.iterations);
}

static void test_step_given_a_liar_beside_a_silent_sensor_believes_what_that_told_last(void)
{
    const blw_real_t y[3] = {BLW_R(1.0), BLW_R(2.0), BLW_R(103.0)};

    for (size_t k = 0U; k < 3U; k++) {
        step(calm, 6U);
    }
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
    step(y, 6U); /* 1 and 2 disagree, and 0, silent for 4 steps, was where 1 is */
    TEST_ASSERT_EQUAL_HEX64(4U, out.excluded);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_CONVERGED, out.outcome);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, out.x_hat[0]);
}

static void test_step_given_silence_and_no_set_that_holds_it_searches_every_step(void)
{
    const blw_real_t attacked[3] = {BLW_R(101.0), BLW_R(2.0), BLW_R(3.0)};

    made.plant.p           = 2U;
    made.sets.n_candidates = 1U;
    made.candidate[0]      = 4U; /* {0, 1} alone */
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_init(&filter, &made.model, mem, MEM));
    step(attacked, 7U);
    TEST_ASSERT_EQUAL_HEX64(3U, out.excluded);
    for (size_t k = 0U; k < 3U; k++) {
        step(attacked, 3U);
    }
    TEST_ASSERT_EQUAL_HEX64(3U, out.excluded);
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING | BLW_FLAG_DEGRADED | BLW_FLAG_BLIND, out.flags);
}

static void test_step_given_silence_elsewhere_replaces_an_excluded_sensor_that_is_calm(void)
{
    const blw_real_t attacked[3] = {BLW_R(101.0), BLW_R(2.0), BLW_R(3.0)};

    made.model.readmit = 0U;
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_init(&filter, &made.model, mem, MEM));
    step(attacked, 7U);
    for (size_t k = 0U; k < 3U; k++) {
        step(attacked, 3U);
        TEST_ASSERT_EQUAL_HEX64(1U, out.excluded); /* sensor 0 still lies */
    }
    for (size_t k = 0U; k < 5U; k++) {
        TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
        step(calm, 3U);
    }
    TEST_ASSERT_EQUAL_HEX64(4U, out.excluded);
}

static void test_step_given_no_sample_predicts_and_says_so(void)
{
    const blw_real_t x0[1] = {BLW_R(8.0)};

    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_reset(&filter, x0));
    step(calm, 0U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 4.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING | BLW_FLAG_DEGRADED | BLW_FLAG_BLIND, out.flags);
}

static void test_step_given_attacks_of_any_size_leaves_no_trace_in_the_estimate(void)
{
    for (blw_real_t a = BLW_R(100.0); a < BLW_SIGNAL_MAX; a *= BLW_R(10.0)) {
        const blw_real_t y[3] = {BLW_R(1.0) - a, BLW_R(4.0), BLW_R(5.0)}; /* nu = -a, 2, 2 */

        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_reset(&filter, NULL));
        step(y, 7U);
        TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
        TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_CONVERGED, out.outcome);
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 1.0, out.x_hat[0]);
        TEST_ASSERT_TRUE(out.statistic <= BLW_REAL_MAX);
    }
}

static void test_step_given_a_prediction_out_of_bounds_starts_again(void)
{
    const blw_real_t A[1]  = {BLW_R(2.0)};
    const blw_real_t x0[1] = {BLW_SIGNAL_MAX};
    const blw_real_t K[3]  = {BLW_R(1.0), BLW_R(1.0), BLW_R(1.0)};
    const blw_real_t y[3]  = {BLW_SIGNAL_MAX, BLW_SIGNAL_MAX, BLW_SIGNAL_MAX};

    made.plant.A  = A;
    made.steady.K = K;
    decentral_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_init(&filter, &made.model, mem, MEM));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_reset(&filter, x0));
    step(y, 7U); /* x_bar = 2e15 is out of bounds: the model's x0 takes its place */
    TEST_ASSERT_TRUE(blw_la_bounded(1U, out.x_hat));
    for (size_t k = 0U; k < 200U; k++) {
        step(calm, 7U);
        TEST_ASSERT_TRUE(blw_la_bounded(1U, out.x_hat));
    }
}

static void test_step_given_a_fusion_out_of_bounds_predicts(void)
{
    const blw_real_t tenth     = BLW_SIGNAL_MAX / BLW_R(10.0);
    const blw_real_t A[1]      = {BLW_R(1.0)};
    const blw_real_t x0[1]     = {BLW_SIGNAL_MAX};
    const blw_real_t offset[3] = {-tenth, -tenth, -tenth};
    const blw_real_t y[3]      = {BLW_SIGNAL_MAX, BLW_SIGNAL_MAX, BLW_SIGNAL_MAX};

    made.plant.A      = A;
    made.plant.offset = offset;
    for (size_t i = 0U; i < 3U; i++) {
        made.scale[i] = BLW_R(1.0) / BLW_SIGNAL_MAX;
    }
    decentral_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_init(&filter, &made.model, mem, MEM));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_reset(&filter, x0));
    step(y, 7U);
    TEST_ASSERT_REAL_WITHIN(0.0, x0[0], out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX64(0U, out.used);
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, filter.delta[1]);
}

static void test_ops_given_the_interface_reach_the_same_functions(void)
{
    const blw_estimator_ops_t *const ops   = &blw_decentral_ops;
    blw_model_t                      other = made.model.head;

    TEST_ASSERT_EQUAL_size_t(MEM, ops->mem_len(&made.model.head));
    TEST_ASSERT_EQUAL_size_t(sizeof filter, ops->state_size);
    other.method = (uint8_t)BLW_METHOD_LASSO;
    TEST_ASSERT_EQUAL_size_t(0U, ops->mem_len(&other));
    TEST_ASSERT_EQUAL_size_t(0U, ops->mem_len(NULL));
    other.plant = NULL;
    TEST_ASSERT_EQUAL_size_t(0U, ops->mem_len(&other));
    TEST_ASSERT_EQUAL_INT(BLW_OK,
                          blw_estimator_init(&filter.base, ops, &made.model.head, mem, MEM));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_reset(&filter.base, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_step(&filter.base, NULL, calm, 7U, &out));
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, out.x_hat[0]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_given_null_or_little_memory_refuses);
    RUN_TEST(test_init_given_a_wrong_head_or_sum_refuses);
    RUN_TEST(test_init_given_wrong_sizes_refuses);
    RUN_TEST(test_init_given_wrong_sets_refuses);
    RUN_TEST(test_init_given_wrong_thresholds_refuses);
    RUN_TEST(test_init_given_wrong_gains_refuses);
    RUN_TEST(test_reset_given_bad_arguments_changes_nothing);
    RUN_TEST(test_step_given_bad_arguments_refuses);
    RUN_TEST(test_step_given_a_missing_sample_coasts_on_its_prediction);
    RUN_TEST(test_step_given_a_long_gap_leaves_the_sensor_out_until_it_passes);
    RUN_TEST(test_step_given_two_silent_sensors_leaves_both_out);
    RUN_TEST(test_step_given_a_silent_sensor_keeps_it_out_in_a_search);
    RUN_TEST(test_step_given_a_misfit_that_is_not_gross_leaves_the_silent_sensor_out);
    RUN_TEST(test_step_given_a_liar_beside_a_silent_sensor_believes_what_that_told_last);
    RUN_TEST(test_step_given_silence_and_no_set_that_holds_it_searches_every_step);
    RUN_TEST(test_step_given_silence_elsewhere_replaces_an_excluded_sensor_that_is_calm);
    RUN_TEST(test_step_given_no_sample_predicts_and_says_so);
    RUN_TEST(test_step_given_attacks_of_any_size_leaves_no_trace_in_the_estimate);
    RUN_TEST(test_step_given_a_prediction_out_of_bounds_starts_again);
    RUN_TEST(test_step_given_a_fusion_out_of_bounds_predicts);
    RUN_TEST(test_ops_given_the_interface_reach_the_same_functions);
    return UNITY_END();
}
