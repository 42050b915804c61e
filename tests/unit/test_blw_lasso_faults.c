/* SPDX-License-Identifier: MIT */
/* What the estimator makes of samples that are missing, huge or not numbers. */
#include "lasso_case.h"

/* Allowed of an estimate under an attack of any size: a thousandth of a standard deviation in
 * float. */
#define SECURE_TOL (8192.0 * (double)BLW_REAL_EPS)

static void test_step_given_a_missing_sample_coasts_on_its_prediction(void)
{
    const blw_real_t bad[4] = {support_nan, support_inf, -support_inf, BLW_REAL_MAX};

    for (size_t i = 0U; i < 5U; i++) {
        const blw_real_t gap[3] = {bad[i % 4U], BLW_R(5.5), BLW_R(5.5)};

        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_reset(&filter, NULL));
        step(gap, (i < 4U) ? 7U : 6U); /* zeta = 6, 6.5, 5.5 */
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0, out.x_hat[0]);
        TEST_ASSERT_EQUAL_HEX64(6U, out.used);
        TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING, out.flags);
        TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.suspicion[0]);
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 1.0 / 3.0, out.suspicion[1]);
    }
}

static void test_step_given_no_sample_predicts_and_says_so(void)
{
    step(benign, 0U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_KALMAN, out.outcome);
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING | BLW_FLAG_DEGRADED | BLW_FLAG_BLIND, out.flags);
}

static void test_step_given_attacks_of_any_size_bounds_their_effect(void)
{
    for (blw_real_t a = BLW_R(10.0); a < BLW_REAL_MAX / BLW_R(100.0); a *= BLW_R(10.0)) {
        const blw_real_t y[3]    = {a, attacked[1], attacked[2]};
        const bool       missing = a > BLW_SIGNAL_MAX;

        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_reset(&filter, NULL));
        step(y, 7U);
        TEST_ASSERT_REAL_WITHIN(SECURE_TOL, missing ? 3.0 : 3.25, out.x_hat[0]);
        TEST_ASSERT_EQUAL_HEX64(missing ? 6U : 7U, out.used);
    }
}

static void test_step_given_a_sample_that_overflows_its_filter_takes_it_as_missing(void)
{
    const blw_real_t b[3]   = {BLW_SIGNAL_MAX, BLW_R(1.0), BLW_R(1.0)};
    const blw_real_t far[3] = {BLW_SIGNAL_MAX, BLW_R(5.0), BLW_R(6.0)};

    made.jordan.b = b;
    support_lasso_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_init(&filter, &made.model, mem, MEM));
    step(far, 7U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX64(6U, out.used);
    TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.suspicion[0]);
}

static void test_step_given_a_sample_that_overflows_the_transform_takes_it_as_missing(void)
{
    const blw_real_t P[3]   = {BLW_R(10.0), BLW_R(1.0), BLW_R(1.0)};
    const blw_real_t far[3] = {BLW_R(0.5) * BLW_SIGNAL_MAX, BLW_R(5.0), BLW_R(6.0)};

    start(BLW_METHOD_CANONICAL);
    made.model.P = P;
    support_lasso_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_init(&filter, &made.model, mem, MEM_P));
    step(far, 7U);
    TEST_ASSERT_EQUAL_HEX64(6U, out.used);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0, out.x_hat[0]); /* x_bar, as the others say */
}

static void test_step_given_a_fusion_that_overflows_predicts(void)
{
    const blw_real_t F[3] = {BLW_SIGNAL_MAX, BLW_SIGNAL_MAX, BLW_SIGNAL_MAX};
    const blw_real_t y[3] = {BLW_R(5.0), BLW_R(5.5), BLW_R(6.0)}; /* innovations 1, 0.5, 0 */

    made.l1.F = F;
    support_lasso_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_init(&filter, &made.model, mem, MEM));
    step(y, 7U);
    TEST_ASSERT_REAL_WITHIN(0.0, 3.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX64(0U, out.used);
    TEST_ASSERT_TRUE((out.flags & BLW_FLAG_BLIND) != 0U);
    TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.suspicion[2]);
}

/* Numbers without pattern, the same on every target. */
static uint32_t draw(uint32_t *seed)
{
    *seed = (*seed * 1664525U) + 1013904223U;
    return *seed >> 16;
}

static void test_step_given_many_spikes_of_any_size_never_loses_the_state(void)
{
    const blw_real_t spikes[8] = {BLW_R(1e3),   BLW_R(-1e6),   BLW_SIGNAL_MAX, -BLW_SIGNAL_MAX,
                                  BLW_REAL_MAX, -BLW_REAL_MAX, support_nan,    support_inf};
    uint32_t         seed      = 1U;

    for (size_t k = 0U; k < 20000U; k++) {
        const uint32_t dice = draw(&seed);
        blw_real_t     y[3] = {attacked[0], attacked[1], attacked[2]};

        y[0] = ((dice % 3U) == 0U) ? spikes[draw(&seed) % 8U] : benign[0];
        step(y, (dice % 5U == 0U) ? 6U : 7U);
        TEST_ASSERT_TRUE((out.x_hat[0] >= BLW_R(1.0)) && (out.x_hat[0] <= BLW_R(6.0)));
    }
    for (size_t k = 0U; k < 400U; k++) { /* 0.25^400 BLW_SIGNAL_MAX is nothing */
        step(benign, 7U);
    }
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_KALMAN, out.outcome);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 8.0 / 3.0, out.x_hat[0]); /* x = (x/2 + 1)/2 + 3/2 */
}

static void test_step_given_an_unstable_plant_recovers_after_any_time_without_samples(void)
{
    const blw_real_t A[1] = {BLW_R(2.0)}; /* with K = 7/24: J = 1/4, G = 8/7, D = 1/7, F = K */
    const blw_real_t F[3] = {BLW_R(7.0) / BLW_R(24.0), BLW_R(7.0) / BLW_R(24.0),
                             BLW_R(7.0) / BLW_R(24.0)};
    const blw_real_t G[3] = {BLW_R(8.0) / BLW_R(7.0), BLW_R(8.0) / BLW_R(7.0),
                             BLW_R(8.0) / BLW_R(7.0)};
    const blw_real_t D[3] = {BLW_R(1.0) / BLW_R(7.0), BLW_R(1.0) / BLW_R(7.0),
                             BLW_R(1.0) / BLW_R(7.0)};
    const blw_real_t y[3] = {BLW_R(0.0), BLW_R(1.0), BLW_R(2.0)}; /* x = -1 = 2 x + u */

    made.plant.A  = A;
    made.l1.F     = F;
    made.jordan.G = G;
    made.jordan.D = D;
    support_lasso_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_init(&filter, &made.model, mem, MEM));
    for (size_t k = 0U; k < 2000U; k++) {
        step(y, 0U);
        TEST_ASSERT_TRUE(out.x_hat[0] <= BLW_SIGNAL_MAX);
    }
    for (size_t k = 0U; k < 300U; k++) {
        step(y, 7U);
    }
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, -1.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX8(0U, out.flags);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_step_given_a_missing_sample_coasts_on_its_prediction);
    RUN_TEST(test_step_given_no_sample_predicts_and_says_so);
    RUN_TEST(test_step_given_attacks_of_any_size_bounds_their_effect);
    RUN_TEST(test_step_given_a_sample_that_overflows_its_filter_takes_it_as_missing);
    RUN_TEST(test_step_given_a_sample_that_overflows_the_transform_takes_it_as_missing);
    RUN_TEST(test_step_given_a_fusion_that_overflows_predicts);
    RUN_TEST(test_step_given_many_spikes_of_any_size_never_loses_the_state);
    RUN_TEST(test_step_given_an_unstable_plant_recovers_after_any_time_without_samples);
    return UNITY_END();
}
