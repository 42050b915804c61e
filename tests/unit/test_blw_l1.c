/* SPDX-License-Identifier: MIT */
/* The fusion on the model of support.h: with c = 1 it is Huber's estimate of a location, whose
 * solutions are easy by hand.  Accuracy on hard problems is the reference tests' business. */
#include "support.h"

#include "blw/blw_l1.h"
#include "blw/blw_l1_survey.h"
#include "blw_l1_internal.h"

/* (S + rho I)^-1 for S = I - 1 1'/3, rho = 1/2: 2/3 I + 4/9 1 1', packed lower. */
static const blw_real_t M_half[6] = {
    BLW_R(1.1111111111111112), BLW_R(0.4444444444444444), BLW_R(1.1111111111111112),
    BLW_R(0.4444444444444444), BLW_R(0.4444444444444444), BLW_R(1.1111111111111112),
};

static support_lasso_t made;
static blw_l1_t        l1;
static blw_real_t      mem[BLW_L1_MEM(3, 2, 3)];
static blw_real_t      x[1];
static blw_l1_info_t   info;

void setUp(void)
{
    support_lasso_make(&made, BLW_METHOD_LASSO);
    blw_l1_init(&l1, &made.l1, mem);
}

void tearDown(void) {}

static void use_admm(void)
{
    made.l1.engine         = &blw_l1_admm_ops;
    made.l1.M              = M_half;
    made.l1.rho            = BLW_R(0.5);
    made.l1.max_iterations = 500U;
    blw_l1_init(&l1, &made.l1, mem);
}

static void test_solve_given_agreeing_rows_returns_the_linear_fusion(void)
{
    const blw_real_t zeta[3] = {BLW_R(4.25), BLW_R(5.0), BLW_R(5.75)}; /* mean 5, |l| <= 3/4 */

    blw_l1_solve(&l1, zeta, x, &info);
    TEST_ASSERT_TRUE(info.kalman);
    TEST_ASSERT_TRUE(info.converged);
    TEST_ASSERT_EQUAL_UINT16(0U, info.iterations);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.75, info.statistic);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.5, x[0]);
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, info.bound);
    blw_real_t fused[1];
    blw_la_gemv(1U, 3U, made.l1.F, zeta, fused);
    TEST_ASSERT_EQUAL_MEMORY(fused, x, sizeof x); /* bit for bit the weighted sum */
}

/* Huber: clip(4 - mu) + clip(5 - mu) + clip(90 - mu) = 0 at mu = 5, x = mu / 2. */
static void check_one_outlier(void)
{
    const blw_real_t zeta[3] = {BLW_R(4.0), BLW_R(5.0), BLW_R(90.0)};

    blw_l1_solve(&l1, zeta, x, &info);
    TEST_ASSERT_FALSE(info.kalman);
    TEST_ASSERT_TRUE(info.converged);
    TEST_ASSERT_GREATER_THAN_UINT16(0U, info.iterations);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.5, x[0]);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 57.0, info.statistic); /* 90 - 33 */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, info.bound);
}

static void test_solve_given_one_outlier_clips_it(void)
{
    check_one_outlier();
}

static void test_solve_by_admm_given_one_outlier_clips_it(void)
{
    use_admm();
    check_one_outlier();
    TEST_ASSERT_LESS_OR_EQUAL_UINT16(500U, info.iterations);
}

static void test_solve_given_a_huge_outlier_loses_no_accuracy(void)
{
    const blw_real_t zeta[3] = {BLW_R(4.0), BLW_R(5.0), BLW_R(9e9)};

    blw_l1_solve(&l1, zeta, x, &info);
    TEST_ASSERT_TRUE(info.converged);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.5, x[0]);
}

static void test_solve_given_the_next_sample_starts_from_the_support(void)
{
    const blw_real_t next[3]   = {BLW_R(4.5), BLW_R(5.0), BLW_R(95.0)};
    const blw_real_t turned[3] = {BLW_R(4.0), BLW_R(5.0), BLW_R(-80.0)};

    check_one_outlier();
    blw_l1_solve(&l1, next, x, &info);
    TEST_ASSERT_TRUE(info.converged);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.625, x[0]); /* clips sum to 0 at mu = 5.25 */
    blw_l1_solve(&l1, turned, x, &info);
    TEST_ASSERT_TRUE(info.converged);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.0, x[0]); /* mu = 4 */
}

static void test_solve_given_too_few_iterations_says_so_with_a_bound(void)
{
    const blw_real_t zeta[3] = {BLW_R(4.0), BLW_R(5.0), BLW_R(90.0)};

    made.l1.max_iterations = 1U;
    blw_l1_solve(&l1, zeta, x, &info);
    TEST_ASSERT_FALSE(info.converged);
    TEST_ASSERT_EQUAL_UINT16(1U, info.iterations);
    TEST_ASSERT_TRUE(info.gap >= BLW_R(0.0));
    TEST_ASSERT_TRUE(info.bound < BLW_R(1e4));
    TEST_ASSERT_TRUE((x[0] - BLW_R(2.5)) <= info.bound);
}

static void test_solve_given_nan_certifies_nothing(void)
{
    const blw_real_t zeta[3] = {BLW_R(4.0), support_nan, BLW_R(6.0)};

    blw_l1_solve(&l1, zeta, x, &info);
    TEST_ASSERT_FALSE(info.kalman);
    TEST_ASSERT_FALSE(info.converged);
    TEST_ASSERT_REAL_WITHIN(0.0, BLW_REAL_MAX, info.bound);
}

static void test_larger_given_a_smaller_ratio_keeps_the_other(void)
{
    TEST_ASSERT_REAL_WITHIN(0.0, 2.0, blw_l1_larger(BLW_R(2.0), BLW_R(6.0), BLW_R(3.0)));
    TEST_ASSERT_REAL_WITHIN(0.0, 2.5, blw_l1_larger(BLW_R(2.0), BLW_R(7.5), BLW_R(3.0)));
}

static void test_larger_given_what_is_not_finite_keeps_it(void)
{
    const blw_real_t bad[2] = {support_nan, support_inf};

    for (size_t k = 0U; k < 2U; k++) {
        const blw_real_t most = blw_l1_larger(BLW_R(2.0), bad[k], BLW_R(3.0));
        TEST_ASSERT_FALSE(most <= BLW_REAL_MAX);
        TEST_ASSERT_FALSE(blw_l1_larger(most, BLW_R(7.5), BLW_R(3.0)) <= BLW_REAL_MAX);
        TEST_ASSERT_FALSE(blw_l1_larger(most, bad[1U - k], BLW_R(3.0)) <= BLW_REAL_MAX);
    }
}

static void test_excess_given_an_outlier_names_its_row(void)
{
    const blw_real_t zeta[3] = {BLW_R(4.0), BLW_R(5.0), BLW_R(90.0)};

    blw_l1_solve(&l1, zeta, x, &info);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 1.0, blw_l1_excess(&l1, zeta, 0U, 1U)); /* 5 - 4 */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, blw_l1_excess(&l1, zeta, 1U, 1U));
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL * 85.0, 85.0,
                            blw_l1_excess(&l1, zeta, 2U, 1U)); /* 90 - 5 */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL * 85.0, 85.0, blw_l1_excess(&l1, zeta, 0U, 3U));
}

static blw_status_t check(void)
{
    blw_table_check_t walk;

    blw_table_begin(&walk);
    return blw_l1_check(&made.l1, &walk);
}

static void test_check_given_a_sound_model_accepts_both_engines(void)
{
    TEST_ASSERT_EQUAL_INT(BLW_OK, check());
    use_admm();
    TEST_ASSERT_EQUAL_INT(BLW_OK, check());
}

#define ASSERT_REFUSED(fault) \
    do { \
        support_lasso_make(&made, BLW_METHOD_LASSO); \
        fault; \
        TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, check()); \
    } while (0)

static void test_check_given_each_fault_refuses(void)
{
    static const uint16_t   late[4]   = {1U, 1U, 2U, 3U};
    static const uint16_t   empty[4]  = {0U, 1U, 1U, 3U};
    static const uint16_t   three[2]  = {0U, 3U};
    static const uint16_t   beyond[4] = {0U, 1U, 2U, 4U};
    static const blw_real_t zero_c[3] = {BLW_R(1.0), BLW_R(0.0), BLW_R(1.0)};

    ASSERT_REFUSED(made.l1.d = 0U);
    ASSERT_REFUSED(made.l1.N = 4U);
    ASSERT_REFUSED(made.l1.n_groups = 0U);
    ASSERT_REFUSED(made.l1.max_iterations = 0U);
    ASSERT_REFUSED(made.l1.first = NULL);
    ASSERT_REFUSED(made.l1.first = late);
    ASSERT_REFUSED(made.l1.first = empty);
    ASSERT_REFUSED(made.l1.first = three; made.l1.n_groups = 1U);
    ASSERT_REFUSED(made.l1.first = beyond);
    ASSERT_REFUSED(made.l1.c = zero_c);
    ASSERT_REFUSED(made.l1.Z = NULL);
    ASSERT_REFUSED(made.l1.F = NULL);
    ASSERT_REFUSED(made.l1.kappa_G = BLW_R(0.0));
    ASSERT_REFUSED(made.l1.kappa_W = -BLW_R(1.0));
    ASSERT_REFUSED(made.l1.kappa_W = support_inf);
    ASSERT_REFUSED(made.l1.engine = NULL);
    ASSERT_REFUSED(made.l1.engine = &blw_l1_tableau_ops);
    ASSERT_REFUSED(use_admm(); made.l1.Z = NULL);
    ASSERT_REFUSED(use_admm(); made.l1.M = NULL);
    ASSERT_REFUSED(use_admm(); made.l1.rho = BLW_R(0.0));
}

static void test_check_given_no_model_refuses(void)
{
    blw_table_check_t walk;

    blw_table_begin(&walk);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, blw_l1_check(NULL, &walk));
}

/* Engines that give up with what rounding might leave: x far off at no less a cost, and NaN. */
static blw_real_t left_behind;

static void give_up(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x_hat, blw_l1_info_t *told)
{
    blw_la_copy(self->model->N, zeta, self->tau);
    self->tau[2]     = left_behind;
    x_hat[0]         = left_behind;
    told->iterations = 7U;
}

static void give_up_with(const blw_real_t *zeta, blw_real_t tau)
{
    const blw_l1_ops_t engine = {.fits     = blw_l1_active_set_ops.fits,
                                 .multiply = blw_l1_active_set_ops.multiply,
                                 .solve    = give_up};

    left_behind    = tau;
    made.l1.engine = &engine;
    blw_l1_solve(&l1, zeta, x, &info);
    made.l1.engine = &blw_l1_active_set_ops;
    TEST_ASSERT_FALSE(info.converged);
    TEST_ASSERT_EQUAL_UINT16(7U, info.iterations);
    TEST_ASSERT_TRUE(info.bound >= BLW_R(0.0));
}

static const blw_real_t outlier[3] = {BLW_R(4.0), BLW_R(5.0), BLW_R(90.0)};

static void test_solve_given_an_engine_led_astray_returns_the_linear_fusion(void)
{
    const blw_real_t astray[3] = {BLW_R(1e6), BLW_R(-1e6), support_nan};
    const blw_real_t far[3]    = {BLW_R(42.0), BLW_R(43.0), BLW_R(47.0)};

    for (size_t i = 0U; i < 3U; i++) {
        give_up_with(far, astray[i]); /* 1/2 |z|^2 = 7 is less than 132 for nu = zeta */
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 22.0, x[0]); /* mean 44 */
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 47.0, l1.tau[2]);
    }
}

static void test_solve_given_an_engine_led_astray_by_an_outlier_keeps_the_reference(void)
{
    const blw_real_t astray[3] = {BLW_R(1e6), BLW_R(-1e6), support_nan};

    for (size_t i = 0U; i < 3U; i++) {
        give_up_with(outlier, astray[i]); /* 99 for nu = zeta is less than 1/2 |z|^2 = 2437 */
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, x[0]);
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, l1.tau[2]);
    }
}

static void test_solve_given_an_engine_cut_short_keeps_what_is_better(void)
{
    give_up_with(outlier, BLW_R(6.0)); /* 84 + 1 is less than either */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.5, x[0]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_solve_given_agreeing_rows_returns_the_linear_fusion);
    RUN_TEST(test_solve_given_one_outlier_clips_it);
    RUN_TEST(test_solve_by_admm_given_one_outlier_clips_it);
    RUN_TEST(test_solve_given_a_huge_outlier_loses_no_accuracy);
    RUN_TEST(test_solve_given_the_next_sample_starts_from_the_support);
    RUN_TEST(test_solve_given_too_few_iterations_says_so_with_a_bound);
    RUN_TEST(test_solve_given_nan_certifies_nothing);
    RUN_TEST(test_larger_given_a_smaller_ratio_keeps_the_other);
    RUN_TEST(test_larger_given_what_is_not_finite_keeps_it);
    RUN_TEST(test_excess_given_an_outlier_names_its_row);
    RUN_TEST(test_check_given_a_sound_model_accepts_both_engines);
    RUN_TEST(test_check_given_each_fault_refuses);
    RUN_TEST(test_check_given_no_model_refuses);
    RUN_TEST(test_solve_given_an_engine_led_astray_returns_the_linear_fusion);
    RUN_TEST(test_solve_given_an_engine_led_astray_by_an_outlier_keeps_the_reference);
    RUN_TEST(test_solve_given_an_engine_cut_short_keeps_what_is_better);
    return UNITY_END();
}
