/* SPDX-License-Identifier: MIT */
/* The fault branches of the tableau engine, on Huber's estimate of a location (see test_blw_l1.c):
 * rows that depend on each other, a bound in the middle of an entry, tables that mislead the
 * sweeps. */
#include "support.h"

#include "blw/blw_l1.h"
#include "blw_l1_internal.h"

/* I - 1 1'/3 and I, packed lower; zeta = G x; F W F'. */
static const blw_real_t S_exact[6] = {
    BLW_R(0.66666666666666663),  BLW_R(-0.33333333333333331), BLW_R(0.66666666666666663),
    BLW_R(-0.33333333333333331), BLW_R(-0.33333333333333331), BLW_R(0.66666666666666663),
};
static const blw_real_t W[6]    = {BLW_R(1.0), BLW_R(0.0), BLW_R(1.0),
                                   BLW_R(0.0), BLW_R(0.0), BLW_R(1.0)};
static const blw_real_t G[3]    = {BLW_R(2.0), BLW_R(2.0), BLW_R(2.0)};
static const blw_real_t P[1]    = {BLW_R(0.083333333333333329)};
static const blw_real_t wide[3] = {BLW_R(1.0), BLW_R(1.0), BLW_R(3.0)};

/* Row 2 enters first, then row 0; then row 1, with T_11 = 0, drives row 2 out again and enters:
 * four sweeps.  clip(-5, 1) + clip(-5, 1) + clip(2, 3) = 0 at mu = 5. */
static const blw_real_t dependent[3] = {BLW_R(0.0), BLW_R(0.0), BLW_R(7.0)};

static support_lasso_t made;
static blw_l1_t        l1;
static blw_real_t      mem[BLW_L1_MEM(3, 2, 3)];
static blw_real_t      x[1];
static blw_real_t      S[6];
static blw_l1_info_t   info;

/* The model with S times a factor, which is 1 in a sound one. */
static void use_tableau(blw_real_t factor)
{
    for (size_t i = 0U; i < 6U; i++) {
        S[i] = factor * S_exact[i];
    }
    support_lasso_make(&made, BLW_METHOD_LASSO);
    made.l1.engine = &blw_l1_tableau_ops;
    made.l1.Z      = NULL;
    made.l1.S      = S;
    made.l1.W      = W;
    made.l1.G      = G;
    made.l1.P      = P;
    blw_l1_init(&l1, &made.l1, mem);
}

void setUp(void)
{
    use_tableau(BLW_R(1.0));
}

void tearDown(void) {}

static void test_solve_given_a_dependent_row_lets_another_leave_first(void)
{
    made.l1.c = wide;
    blw_l1_solve(&l1, dependent, x, &info);
    TEST_ASSERT_TRUE(info.converged);
    TEST_ASSERT_EQUAL_UINT16(4U, info.iterations);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.5, x[0]);
    TEST_ASSERT_REAL_WITHIN(0.0, dependent[2], l1.tau[2]); /* nu_2 = 0 again */
}

/* After a sweep per row every entry stops where another nu vanishes: here as many sweeps. */
static void test_solve_given_much_work_done_enters_with_care(void)
{
    made.l1.c              = wide;
    made.l1.max_iterations = 12U;
    info                   = (blw_l1_info_t){.iterations = 3U};
    made.l1.engine->multiply(&l1, dependent);
    made.l1.engine->solve(&l1, dependent, x, &info);
    TEST_ASSERT_TRUE(info.converged);
    TEST_ASSERT_EQUAL_UINT16(3U + 4U, info.iterations);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.5, x[0]);
}

static void test_solve_given_the_bound_within_an_entry_reports_it(void)
{
    made.l1.c = wide;
    for (uint16_t most = 1U; most <= 3U; most++) {
        made.l1.max_iterations = most;
        blw_l1_solve(&l1, dependent, x, &info);
        TEST_ASSERT_FALSE(info.converged);
        TEST_ASSERT_EQUAL_UINT16(most, info.iterations);
        TEST_ASSERT_TRUE(blw_la_abs(x[0] - BLW_R(2.5)) <= info.bound);
    }
}

/* Sweeps on 0.4 S leave corrections that shrink by 0.6 only: the factors of W have to decide. */
static void test_solve_given_a_coarse_tableau_falls_back_to_the_factors_of_W(void)
{
    const blw_real_t zeta[3] = {BLW_R(4.0), BLW_R(5.0), BLW_R(90.0)};

    use_tableau(BLW_R(0.4));
    blw_l1_solve(&l1, zeta, x, &info);
    TEST_ASSERT_TRUE(info.converged);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.5, x[0]); /* mu = 5 */
}

/* |l_2| = 0.9 looks like 1.8 by 2 S: row 2 enters, is found turned round and leaves. */
static void test_solve_given_a_row_that_should_not_be_in_drops_it(void)
{
    const blw_real_t zeta[3] = {BLW_R(4.55), BLW_R(4.55), BLW_R(5.9)}; /* mean 5 */

    use_tableau(BLW_R(2.0));
    blw_l1_solve(&l1, zeta, x, &info);
    TEST_ASSERT_FALSE(info.kalman);
    TEST_ASSERT_TRUE(info.converged);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.5, x[0]);
    TEST_ASSERT_EQUAL_MEMORY(zeta, l1.tau, sizeof zeta); /* nu = 0 */
}

/* By 0.4 S row 0 seems to keep within its limit once row 2 is in; W says l_0 = -1.7, and the
 * tableau is made anew with row 2 in it.  clip(-2.4) + 0 + clip(87.6) = 0 at mu = 2.4. */
static void test_solve_given_a_row_that_was_overlooked_goes_on_from_the_rows_that_are_in(void)
{
    const blw_real_t zeta[3] = {BLW_R(0.0), BLW_R(2.4), BLW_R(90.0)};

    use_tableau(BLW_R(0.4));
    blw_l1_solve(&l1, zeta, x, &info);
    TEST_ASSERT_TRUE(info.converged);
    TEST_ASSERT_EQUAL_UINT16(3U, info.iterations); /* row 2, the new start, row 0 */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 1.2, x[0]);
}

static void test_check_given_each_missing_table_refuses(void)
{
    const blw_real_t **const tables[4] = {&made.l1.S, &made.l1.W, &made.l1.G, &made.l1.P};

    for (size_t k = 0U; k < 4U; k++) {
        blw_table_check_t walk;
        use_tableau(BLW_R(1.0));
        blw_table_begin(&walk);
        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_l1_check(&made.l1, &walk));
        *tables[k] = NULL;
        TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, blw_l1_check(&made.l1, &walk));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_solve_given_a_dependent_row_lets_another_leave_first);
    RUN_TEST(test_solve_given_much_work_done_enters_with_care);
    RUN_TEST(test_solve_given_the_bound_within_an_entry_reports_it);
    RUN_TEST(test_solve_given_a_coarse_tableau_falls_back_to_the_factors_of_W);
    RUN_TEST(test_solve_given_a_row_that_should_not_be_in_drops_it);
    RUN_TEST(test_solve_given_a_row_that_was_overlooked_goes_on_from_the_rows_that_are_in);
    RUN_TEST(test_check_given_each_missing_table_refuses);
    return UNITY_END();
}
