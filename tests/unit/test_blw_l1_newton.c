/* SPDX-License-Identifier: MIT */
/* The engine for groups of two rows on three sensors that see a pair and a real state alike:
 * W = I, G = (I I I)', S = I - G G' / 3, c = 1.  That is Huber's estimate of a location, in the
 * plane for the pair and on a line for the rest: sum_i clip(zeta_i - x) = 0, clip(v) =
 * v / max(1, |v|). */
#include "support.h"

#include "blw/blw_l1.h"
#include "blw_la.h"

/* What the last Newton step may leave: the square of a small one. */
#define LAST_STEP (256.0 * (double)BLW_REAL_EPS + (((double)BLW_REAL_EPS < 1e-10) ? 1e-9 : 0.0))

enum { N = 9, STATES = 3, GROUPS = 6, PACKED = 45, SENSORS = 3 };

static const uint16_t   first[GROUPS + 1] = {0U, 2U, 3U, 5U, 6U, 8U, 9U};
static const blw_real_t ones[GROUPS]      = {BLW_R(1.0), BLW_R(1.0), BLW_R(1.0),
                                             BLW_R(1.0), BLW_R(1.0), BLW_R(1.0)};
/* The plane: 0 twice and an outlier along (3, 4); the line: 4, 5 and an outlier.  x is half a unit
 * vector towards the first outlier, and 5. */
static const blw_real_t attacked[N] = {BLW_R(0.0), BLW_R(0.0),  BLW_R(4.0),  BLW_R(0.0), BLW_R(0.0),
                                       BLW_R(5.0), BLW_R(60.0), BLW_R(80.0), BLW_R(90.0)};
static const double     expected[STATES] = {0.3, 0.4, 5.0};

static blw_real_t     S[PACKED], M[PACKED], W[PACKED], G[N * STATES], F[STATES * N], P[6];
static blw_l1_model_t model;
static blw_l1_t       l1;
static blw_real_t     mem[BLW_L1_MEM(N, N - STATES, GROUPS)];
static blw_real_t     x[STATES];
static blw_l1_info_t  info;

void setUp(void)
{
    for (size_t i = 0U; i < (size_t)N; i++) {
        for (size_t j = 0U; j <= i; j++) {
            const size_t at     = blw_la_packed_row(i) + j;
            const double shared = ((i % STATES) == (j % STATES)) ? (1.0 / 3.0) : 0.0;
            W[at]               = (i == j) ? BLW_R(1.0) : BLW_R(0.0);
            S[at]               = (blw_real_t)((double)W[at] - shared);
            M[at]               = S[at] / BLW_R(1.2); /* W + D = 1.2 I */
        }
        for (size_t k = 0U; k < (size_t)STATES; k++) {
            G[(i * STATES) + k] = ((i % STATES) == k) ? BLW_R(1.0) : BLW_R(0.0);
            F[(k * N) + i]      = G[(i * STATES) + k] / BLW_R(3.0);
        }
    }
    for (size_t k = 0U; k < 6U; k++) {
        P[k] = ((k == 0U) || (k == 2U) || (k == 5U)) ? BLW_R(0.33333333) : BLW_R(0.0);
    }
    model = (blw_l1_model_t){.N              = N,
                             .d              = N - STATES,
                             .n_groups       = GROUPS,
                             .max_iterations = 64U,
                             .n              = STATES,
                             .engine         = &blw_l1_newton_ops,
                             .first          = first,
                             .F              = F,
                             .c              = ones,
                             .M              = M,
                             .S              = S,
                             .W              = W,
                             .G              = G,
                             .P              = P,
                             .rho            = BLW_R(0.2),
                             .kappa_G        = BLW_R(0.33333333),
                             .kappa_W        = BLW_R(2.5)};
    blw_l1_init(&l1, &model, mem);
}

void tearDown(void) {}

static double error(void)
{
    double sum = 0.0;

    for (size_t k = 0U; k < (size_t)STATES; k++) {
        sum += ((double)x[k] - expected[k]) * ((double)x[k] - expected[k]);
    }
    return sum;
}

static void check_attacked(const blw_real_t *zeta)
{
    blw_l1_solve(&l1, zeta, x, &info);
    TEST_ASSERT_FALSE(info.kalman);
    TEST_ASSERT_TRUE(info.converged);
    for (size_t k = 0U; k < (size_t)STATES; k++) {
        TEST_ASSERT_REAL_WITHIN(LAST_STEP, expected[k], x[k]);
    }
    TEST_ASSERT_REAL_WITHIN(1e-4, 0.0, info.bound);
}

static void test_solve_given_agreeing_rows_returns_the_linear_fusion(void)
{
    const blw_real_t zeta[N] = {BLW_R(0.5), BLW_R(0.0), BLW_R(4.5), BLW_R(0.0), BLW_R(0.5),
                                BLW_R(5.0), BLW_R(1.0), BLW_R(1.0), BLW_R(5.5)};

    blw_l1_solve(&l1, zeta, x, &info);
    TEST_ASSERT_TRUE(info.kalman);
    TEST_ASSERT_EQUAL_UINT16(0U, info.iterations);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.5, x[0]);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.5, x[1]);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 5.0, x[2]);
}

static void test_solve_given_outliers_clips_pair_and_row(void)
{
    check_attacked(attacked);
    TEST_ASSERT_LESS_OR_EQUAL_UINT16(16U, info.iterations);
}

static void test_solve_given_a_gross_outlier_loses_no_accuracy(void)
{
    blw_real_t zeta[N];

    blw_la_copy(N, attacked, zeta);
    zeta[6] = BLW_R(6e3);
    zeta[7] = BLW_R(8e3);
    zeta[8] = BLW_R(9e3);
    check_attacked(zeta);
}

/* Whatever their size, outliers pull x by no more than their bound. */
static void test_solve_given_outliers_that_grow_and_vanish_finds_each_minimum(void)
{
    const blw_real_t sizes[] = {BLW_R(1.0), BLW_R(50.0),  BLW_R(2e3),
                                BLW_R(1.0), BLW_R(300.0), BLW_R(10.0)};

    for (size_t k = 0U; k < (sizeof sizes / sizeof sizes[0]); k++) {
        blw_real_t zeta[N];
        blw_la_copy(N, attacked, zeta);
        zeta[6] *= sizes[k];
        zeta[7] *= sizes[k];
        zeta[8] *= sizes[k];
        check_attacked(zeta);
        TEST_ASSERT_LESS_OR_EQUAL_UINT16(16U, info.iterations);
    }
}

static void test_solve_given_the_same_data_after_a_reset_gives_the_same_bits(void)
{
    blw_real_t before[STATES];

    check_attacked(attacked);
    blw_la_copy(STATES, x, before);
    for (size_t i = 0U; i < (size_t)N; i++) {
        blw_real_t other[N];
        blw_la_copy(N, attacked, other);
        other[i] += BLW_R(30.0);
        blw_l1_solve(&l1, other, x, &info);
        TEST_ASSERT_TRUE(info.converged);
        check_attacked(attacked);
    }
    blw_l1_reset(&l1);
    check_attacked(attacked);
    TEST_ASSERT_EQUAL_MEMORY(before, x, sizeof x);
}

static void test_solve_given_an_attack_that_lasts_takes_fewer_steps(void)
{
    blw_real_t zeta[N];

    blw_la_copy(N, attacked, zeta);
    zeta[8] = BLW_R(9e5);
    check_attacked(zeta);
    const uint16_t cold = info.iterations;
    zeta[8] += BLW_R(0.5);
    check_attacked(zeta);
    TEST_ASSERT_LESS_THAN_UINT16(cold, info.iterations);
}

static void test_solve_given_an_attack_that_has_ended_starts_afresh(void)
{
    const blw_real_t zeta[N] = {BLW_R(0.0), BLW_R(0.0), BLW_R(4.0),  BLW_R(0.0), BLW_R(0.0),
                                BLW_R(5.0), BLW_R(0.0), BLW_R(30.0), BLW_R(4.5)};
    blw_real_t       fresh[STATES];

    blw_l1_solve(&l1, zeta, fresh, &info);
    TEST_ASSERT_TRUE(info.converged);
    blw_l1_reset(&l1);
    check_attacked(attacked);
    blw_l1_solve(&l1, zeta, x, &info);
    TEST_ASSERT_TRUE(info.converged);
    TEST_ASSERT_EQUAL_MEMORY(fresh, x, sizeof x);
}

/* Minima with nu_g = 0 and |l_g| = c_g at once, far from 0: rounding must not keep them open. */
static void test_solve_given_groups_on_the_verge_certifies(void)
{
    static const blw_real_t verge[][N] = {
        {BLW_R(-26.1682186), BLW_R(202.061554), BLW_R(212.189911), BLW_R(-25.1033382),
         BLW_R(206.954407), BLW_R(207.18251), BLW_R(-25.316), BLW_R(205.977295), BLW_R(208.18251)},
        {BLW_R(-300.717316), BLW_R(305.575104), BLW_R(347.324554), BLW_R(-292.629181),
         BLW_R(306.041077), BLW_R(339.223022), BLW_R(-293.627533), BLW_R(305.983582),
         BLW_R(340.223022)},
        {BLW_R(7.96984482), BLW_R(326.595398), BLW_R(92.2977753), BLW_R(8.41116428),
         BLW_R(324.920502), BLW_R(90.2977753), BLW_R(9.64099693), BLW_R(326.140167),
         BLW_R(91.2977753)},
    };

    for (size_t k = 0U; k < (sizeof verge / sizeof verge[0]); k++) {
        blw_l1_solve(&l1, verge[k], x, &info);
        TEST_ASSERT_TRUE(info.converged);
        TEST_ASSERT_FALSE(info.kalman);
        TEST_ASSERT_LESS_OR_EQUAL_UINT16(16U, info.iterations);
    }
}

static void test_solve_given_too_few_steps_says_so_with_a_bound(void)
{
    for (uint16_t steps = 1U; steps <= 3U; steps++) {
        model.max_iterations = steps;
        blw_l1_solve(&l1, attacked, x, &info);
        TEST_ASSERT_FALSE(info.converged);
        TEST_ASSERT_LESS_OR_EQUAL_UINT16(steps, info.iterations);
        TEST_ASSERT_TRUE(info.bound < BLW_REAL_MAX);
        TEST_ASSERT_TRUE(error() <= ((double)info.bound * (double)info.bound));
    }
}

/* Two of the real rows have the same noise: W has no inverse, what it says of them is rounding. */
static void test_solve_given_a_singular_W_does_not_certify(void)
{
    const blw_real_t zeta[N] = {BLW_R(0.0), BLW_R(0.0),  BLW_R(4.0),  BLW_R(0.0), BLW_R(0.0),
                                BLW_R(4.0), BLW_R(60.0), BLW_R(80.0), BLW_R(4.0)};

    W[blw_la_packed_row(5U) + 2U] = BLW_R(1.0);
    blw_l1_solve(&l1, zeta, x, &info);
    TEST_ASSERT_FALSE(info.converged);
    TEST_ASSERT_TRUE(blw_la_finite(STATES, x));
    TEST_ASSERT_LESS_OR_EQUAL_UINT16(64U, info.iterations);
}

static void test_solve_given_a_table_that_is_not_a_number_does_not_certify(void)
{
    W[0] = support_nan;
    blw_l1_solve(&l1, attacked, x, &info);
    TEST_ASSERT_FALSE(info.converged);
    TEST_ASSERT_TRUE(blw_la_finite(STATES, x));
}

static void test_excess_given_outliers_names_their_sensor(void)
{
    check_attacked(attacked);
    TEST_ASSERT_TRUE(blw_l1_excess(&l1, attacked, 0U, 3U) <= BLW_R(1.001));
    TEST_ASSERT_TRUE(blw_l1_excess(&l1, attacked, 6U, 3U) > BLW_R(80.0));
}

static blw_status_t check(void)
{
    blw_table_check_t walk;

    blw_table_begin(&walk);
    return blw_l1_check(&model, &walk);
}

static void test_check_given_a_missing_table_refuses(void)
{
    const blw_real_t **const tables[] = {&model.M, &model.S, &model.W, &model.G, &model.P};

    TEST_ASSERT_EQUAL_INT(BLW_OK, check());
    for (size_t k = 0U; k < (sizeof tables / sizeof tables[0]); k++) {
        const blw_real_t *const kept = *tables[k];
        *tables[k]                   = NULL;
        TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, check());
        *tables[k] = kept;
    }
    model.rho = BLW_R(0.0);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, check());
    model.rho = BLW_R(0.2);
    model.Z   = S;
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, check());
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_solve_given_agreeing_rows_returns_the_linear_fusion);
    RUN_TEST(test_solve_given_outliers_clips_pair_and_row);
    RUN_TEST(test_solve_given_a_gross_outlier_loses_no_accuracy);
    RUN_TEST(test_solve_given_outliers_that_grow_and_vanish_finds_each_minimum);
    RUN_TEST(test_solve_given_the_same_data_after_a_reset_gives_the_same_bits);
    RUN_TEST(test_solve_given_an_attack_that_lasts_takes_fewer_steps);
    RUN_TEST(test_solve_given_an_attack_that_has_ended_starts_afresh);
    RUN_TEST(test_solve_given_groups_on_the_verge_certifies);
    RUN_TEST(test_solve_given_too_few_steps_says_so_with_a_bound);
    RUN_TEST(test_solve_given_a_singular_W_does_not_certify);
    RUN_TEST(test_solve_given_a_table_that_is_not_a_number_does_not_certify);
    RUN_TEST(test_excess_given_outliers_names_their_sensor);
    RUN_TEST(test_check_given_a_missing_table_refuses);
    return UNITY_END();
}
