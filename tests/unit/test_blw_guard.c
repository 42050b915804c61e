/* SPDX-License-Identifier: MIT */
#include "guard_model.h"

/* From x0 = 4 with u = 1: x_bar = 3; the innovations are y - offset - 3. */
static const blw_real_t u[1]      = {BLW_R(1.0)};
static const blw_real_t benign[3] = {BLW_R(4.5), BLW_R(5.0), BLW_R(5.5)};  /* 0.5, 0, -0.5 */
static const blw_real_t gross[3]  = {BLW_R(14.0), BLW_R(5.0), BLW_R(6.0)}; /* 10, 0, 0 */
static const blw_real_t mild[3]   = {BLW_R(7.3), BLW_R(5.0), BLW_R(6.0)};  /* 3.3, 0, 0 */

static guard_made_t        made;
static blw_real_t          mem[GUARD_MEM];
static blw_guard_t         guard;
static blw_estimator_out_t out;

static void start(void)
{
    guard_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_guard_init(&guard, &made.model, mem, GUARD_MEM));
}

void setUp(void)
{
    guard_make(&made);
    start();
}

void tearDown(void) {}

static void step(const blw_real_t *y, blw_mask_t valid)
{
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_guard_step(&guard, u, y, valid, &out));
}

static void test_step_given_benign_samples_reports_hand_computed_figures(void)
{
    step(benign, 7U); /* l = 0.75 s, 0, -0.75 s */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0, out.x_hat[0]);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.75 * GUARD_S, out.statistic);
    TEST_ASSERT_REAL_WITHIN(0.0, 2.0, out.threshold);
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, out.bound);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, (0.75 * GUARD_S) / (2.0 + (0.75 * GUARD_S)),
                            out.suspicion[0]);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, out.suspicion[1]);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_KALMAN, out.outcome);
    TEST_ASSERT_EQUAL_UINT(0U, out.iterations);
    TEST_ASSERT_EQUAL_HEX64(7U, out.used);
    TEST_ASSERT_EQUAL_HEX8(0U, out.flags);
}

static void test_step_given_benign_samples_stays_the_kalman_filter(void)
{
    blw_real_t          kalman_mem[BLW_KALMAN_MEM(1, 3)];
    blw_kalman_t        kalman;
    blw_estimator_out_t kalman_out;

    TEST_ASSERT_EQUAL_INT(
        BLW_OK, blw_kalman_init(&kalman, &made.kalman.model, kalman_mem, BLW_KALMAN_MEM(1, 3)));
    for (size_t k = 0U; k < 20U; k++) {
        const blw_real_t y[3] = {benign[0] + (blw_real_t)k, benign[1] + (blw_real_t)k, benign[2]};

        made.model.k = made.model.exclude = BLW_R(1000.0);
        step(y, 7U);
        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&kalman, u, y, 7U, &kalman_out));
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL * 8.0, kalman_out.x_hat[0], out.x_hat[0]);
    }
}

static void test_step_given_a_gross_attack_excludes_the_sensor(void)
{
    step(gross, 7U); /* h = 10 s, tau_0 = 0 */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0, out.x_hat[0]);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 10.0 * GUARD_S, out.statistic);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_CONVERGED, out.outcome);
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
    TEST_ASSERT_EQUAL_UINT(4U, out.iterations); /* two updates and a look in between */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, (10.0 * GUARD_S) / (2.0 + (10.0 * GUARD_S)),
                            out.suspicion[0]);
}

static void test_step_given_a_mild_attack_clips_it(void)
{
    step(mild, 7U); /* h = 3.3 s = 2.694, l = tau_0 = 2, x_hat = 3 + 2 / 6 s */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0 + (1.0 / (3.0 * GUARD_S)), out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX64(0U, out.excluded);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_CONVERGED, out.outcome);
    TEST_ASSERT_EQUAL_UINT(3U, out.iterations); /* an update and a look */
}

static void test_step_given_attacks_of_any_size_bounds_their_effect(void)
{
    for (blw_real_t a = BLW_R(100.0); a < BLW_REAL_MAX / BLW_R(100.0); a *= BLW_R(10.0)) {
        const blw_real_t y[3]    = {a, gross[1], gross[2]};
        const bool       missing = a > BLW_SIGNAL_MAX;

        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_guard_reset(&guard, NULL));
        step(y, 7U);
        TEST_ASSERT_REAL_WITHIN(4.0 * SUPPORT_TOL, 3.0, out.x_hat[0]);
        TEST_ASSERT_EQUAL_HEX64(missing ? 6U : 7U, out.used);
        TEST_ASSERT_EQUAL_HEX64(missing ? 0U : 1U, out.excluded);
    }
}

static void test_step_given_two_attacked_sensors_solves_them_jointly(void)
{
    const blw_real_t y[3] = {BLW_R(7.0), BLW_R(2.0), BLW_R(6.0)}; /* 3, -3, 0 */

    made.model.exclude     = BLW_R(100.0);
    made.model.max_updates = 60U;
    start();
    step(y, 7U); /* |h| = 4.5 s at first; the optimum has l = 2, -2, 0 and tau_0 = -tau_1 = 4/3 */
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_CONVERGED, out.outcome);
    TEST_ASSERT_REAL_WITHIN(1e-4, 3.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX64(0U, out.excluded);
    TEST_ASSERT_TRUE(out.iterations > 2U);
}

static void test_step_given_one_update_reports_bound_and_stays_bounded(void)
{
    const blw_real_t y[3] = {BLW_R(40.0), BLW_R(-40.0), BLW_R(6.0)};

    for (uint16_t most = 1U; most <= 4U; most++) {
        made.model.max_updates = most;
        start();
        step(y, 7U);
        TEST_ASSERT_TRUE(out.iterations <= most);
        TEST_ASSERT_TRUE((out.x_hat[0] >= BLW_R(-40.0)) && (out.x_hat[0] <= BLW_R(40.0)));
        TEST_ASSERT_EQUAL_INT(out.outcome == (uint8_t)BLW_OUTCOME_BOUND,
                              out.bound > (blw_real_t)SUPPORT_TOL);
    }
}

static void test_step_given_no_kappa_reports_the_largest_number(void)
{
    const blw_real_t y[3] = {BLW_R(40.0), BLW_R(-40.0), BLW_R(6.0)};

    made.model.max_updates = 1U;
    made.model.kappa       = BLW_R(0.0);
    start();
    step(y, 7U);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_BOUND, out.outcome);
    TEST_ASSERT_REAL_WITHIN(0.0, BLW_REAL_MAX, out.bound);
}

static void test_step_given_units_excludes_all_sensors_of_one(void)
{
    static const uint16_t pairs[3] = {0U, 1U, 0U};

    made.model.unit    = pairs;
    made.model.n_units = 2U;
    made.model.pairs   = 0U;
    start();
    step(gross, 7U);
    TEST_ASSERT_EQUAL_HEX64(5U, out.excluded);
    TEST_ASSERT_REAL_WITHIN(4.0 * SUPPORT_TOL, 3.0, out.x_hat[0]); /* sensor 1 says so */
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_DEGRADED, out.flags);
}

static void test_step_given_search_takes_the_set_that_explains_most(void)
{
    const blw_real_t y[3] = {BLW_R(24.0), BLW_R(17.0), BLW_R(6.0)}; /* 20, 12, 0 */

    made.model.search = 1U;
    start();
    step(y, 7U); /* residuals 28/3, 4/3, -32/3: sensor 2 explains most */
    TEST_ASSERT_EQUAL_HEX64(4U, out.excluded);
    TEST_ASSERT_TRUE(out.iterations <= made.model.max_updates);
}

static void test_step_given_search_at_every_exclusion_keeps_a_choice_that_explains_all(void)
{
    blw_real_t first = BLW_R(0.0);

    step(gross, 7U);
    first             = out.x_hat[0];
    made.model.search = 2U;
    start();
    step(gross, 7U);
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
    TEST_ASSERT_REAL_WITHIN(4.0 * SUPPORT_TOL, first, out.x_hat[0]);
    TEST_ASSERT_TRUE(out.iterations <= made.model.max_updates);
}

static void test_step_during_warm_up_excludes_nobody(void)
{
    made.model.warm_up = 2U;
    start();
    for (size_t k = 1U; k <= 3U; k++) {
        step(gross, 7U);
        TEST_ASSERT_EQUAL_HEX64((k <= 2U) ? 0U : 1U, out.excluded);
        TEST_ASSERT_EQUAL_HEX8((k <= 2U) ? BLW_FLAG_WARMING_UP : 0U, out.flags);
    }
}

static void test_step_given_a_slow_bias_raises_suspicion_only(void)
{
    const blw_real_t y[3] = {BLW_R(5.9), BLW_R(5.0), BLW_R(6.0)}; /* a bias below the threshold */

    step(y, 7U);
    TEST_ASSERT_TRUE(out.suspicion[0] < BLW_R(0.5));
    for (size_t k = 0U; k < 200U; k++) {
        const blw_real_t held[3] = {out.x_hat[0] + BLW_R(2.9), out.x_hat[0] + BLW_R(2.0),
                                    out.x_hat[0] + BLW_R(3.0)};
        step(held, 7U);
    }
    TEST_ASSERT_EQUAL_HEX64(0U, out.excluded);
    TEST_ASSERT_TRUE(out.suspicion[0] > BLW_R(0.35));
}

/* Straight-line code for the model as it is, S with -1/2 beside 1. */
static unsigned kernel_calls;
static bool     kernel_serves;

static bool advance_kernel(const blw_real_t *input, const blw_real_t *y, const blw_real_t *x_ref,
                           const blw_real_t *eta, blw_real_t *x_bar, blw_real_t *e)
{
    if (!kernel_serves) {
        return false;
    }
    const blw_plant_t *const plant = &made.kalman.plant;
    x_bar[0]                       = (plant->A[0] * x_ref[0]) + (plant->Bu[0] * input[0]);
    for (size_t i = 0U; i < 3U; i++) {
        e[i] = (guard_Lam[i] * eta[i])
               + (guard_b[i] * ((y[i] - plant->offset[i]) - (plant->C[i] * x_bar[0])));
    }
    kernel_calls++;
    return true;
}

static void multiply_kernel(const blw_real_t *S, const blw_real_t *tau, blw_real_t *l)
{
    for (size_t i = 0U; i < 3U; i++) {
        l[i] = tau[i] + (S[0] * (tau[(i + 1U) % 3U] + tau[(i + 2U) % 3U]));
    }
    kernel_calls++;
}

static void squares_kernel(const blw_real_t *l, blw_real_t *squares)
{
    for (size_t i = 0U; i < 3U; i++) {
        squares[i] = l[i] * l[i];
    }
    kernel_calls++;
}

static void average_kernel(const blw_real_t *l, blw_real_t *average, blw_real_t *squares)
{
    for (size_t i = 0U; i < 3U; i++) {
        average[i] += BLW_R(0.125) * (l[i] - average[i]);
    }
    squares_kernel(average, squares);
}

static void fuse_kernel(const blw_real_t *tau, const blw_real_t *e, const blw_real_t *x_bar,
                        blw_real_t *x_ref, blw_real_t *eta)
{
    const blw_real_t d = (guard_Fu[0] * (tau[0] + tau[1])) + (guard_Fu[2] * tau[2]);

    x_ref[0] = x_bar[0] + d;
    for (size_t i = 0U; i < 3U; i++) {
        eta[i] = e[i] - (guard_Gu[i] * d);
    }
    kernel_calls++;
}

static void move_kernel(const blw_real_t *S, size_t i, const blw_real_t *change, blw_real_t *l)
{
    for (size_t j = 0U; j < 3U; j++) {
        l[j] += (j == i) ? BLW_R(0.0) : (S[0] * change[0]);
    }
    kernel_calls++;
}

static void test_step_given_kernels_uses_them_for_the_same_result(void)
{
    const blw_real_t *const samples[3] = {benign, gross, mild};
    blw_real_t              expected[9];

    for (size_t k = 0U; k < 9U; k++) {
        step(samples[k % 3U], 7U);
        expected[k] = out.x_hat[0];
    }
    made.model.advance  = advance_kernel;
    made.model.multiply = multiply_kernel;
    made.model.squares  = squares_kernel;
    made.model.average  = average_kernel;
    made.model.fuse     = fuse_kernel;
    made.model.move     = move_kernel;
    for (size_t pass = 0U; pass < 2U; pass++) { /* the loops serve where the kernel refuses */
        kernel_serves = pass == 0U;
        kernel_calls  = 0U;
        start();
        for (size_t k = 0U; k < 9U; k++) {
            step(samples[k % 3U], 7U);
            TEST_ASSERT_REAL_WITHIN(16.0 * SUPPORT_TOL, expected[k], out.x_hat[0]);
        }
        TEST_ASSERT_TRUE(kernel_calls >= ((pass == 0U) ? 45U : 36U));
    }
    kernel_serves = true;
    kernel_calls  = 0U;
    step(benign, 6U); /* a missing sample */
    TEST_ASSERT_EQUAL_HEX64(6U, out.used);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_guard_step(&guard, NULL, benign, 7U, &out)); /* u = 0 */
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_guard_step(&guard, u, NULL, 7U, &out));
}

static void test_step_given_modes_that_decay_estimates_them_from_the_multipliers(void)
{
    static const blw_real_t Xs[1]  = {BLW_R(1.0)};
    static const blw_real_t Sig[3] = {BLW_R(0.1), BLW_R(0.2), BLW_R(0.3)};

    made.model.n_u = 0U;
    made.model.Fu  = NULL;
    made.model.Gu  = NULL;
    made.model.Xs  = Xs;
    made.model.Sig = Sig;
    start();
    step(benign, 7U); /* l = 0.75 s, 0, -0.75 s */
    const double xs = -0.15 * GUARD_S;
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0 + xs, out.x_hat[0]);
    const double e_0 = (double)guard.eta[0];
    const double A   = (double)made.kalman.plant.A[0];
    const double C   = (double)made.kalman.plant.C[0];
    step(benign, 6U); /* sensor 0 coasts on C A x_hat, xs above the reference's */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, (0.25 * e_0) + (GUARD_S * C * A * xs), guard.e[0]);
    made.model.max_updates = 1U;
    made.model.sigma       = BLW_R(1.0);
    start();
    const blw_real_t y[3] = {BLW_R(40.0), BLW_R(-40.0), BLW_R(6.0)};
    step(y, 7U);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_BOUND, out.outcome);
    TEST_ASSERT_TRUE((out.bound > BLW_R(0.0)) && (out.bound < BLW_REAL_MAX));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_step_given_benign_samples_reports_hand_computed_figures);
    RUN_TEST(test_step_given_benign_samples_stays_the_kalman_filter);
    RUN_TEST(test_step_given_a_gross_attack_excludes_the_sensor);
    RUN_TEST(test_step_given_a_mild_attack_clips_it);
    RUN_TEST(test_step_given_attacks_of_any_size_bounds_their_effect);
    RUN_TEST(test_step_given_two_attacked_sensors_solves_them_jointly);
    RUN_TEST(test_step_given_one_update_reports_bound_and_stays_bounded);
    RUN_TEST(test_step_given_no_kappa_reports_the_largest_number);
    RUN_TEST(test_step_given_units_excludes_all_sensors_of_one);
    RUN_TEST(test_step_given_search_takes_the_set_that_explains_most);
    RUN_TEST(test_step_given_search_at_every_exclusion_keeps_a_choice_that_explains_all);
    RUN_TEST(test_step_during_warm_up_excludes_nobody);
    RUN_TEST(test_step_given_a_slow_bias_raises_suspicion_only);
    RUN_TEST(test_step_given_kernels_uses_them_for_the_same_result);
    RUN_TEST(test_step_given_modes_that_decay_estimates_them_from_the_multipliers);
    return UNITY_END();
}
