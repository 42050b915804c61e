/* SPDX-License-Identifier: MIT */
#include "decentral_model.h"

#define MEM           BLW_DECENTRAL_MEM(1, 3, 3, 2, 0)
#define MEM_RECURSIVE BLW_DECENTRAL_MEM(1, 3, 3, 2, 1)

static const blw_real_t u[1] = {BLW_R(1.0)};

static decentral_made_t    made;
static blw_real_t          mem[MEM_RECURSIVE];
static blw_decentral_t     filter;
static blw_estimator_out_t out;

static void start(void)
{
    decentral_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_init(&filter, &made.model, mem, MEM_RECURSIVE));
}

void setUp(void)
{
    decentral_make(&made, false);
    start();
}

void tearDown(void) {}

/* One step with the innovations nu_i; u(k-1) = 0. */
static void step_nu(blw_real_t nu_0, blw_real_t nu_1, blw_real_t nu_2, blw_mask_t valid)
{
    const blw_real_t x_bar = filter.x_hat[0] / BLW_R(2.0);
    const blw_real_t y[3]  = {x_bar + nu_0 + BLW_R(1.0), x_bar + nu_1 + BLW_R(2.0),
                              x_bar + nu_2 + BLW_R(3.0)};

    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_step(&filter, NULL, y, valid, &out));
}

static void quiet_steps(size_t count)
{
    for (size_t k = 0U; k < count; k++) {
        step_nu(BLW_R(0.0), BLW_R(0.0), BLW_R(0.0), 7U);
    }
}

static void test_step_given_input_and_samples_yields_hand_computed_estimate(void)
{
    const blw_real_t y[3] = {BLW_R(4.0), BLW_R(5.0), BLW_R(6.0)}; /* x_bar = 1, nu = 2, 2, 2 */

    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_step(&filter, u, y, 7U, &out));
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.0, out.x_hat[0]);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, out.statistic);
    TEST_ASSERT_REAL_WITHIN(0.0, DECENTRAL_THR, out.threshold);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.2, out.suspicion[1]); /* s = (2/4)^2 */
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_KALMAN, out.outcome);
    TEST_ASSERT_EQUAL_HEX64(0U, out.excluded);
    TEST_ASSERT_EQUAL_HEX64(7U, out.used);
    TEST_ASSERT_EQUAL_UINT(0U, out.iterations);
    TEST_ASSERT_EQUAL_HEX8(0U, out.flags);
}

static void test_step_given_noise_yields_hand_computed_statistic(void)
{
    step_nu(BLW_R(4.0), BLW_R(2.0), BLW_R(0.0), 7U); /* delta 2 1 0 */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.0, out.statistic);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 1.0, out.x_hat[0]);
    step_nu(BLW_R(0.0), BLW_R(0.0), BLW_R(0.0), 7U); /* delta 1/4 0 -1/4 */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.125, out.statistic);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.5, out.x_hat[0]);
}

static void test_step_given_one_attacked_sensor_leaves_it_out(void)
{
    for (size_t i = 0U; i < 3U; i++) {
        const blw_real_t a     = BLW_R(1000.0);
        const blw_real_t nu[3] = {(i == 0U) ? a : BLW_R(2.0), (i == 1U) ? a : BLW_R(2.0),
                                  (i == 2U) ? a : BLW_R(4.0)};
        const double other = (i == 2U) ? 1.0 : 1.5; /* mean of delta = nu / 2 */

        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_decentral_reset(&filter, NULL));
        step_nu(nu[0], nu[1], nu[2], 7U);
        TEST_ASSERT_EQUAL_HEX64(1U << i, out.excluded);
        TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_CONVERGED, out.outcome);
        TEST_ASSERT_EQUAL_UINT(3U, out.iterations);
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, other, out.x_hat[0]);
        TEST_ASSERT_TRUE(out.statistic > DECENTRAL_THR);
        TEST_ASSERT_TRUE(out.suspicion[i] > BLW_R(0.99));
    }
}

static void test_step_given_attack_over_readmits_after_the_passes_in_a_row(void)
{
    step_nu(BLW_R(100.0), BLW_R(0.0), BLW_R(0.0), 7U); /* delta_0 = 50, g = 1667, then / 16 */
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
    step_nu(BLW_R(0.0), BLW_R(0.0), BLW_R(0.0), 7U);  /* delta_0 = 12.5, g = 104 */
    step_nu(BLW_R(0.0), BLW_R(0.0), BLW_R(0.0), 7U);  /* g = 6.5: passes */
    step_nu(BLW_R(60.0), BLW_R(0.0), BLW_R(0.0), 7U); /* again: counts from 0 */
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
    quiet_steps(2U); /* g = 39, 2.5 */
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
    quiet_steps(DECENTRAL_READMIT - 2U);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_CONVERGED, out.outcome);
    quiet_steps(1U);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_KALMAN, out.outcome);
    TEST_ASSERT_EQUAL_HEX64(0U, out.excluded);
}

static void test_step_given_readmit_0_never_returns(void)
{
    made.model.readmit = 0U;
    start();
    step_nu(BLW_R(100.0), BLW_R(0.0), BLW_R(0.0), 7U);
    quiet_steps(100U);
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
}

static void test_step_given_attack_moves_to_another_sensor_follows_it(void)
{
    step_nu(BLW_R(100.0), BLW_R(0.0), BLW_R(0.0), 7U);
    quiet_steps(3U);
    step_nu(BLW_R(0.0), BLW_R(0.0), BLW_R(-100.0), 7U);
    TEST_ASSERT_EQUAL_HEX64(4U, out.excluded);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_CONVERGED, out.outcome);
    TEST_ASSERT_EQUAL_UINT(3U, out.iterations);
}

static void test_step_given_reseed_restarts_a_filter_that_agrees_again(void)
{
    made.model.reseed = 1U;
    start();
    step_nu(BLW_R(1e6), BLW_R(0.0), BLW_R(0.0), 7U);
    quiet_steps(3U);
    TEST_ASSERT_TRUE(out.statistic > DECENTRAL_THR); /* the filter has not forgotten */
    quiet_steps(1U);
    TEST_ASSERT_TRUE(out.statistic > DECENTRAL_THR); /* seeded at the end of this step */
    quiet_steps(1U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, out.statistic);
    quiet_steps(DECENTRAL_READMIT - 1U);
    TEST_ASSERT_EQUAL_HEX64(0U, out.excluded);
}

static void test_step_given_reseed_and_a_last_sensor_restarts_its_filter(void)
{
    made.model.reseed = 1U;
    start();
    step_nu(BLW_R(0.0), BLW_R(2.0), BLW_R(1e6), 7U); /* delta 0 1 5e5: x_J = 1/2, g_J = 1/2 */
    TEST_ASSERT_EQUAL_HEX64(4U, out.excluded);
    quiet_steps(5U);
    TEST_ASSERT_EQUAL_HEX64(4U, out.excluded);
    TEST_ASSERT_TRUE(out.statistic <= BLW_R(0.5));
}

static void test_step_given_reseed_leaves_a_filter_that_passes_alone(void)
{
    made.model.reseed  = 1U;
    made.model.readmit = 20U;
    start();
    step_nu(BLW_R(100.0), BLW_R(0.0), BLW_R(0.0), 7U); /* delta_0 = 50, 12.5, 3.125, ... */
    quiet_steps(7U);
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 50.0 / 16384.0, filter.delta[0] - filter.delta[1]);
}

static void test_step_given_every_set_fails_reports_the_best_and_says_so(void)
{
    step_nu(BLW_R(0.0), BLW_R(20.0), BLW_R(100.0), 7U); /* {0, 1}: g = 50 > 4 */
    TEST_ASSERT_EQUAL_HEX64(4U, out.excluded);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_HELD, out.outcome);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 5.0, out.x_hat[0]);
}

static void test_step_given_no_sample_at_all_keeps_the_choice(void)
{
    step_nu(BLW_R(0.0), BLW_R(0.0), BLW_R(1000.0), 7U);
    filter.delta[0] = BLW_R(100.0); /* then 25: without sensor 2, g = 312 > 4 */
    step_nu(BLW_R(0.0), BLW_R(0.0), BLW_R(0.0), 0U);
    TEST_ASSERT_EQUAL_HEX64(4U, out.excluded);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_HELD, out.outcome);
    TEST_ASSERT_EQUAL_UINT(0U, out.iterations);
    filter.delta[0] = BLW_R(100.0);
    step_nu(BLW_R(0.0), BLW_R(0.0), BLW_R(0.0), 2U); /* delta near 25, 0, 31: 0 and 2 agree */
    TEST_ASSERT_EQUAL_HEX64(2U, out.excluded);
    TEST_ASSERT_EQUAL_UINT(3U, out.iterations);
}

static void test_step_given_no_candidates_keeps_all_sensors_and_says_so(void)
{
    made.plant.p           = 0U;
    made.sets.n_candidates = 0U;
    start();
    step_nu(BLW_R(100.0), BLW_R(0.0), BLW_R(0.0), 7U);
    TEST_ASSERT_EQUAL_HEX64(0U, out.excluded);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_HELD, out.outcome);
    TEST_ASSERT_EQUAL_UINT(0U, out.iterations);
}

/* Weights that differ by sensor set: with c, the set with the smaller g need not win. */
static void test_search_given_degrees_of_freedom_compares_g_plus_c(void)
{
    const blw_real_t g[6]      = {BLW_R(-1.0), BLW_R(0.0),  BLW_R(5.0),
                                  BLW_R(15.0), BLW_R(20.0), BLW_R(5000.0)};
    const double     offset[6] = {0.0, 0.0, 2.5, 6.5, 8.0, 8.0};
    uint16_t         compared  = 0U;

    made.ranking.n_ranked = 1U;
    made.ranking.n_knots  = 3U;
    start();
    for (size_t i = 0U; i < 6U; i++) {
        filter.delta[0] = BLW_R(0.0);
        filter.delta[1] = blw_la_sqrt(BLW_R(2.0) * blw_la_max(g[i], BLW_R(0.0)));
        filter.delta[2] = BLW_R(0.0);
        TEST_ASSERT_REAL_WITHIN(5000.0 * SUPPORT_TOL, (g[i] > BLW_R(0.0)) ? (double)g[i] : 0.0,
                                made.model.gains->statistic(&filter, 1U));
        TEST_ASSERT_REAL_WITHIN(5000.0 * SUPPORT_TOL, (double)g[i] + offset[i],
                                blw_decentral_score(&made.model, 1U, g[i]));
        TEST_ASSERT_EQUAL_size_t((g[i] > BLW_R(0.0)) ? 2U : 1U,
                                 blw_decentral_search(&filter, 0U, &compared));
        TEST_ASSERT_EQUAL_UINT(3U, compared);
    }
}

static void test_score_given_values_far_out_keeps_their_order(void)
{
    const blw_real_t far[2] = {BLW_R(1e30), BLW_R(1.001e30)};

    made.ranking.n_ranked = 1U;
    made.ranking.n_knots  = 3U;
    TEST_ASSERT_TRUE(blw_decentral_score(&made.model, 1U, far[0])
                     < blw_decentral_score(&made.model, 2U, far[1]));
    TEST_ASSERT_TRUE(blw_decentral_score(&made.model, 1U, BLW_R(5000.0))
                     < blw_decentral_score(&made.model, 2U, BLW_R(5001.0)));
}

static void test_cover_given_silent_sensors_takes_the_set_with_the_fewest_others(void)
{
    const uint16_t             parent[4] = {0U, 0U, 1U, 0U};
    const uint16_t             sensor[4] = {0U, 0U, 1U, 1U}; /* {0}, {0, 1}, {1} */
    const blw_decentral_sets_t sets      = {.n_sets = 4U, .parent = parent, .sensor = sensor};

    TEST_ASSERT_EQUAL_size_t(1U, blw_decentral_cover(&sets, 1U));
    TEST_ASSERT_EQUAL_size_t(3U, blw_decentral_cover(&sets, 2U));
    TEST_ASSERT_EQUAL_size_t(2U, blw_decentral_cover(&sets, 3U));
    TEST_ASSERT_EQUAL_size_t(0U, blw_decentral_cover(&sets, 4U));
}

static void test_statistic_given_a_set_of_two_leaves_nothing_to_test(void)
{
    filter.delta[0] = BLW_R(7.0);
    filter.delta[1] = BLW_R(-3.0);
    filter.delta[2] = BLW_R(2.0);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, made.model.gains->statistic(&filter, 4U));
    made.model.gains->estimate(&filter, 4U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.0, filter.dx[0]);
    TEST_ASSERT_REAL_WITHIN(64.0 * SUPPORT_TOL, 50.0, made.model.gains->all_statistic(&filter, 4U));
}

static void test_step_given_recursive_gains_yields_hand_computed_estimate(void)
{
    decentral_make(&made, true);
    start();
    TEST_ASSERT_FALSE(filter.usable);                /* P0 has rank 1 */
    step_nu(BLW_R(1.0), BLW_R(2.0), BLW_R(3.0), 7U); /* delta = nu / 5, g = |nu - 2|^2 */
    TEST_ASSERT_TRUE(filter.usable);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.4, out.x_hat[0]);
    TEST_ASSERT_REAL_WITHIN(8.0 * SUPPORT_TOL, 2.0, out.statistic);
    TEST_ASSERT_EQUAL_HEX8(0U, out.flags);
}

static void test_step_given_recursive_gains_and_an_attack_leaves_it_out(void)
{
    decentral_make(&made, true);
    start();
    step_nu(BLW_R(1.0), BLW_R(100.0), BLW_R(3.0), 7U);
    TEST_ASSERT_EQUAL_HEX64(2U, out.excluded);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.4, out.x_hat[0]); /* mean of 1/5 and 3/5 */
    TEST_ASSERT_EQUAL_UINT(3U, out.iterations);
    step_nu(BLW_R(0.0), BLW_R(100.0), BLW_R(0.0), 7U);
    TEST_ASSERT_EQUAL_HEX64(2U, out.excluded);
    TEST_ASSERT_TRUE(out.statistic > DECENTRAL_THR);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_CONVERGED, out.outcome);
}

static void test_step_given_recursive_gains_that_cannot_be_inverted_fuses_by_the_steady_ones(void)
{
    static const blw_real_t loud[6] = {BLW_R(1e15), BLW_R(0.0), BLW_R(1e15),
                                       BLW_R(0.0),  BLW_R(0.0), BLW_R(1e15)};

    decentral_make(&made, true);
    made.recursive.E = loud; /* K = 0: P keeps its rank of 1 */
    start();
    filter.delta[0] = BLW_R(30.0);
    step_nu(BLW_R(0.0), BLW_R(0.0), BLW_R(0.0), 7U);
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_WARMING_UP, out.flags);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_KALMAN, out.outcome);
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, out.statistic);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 5.0, out.x_hat[0]); /* 30 / 2 / 3 */
}

static void test_step_given_warm_up_tests_nothing_before_it_is_over(void)
{
    made.model.warm_up = 2U;
    start();
    for (size_t k = 1U; k <= 3U; k++) {
        step_nu(BLW_R(100.0), BLW_R(0.0), BLW_R(0.0), 7U);
        TEST_ASSERT_EQUAL_HEX64((k <= 2U) ? 0U : 1U, out.excluded);
        TEST_ASSERT_EQUAL_HEX8((k <= 2U) ? BLW_FLAG_WARMING_UP : 0U, out.flags);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_step_given_input_and_samples_yields_hand_computed_estimate);
    RUN_TEST(test_step_given_noise_yields_hand_computed_statistic);
    RUN_TEST(test_step_given_one_attacked_sensor_leaves_it_out);
    RUN_TEST(test_step_given_attack_over_readmits_after_the_passes_in_a_row);
    RUN_TEST(test_step_given_readmit_0_never_returns);
    RUN_TEST(test_step_given_attack_moves_to_another_sensor_follows_it);
    RUN_TEST(test_step_given_reseed_restarts_a_filter_that_agrees_again);
    RUN_TEST(test_step_given_reseed_and_a_last_sensor_restarts_its_filter);
    RUN_TEST(test_step_given_reseed_leaves_a_filter_that_passes_alone);
    RUN_TEST(test_step_given_every_set_fails_reports_the_best_and_says_so);
    RUN_TEST(test_step_given_no_sample_at_all_keeps_the_choice);
    RUN_TEST(test_step_given_no_candidates_keeps_all_sensors_and_says_so);
    RUN_TEST(test_search_given_degrees_of_freedom_compares_g_plus_c);
    RUN_TEST(test_score_given_values_far_out_keeps_their_order);
    RUN_TEST(test_cover_given_silent_sensors_takes_the_set_with_the_fewest_others);
    RUN_TEST(test_statistic_given_a_set_of_two_leaves_nothing_to_test);
    RUN_TEST(test_step_given_recursive_gains_yields_hand_computed_estimate);
    RUN_TEST(test_step_given_recursive_gains_and_an_attack_leaves_it_out);
    RUN_TEST(test_step_given_recursive_gains_that_cannot_be_inverted_fuses_by_the_steady_ones);
    RUN_TEST(test_step_given_warm_up_tests_nothing_before_it_is_over);
    return UNITY_END();
}
