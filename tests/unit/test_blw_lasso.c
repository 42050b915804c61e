/* SPDX-License-Identifier: MIT */
#include <string.h>
#include "lasso_case.h"

static void assert_init_refuses(blw_status_t expected)
{
    const blw_lasso_t before = filter;

    TEST_ASSERT_EQUAL_INT(expected, blw_lasso_init(&filter, &made.model, mem, MEM_P));
    TEST_ASSERT_EQUAL_MEMORY(&before, &filter, sizeof before);
    support_lasso_make(&made, BLW_METHOD_LASSO);
}

static void test_init_given_null_is_an_argument_error(void)
{
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_lasso_init(NULL, &made.model, mem, MEM));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_lasso_init(&filter, NULL, mem, MEM));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_lasso_init(&filter, &made.model, NULL, MEM));
}

static void test_init_given_little_memory_refuses(void)
{
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_init(&filter, &made.model, mem, MEM));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MEM, blw_lasso_init(&filter, &made.model, mem, MEM - 1U));
    support_lasso_make(&made, BLW_METHOD_CANONICAL);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MEM, blw_lasso_init(&filter, &made.model, mem, MEM_P - 1U));
}

static void test_init_given_a_method_that_does_not_match_p_refuses(void)
{
    made.model.head.method = (uint8_t)BLW_METHOD_CANONICAL;
    assert_init_refuses(BLW_ERR_MODEL);
    made.model.head.method = (uint8_t)BLW_METHOD_KALMAN;
    assert_init_refuses(BLW_ERR_MODEL);
    support_lasso_make(&made, BLW_METHOD_CANONICAL);
    made.model.head.method = (uint8_t)BLW_METHOD_LASSO;
    assert_init_refuses(BLW_ERR_MODEL);
}

static void test_init_given_missing_parts_refuses(void)
{
    made.model.jordan = NULL;
    assert_init_refuses(BLW_ERR_MODEL);
    made.model.l1 = NULL;
    assert_init_refuses(BLW_ERR_MODEL);
    made.model.head.plant = NULL;
    assert_init_refuses(BLW_ERR_MODEL);
    made.jordan.b = NULL;
    assert_init_refuses(BLW_ERR_MODEL);
    made.l1.Z = NULL;
    assert_init_refuses(BLW_ERR_MODEL);
}

static void test_init_given_parts_that_do_not_fit_together_refuses(void)
{
    static const blw_real_t zeros[9] = {BLW_R(0.0)};

    made.jordan.r  = 2U; /* N would be 6 */
    made.jordan.J0 = made.jordan.J1 = made.jordan.J2 = made.jordan.Jm = zeros;
    made.jordan.b = made.jordan.D = made.jordan.G = zeros;
    support_lasso_seal(&made);
    assert_init_refuses(BLW_ERR_MODEL);
    made.plant.n = 2U; /* l1 has 1 */
    made.plant.A = made.plant.Bu = made.plant.C = made.plant.x0 = zeros;
    made.jordan.G                                               = zeros;
    support_lasso_seal(&made);
    assert_init_refuses(BLW_ERR_MODEL);
    made.model.ambiguous = 2U;
    assert_init_refuses(BLW_ERR_MODEL);
}

static void test_init_given_a_wrong_sum_refuses(void)
{
    const blw_real_t bad_P[3] = {BLW_R(1.0), support_nan, BLW_R(1.0)};

    made.model.head.crc ^= 1U;
    assert_init_refuses(BLW_ERR_MODEL);
    support_lasso_make(&made, BLW_METHOD_CANONICAL);
    made.model.P = bad_P;
    assert_init_refuses(BLW_ERR_MODEL);
}

static void test_step_given_benign_samples_yields_the_kalman_estimate_at_once(void)
{
    support_kalman_t    kalman_made;
    blw_real_t          kalman_mem[BLW_KALMAN_MEM(1, 3)];
    blw_kalman_t        kalman;
    blw_estimator_out_t kalman_out;

    support_kalman_make(&kalman_made);
    TEST_ASSERT_EQUAL_INT(
        BLW_OK, blw_kalman_init(&kalman, &kalman_made.model, kalman_mem, BLW_KALMAN_MEM(1, 3)));
    for (size_t k = 0U; k < 20U; k++) {
        step(benign, 7U);
        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&kalman, u, benign, 7U, &kalman_out));
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, kalman_out.x_hat[0], out.x_hat[0]);
        TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_KALMAN, out.outcome);
        TEST_ASSERT_EQUAL_UINT(0U, out.iterations);
    }
}

static void test_step_given_benign_samples_reports_hand_computed_figures(void)
{
    step(benign, 7U); /* l = 0.5, 0, -0.5 */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0, out.x_hat[0]);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.5, out.statistic);
    TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.threshold);
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, out.bound);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 1.0 / 3.0, out.suspicion[0]);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, out.suspicion[1]);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 1.0 / 3.0, out.suspicion[2]);
    TEST_ASSERT_EQUAL_HEX64(7U, out.used);
    TEST_ASSERT_EQUAL_HEX64(0U, out.excluded);
    TEST_ASSERT_EQUAL_HEX8(0U, out.flags);
}

static void test_step_given_an_attack_yields_the_hand_computed_secure_estimate(void)
{
    step(attacked, 7U); /* mu = 6.5, nu_0 = 8.5, l = 1, -0.5, -0.5 */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.25, out.x_hat[0]);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 20.0 / 3.0, out.statistic);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_CONVERGED, out.outcome);
    TEST_ASSERT_TRUE(out.iterations > 0U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 9.5 / 10.5, out.suspicion[0]);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 1.0 / 3.0, out.suspicion[1]);
    TEST_ASSERT_EQUAL_HEX8(0U, out.flags);
}

static void test_step_given_too_few_iterations_reports_the_bound(void)
{
    const blw_real_t two[3] = {BLW_R(14.0), BLW_R(-16.0), BLW_R(6.0)};

    made.l1.max_iterations = 1U;
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_init(&filter, &made.model, mem, MEM));
    step(two, 7U); /* zeta = 16, -15, 6: needs two groups */
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_BOUND, out.outcome);
    TEST_ASSERT_TRUE(out.bound >= (blw_real_t)0.0);
    TEST_ASSERT_TRUE((out.x_hat[0] >= BLW_R(-7.5)) && (out.x_hat[0] <= BLW_R(8.0)));
}

static void test_step_given_canonical_tables_transforms_every_sensor_by_its_own_p(void)
{
    const blw_real_t P[3] = {BLW_R(2.0), BLW_R(1.0), BLW_R(1.0)};

    start(BLW_METHOD_CANONICAL);
    step(attacked, 7U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.25, out.x_hat[0]);
    made.model.P = P;
    support_lasso_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_init(&filter, &made.model, mem, MEM_P));
    step(benign, 7U); /* about x_bar: zeta = 0.5, 0, -0.5, xi = 1, 0, -0.5, x_hat = 3 + 0.5/6 */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 37.0 / 12.0, out.x_hat[0]);
}

static void test_step_given_equal_weights_flags_ambiguity_unless_the_certificate_holds(void)
{
    made.model.ambiguous = 1U;
    step(benign, 7U);
    TEST_ASSERT_EQUAL_HEX8(0U, out.flags);
    step(attacked, 7U);
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_AMBIGUOUS, out.flags);
}

static void test_step_given_wrong_arguments_leaves_state_and_out_untouched(void)
{
    const blw_real_t bad_u[1] = {support_nan};
    blw_real_t       mem_before[MEM];

    step(attacked, 7U);
    const blw_estimator_out_t before = out;
    memcpy(mem_before, mem, sizeof mem_before);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_lasso_step(NULL, u, benign, 7U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_lasso_step(&filter, u, NULL, 7U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_lasso_step(&filter, u, benign, 8U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_lasso_step(&filter, u, benign, 7U, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_INPUT, blw_lasso_step(&filter, bad_u, benign, 7U, &out));
    TEST_ASSERT_EQUAL_MEMORY(&before, &out, sizeof out);
    TEST_ASSERT_EQUAL_MEMORY(mem_before, mem, sizeof mem_before);
}

static void test_reset_given_a_start_takes_it_and_refuses_what_is_not_finite(void)
{
    const blw_real_t x0[1]  = {BLW_R(10.0)};
    const blw_real_t bad[1] = {support_nan};

    step(attacked, 7U);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_reset(&filter, x0));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_lasso_reset(&filter, bad));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_lasso_reset(NULL, x0));
    step(benign, 0U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 6.0, out.x_hat[0]); /* 10/2 + 1 */
}

static void test_ops_given_the_same_data_yield_the_same_bits(void)
{
    static blw_real_t                other_mem[MEM];
    static blw_lasso_t               other;
    const blw_estimator_ops_t *const ops = &blw_lasso_ops;
    blw_estimator_out_t              other_out;

    TEST_ASSERT_EQUAL_INT(BLW_METHOD_LASSO, ops->method);
    TEST_ASSERT_EQUAL_size_t(sizeof(blw_lasso_t), ops->state_size);
    TEST_ASSERT_EQUAL_INT(BLW_OK,
                          blw_estimator_init(&other.base, ops, &made.model.head, other_mem, MEM));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_reset(&other.base, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_step(&other.base, u, attacked, 7U, &other_out));
    step(attacked, 7U);
    TEST_ASSERT_EQUAL_MEMORY(out.x_hat, other_out.x_hat, sizeof(blw_real_t));
}

static void test_mem_len_given_each_model_fits_it(void)
{
    TEST_ASSERT_EQUAL_size_t(MEM, blw_lasso_ops.mem_len(&made.model.head));
    support_lasso_make(&made, BLW_METHOD_CANONICAL);
    TEST_ASSERT_EQUAL_size_t(MEM_P, blw_lasso_ops.mem_len(&made.model.head));
    TEST_ASSERT_EQUAL_size_t(0U, blw_lasso_ops.mem_len(NULL));
    made.l1.n_groups = 2U; /* a pair makes room for all rows in the support */
    TEST_ASSERT_EQUAL_size_t(BLW_LASSO_MEM(1, 3, 3, 2, 2, 1),
                             blw_lasso_ops.mem_len(&made.model.head));
    made.model.head.method = (uint8_t)BLW_METHOD_KALMAN;
    TEST_ASSERT_EQUAL_size_t(0U, blw_lasso_ops.mem_len(&made.model.head));
    support_lasso_make(&made, BLW_METHOD_LASSO);
    made.model.head.plant = NULL;
    TEST_ASSERT_EQUAL_size_t(0U, blw_lasso_ops.mem_len(&made.model.head));
    support_lasso_make(&made, BLW_METHOD_LASSO);
    made.model.l1 = NULL;
    TEST_ASSERT_EQUAL_size_t(0U, blw_lasso_ops.mem_len(&made.model.head));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_given_null_is_an_argument_error);
    RUN_TEST(test_init_given_little_memory_refuses);
    RUN_TEST(test_init_given_a_method_that_does_not_match_p_refuses);
    RUN_TEST(test_init_given_missing_parts_refuses);
    RUN_TEST(test_init_given_parts_that_do_not_fit_together_refuses);
    RUN_TEST(test_init_given_a_wrong_sum_refuses);
    RUN_TEST(test_step_given_benign_samples_yields_the_kalman_estimate_at_once);
    RUN_TEST(test_step_given_benign_samples_reports_hand_computed_figures);
    RUN_TEST(test_step_given_an_attack_yields_the_hand_computed_secure_estimate);
    RUN_TEST(test_step_given_too_few_iterations_reports_the_bound);
    RUN_TEST(test_step_given_canonical_tables_transforms_every_sensor_by_its_own_p);
    RUN_TEST(test_step_given_equal_weights_flags_ambiguity_unless_the_certificate_holds);
    RUN_TEST(test_step_given_wrong_arguments_leaves_state_and_out_untouched);
    RUN_TEST(test_reset_given_a_start_takes_it_and_refuses_what_is_not_finite);
    RUN_TEST(test_ops_given_the_same_data_yield_the_same_bits);
    RUN_TEST(test_mem_len_given_each_model_fits_it);
    return UNITY_END();
}
