/* SPDX-License-Identifier: MIT */
#include <string.h>
#include "support.h"

#define MEM BLW_KALMAN_MEM(1, 3)

static const blw_real_t u[1] = {BLW_R(1.0)};
static const blw_real_t y[3] = {BLW_R(10.0), BLW_R(8.0), BLW_R(6.0)}; /* innovations 6, 3, 0 */

static support_kalman_t    made;
static blw_real_t          mem[MEM];
static blw_kalman_t        filter;
static blw_estimator_out_t out;

void setUp(void)
{
    support_kalman_make(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_init(&filter, &made.model, mem, MEM));
}

void tearDown(void) {}

static void assert_init_refuses(blw_status_t expected, blw_kalman_t *self,
                                const blw_kalman_model_t *model, blw_real_t *memory, size_t len)
{
    const blw_kalman_t before = filter;

    TEST_ASSERT_EQUAL_INT(expected, blw_kalman_init(self, model, memory, len));
    TEST_ASSERT_EQUAL_MEMORY(&before, &filter, sizeof before);
}

static void test_init_given_null_or_little_memory_refuses(void)
{
    assert_init_refuses(BLW_ERR_ARG, NULL, &made.model, mem, MEM);
    assert_init_refuses(BLW_ERR_ARG, &filter, NULL, mem, MEM);
    assert_init_refuses(BLW_ERR_ARG, &filter, &made.model, NULL, MEM);
    assert_init_refuses(BLW_ERR_MEM, &filter, &made.model, mem, MEM - 1U);
}

static void test_init_given_a_bad_model_refuses(void)
{
    made.model.head.abi++;
    assert_init_refuses(BLW_ERR_MODEL, &filter, &made.model, mem, MEM);
    support_kalman_make(&made);
    made.model.K = NULL;
    assert_init_refuses(BLW_ERR_MODEL, &filter, &made.model, mem, MEM);
    support_kalman_make(&made);
    made.model.head.crc ^= 0x80000000U;
    assert_init_refuses(BLW_ERR_MODEL, &filter, &made.model, mem, MEM);
}

static void test_step_given_all_samples_yields_hand_computed_estimate(void)
{
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, u, y, 7U, &out));
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 4.5, out.x_hat[0]); /* 3 + 9/6 */
    TEST_ASSERT_EQUAL_HEX64(7U, out.used);
    TEST_ASSERT_EQUAL_HEX64(0U, out.excluded);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_KALMAN, out.outcome);
    TEST_ASSERT_EQUAL_HEX8(0U, out.flags);
    TEST_ASSERT_EQUAL_UINT(0U, out.iterations);
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, out.statistic + out.threshold + out.bound);
    for (size_t i = 0U; i < 3U; i++) {
        TEST_ASSERT_REAL_WITHIN(0.0, 0.0, out.suspicion[i]);
    }
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, NULL, y, 7U, &out));
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 4.125, out.x_hat[0]); /* 2.25 + 11.25/6 */
}

/* Stands for a generated kernel: a mark that no loop would make, and a limit of its own. */
static bool marking_kernel(const blw_real_t *input, const blw_real_t *samples, blw_real_t *x_hat)
{
    if (!(samples[0] <= BLW_R(100.0))) {
        return false;
    }
    x_hat[0] = (input != NULL) ? BLW_R(77.0) : BLW_R(66.0);
    return true;
}

static void test_step_given_a_kernel_leaves_it_the_usual_step_only(void)
{
    const blw_real_t far[3] = {BLW_R(101.0), BLW_R(8.0), BLW_R(6.0)};

    made.model.step = marking_kernel;
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, u, y, 5U, &out)); /* a gap: by loops */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 4.0, out.x_hat[0]);
    TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.suspicion[1]);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, u, y, 7U, &out));
    TEST_ASSERT_REAL_WITHIN(0.0, 77.0, out.x_hat[0]);
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, out.suspicion[1]);
    TEST_ASSERT_EQUAL_HEX64(7U, out.used);
    TEST_ASSERT_EQUAL_HEX8(0U, out.flags);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, u, far, 7U, &out)); /* refused */
    TEST_ASSERT_REAL_WITHIN(100.0 * SUPPORT_TOL, 39.5 - (9.5 / 6.0), out.x_hat[0]);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, NULL, y, 7U, &out)); /* u may matter */
    TEST_ASSERT_TRUE(out.x_hat[0] < BLW_R(60.0));
    made.plant.l = 0U;
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, NULL, y, 7U, &out));
    TEST_ASSERT_REAL_WITHIN(0.0, 66.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_kalman_step(&filter, NULL, NULL, 7U, &out));
}

static void test_step_given_the_closed_form_takes_it_where_every_sample_is_there(void)
{
    /* not A - K C A = 0.25 and Bu - K C Bu = 0.5, so that it shows what was used */
    const blw_real_t Acl[1] = {BLW_R(10.0)};
    const blw_real_t Bcl[1] = {BLW_R(100.0)};

    made.model.Acl = Acl;
    made.model.Bcl = Bcl;
    support_kalman_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_init(&filter, &made.model, mem, MEM));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, u, y, 6U, &out)); /* a gap: (1), (2) */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.5, out.x_hat[0]);
    TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.suspicion[0]);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, u, y, 7U, &out));
    TEST_ASSERT_REAL_WITHIN(100.0 * SUPPORT_TOL, 138.0, out.x_hat[0]); /* 35 + 100 + 18/6 */
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, out.suspicion[0]);
    TEST_ASSERT_EQUAL_HEX8(0U, out.flags);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, NULL, y, 7U, &out));
    TEST_ASSERT_REAL_WITHIN(1000.0 * SUPPORT_TOL, 1383.0, out.x_hat[0]);
}

/* Samples that overflow the state are left out, all of them. */
static void check_overflow(void)
{
    static const blw_real_t K[3]   = {BLW_SIGNAL_MAX, BLW_R(0.0), BLW_R(0.0)};
    const blw_real_t        far[3] = {BLW_SIGNAL_MAX, y[1], y[2]};

    made.model.K = K;
    support_kalman_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_init(&filter, &made.model, mem, MEM));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, u, far, 7U, &out));
    TEST_ASSERT_REAL_WITHIN(0.0, 3.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX64(0U, out.used);
    TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.suspicion[1]);
}

static void test_step_given_the_closed_form_and_samples_that_overflow_it_predicts(void)
{
    const blw_real_t Acl[1] = {BLW_R(0.25)};

    made.model.Acl = Acl;
    made.model.Bcl = Acl;
    check_overflow();
    made.model.Bcl = NULL;
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, blw_kalman_init(&filter, &made.model, mem, MEM));
}

static void test_step_given_a_gap_or_bad_number_leaves_that_innovation_out(void)
{
    const blw_real_t bad[3] = {support_nan, support_inf, BLW_REAL_MAX};

    for (size_t i = 0U; i < 4U; i++) {
        const blw_real_t gap[3] = {bad[i % 3U], y[1], y[2]};

        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_reset(&filter, NULL));
        TEST_ASSERT_EQUAL_INT(BLW_OK, (i < 3U) ? blw_kalman_step(&filter, u, gap, 7U, &out)
                                               : blw_kalman_step(&filter, u, y, 6U, &out));
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.5, out.x_hat[0]);
        TEST_ASSERT_EQUAL_HEX64(6U, out.used);
        TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING, out.flags);
        TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.suspicion[0]);
        TEST_ASSERT_REAL_WITHIN(0.0, 0.0, out.suspicion[1]);
    }
}

static void test_step_given_no_sample_predicts_and_says_so(void)
{
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, u, y, 0U, &out));
    TEST_ASSERT_REAL_WITHIN(0.0, 3.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING | BLW_FLAG_DEGRADED | BLW_FLAG_BLIND, out.flags);
}

static void test_step_given_wrong_arguments_leaves_state_and_out_untouched(void)
{
    const blw_real_t bad_u[1] = {support_nan};

    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, u, y, 7U, &out));
    const blw_estimator_out_t before = out;
    const blw_real_t          x_hat  = out.x_hat[0];
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_kalman_step(NULL, u, y, 7U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_kalman_step(&filter, u, NULL, 7U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_kalman_step(&filter, u, y, 8U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_kalman_step(&filter, u, y, 7U, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_INPUT, blw_kalman_step(&filter, bad_u, y, 7U, &out));
    TEST_ASSERT_EQUAL_MEMORY(&before, &out, sizeof out);
    TEST_ASSERT_REAL_WITHIN(0.0, x_hat, out.x_hat[0]);
}

static void test_step_given_samples_that_overflow_the_state_predicts(void)
{
    check_overflow();
}

static void test_step_given_an_unstable_plant_recovers_after_any_time_without_samples(void)
{
    const blw_real_t A[1]    = {BLW_R(2.0)};
    const blw_real_t K[3]    = {BLW_R(0.3), BLW_R(0.3), BLW_R(0.3)};
    const blw_real_t zero[3] = {BLW_R(1.0), BLW_R(2.0), BLW_R(3.0)}; /* the offsets: x = 0 */

    made.plant.A = A;
    made.model.K = K;
    support_kalman_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_init(&filter, &made.model, mem, MEM));
    for (size_t k = 0U; k < 2000U; k++) { /* 2^2000 overflows a double */
        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, NULL, zero, 0U, &out));
        TEST_ASSERT_TRUE(out.x_hat[0] <= BLW_SIGNAL_MAX);
    }
    for (size_t k = 0U; k < 300U; k++) { /* 0.2^300 BLW_SIGNAL_MAX is nothing */
        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, NULL, zero, 7U, &out));
    }
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, out.x_hat[0]);
}

static void test_reset_given_a_start_takes_it_and_refuses_what_is_not_finite(void)
{
    const blw_real_t start[1] = {BLW_R(10.0)};
    const blw_real_t bad[1]   = {support_inf};

    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_reset(&filter, start));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_kalman_reset(&filter, bad));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_kalman_reset(NULL, start));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, NULL, y, 0U, &out));
    TEST_ASSERT_REAL_WITHIN(0.0, 5.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_reset(&filter, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, NULL, y, 0U, &out));
    TEST_ASSERT_REAL_WITHIN(0.0, 2.0, out.x_hat[0]);
}

static void test_ops_given_the_same_data_yield_the_same_bits(void)
{
    static blw_real_t                other_mem[MEM];
    static blw_kalman_t              other;
    blw_estimator_t *const           base = &other.base;
    blw_estimator_out_t              other_out;
    const blw_estimator_ops_t *const ops = &blw_kalman_ops;

    TEST_ASSERT_EQUAL_INT(BLW_METHOD_KALMAN, ops->method);
    TEST_ASSERT_EQUAL_size_t(sizeof(blw_kalman_t), ops->state_size);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_init(base, ops, &made.model.head, other_mem, MEM));
    TEST_ASSERT_EQUAL_PTR(ops, base->ops);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_reset(base, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_step(base, u, y, 7U, &other_out));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_kalman_step(&filter, u, y, 7U, &out));
    TEST_ASSERT_EQUAL_MEMORY(out.x_hat, other_out.x_hat, sizeof(blw_real_t));
}

static void test_mem_len_given_another_model_is_zero(void)
{
    TEST_ASSERT_EQUAL_size_t(MEM, blw_kalman_ops.mem_len(&made.model.head));
    TEST_ASSERT_EQUAL_size_t(0U, blw_kalman_ops.mem_len(NULL));
    made.model.head.method = (uint8_t)BLW_METHOD_GUARD;
    TEST_ASSERT_EQUAL_size_t(0U, blw_kalman_ops.mem_len(&made.model.head));
    support_kalman_make(&made);
    made.model.head.plant = NULL;
    TEST_ASSERT_EQUAL_size_t(0U, blw_kalman_ops.mem_len(&made.model.head));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_given_null_or_little_memory_refuses);
    RUN_TEST(test_init_given_a_bad_model_refuses);
    RUN_TEST(test_step_given_all_samples_yields_hand_computed_estimate);
    RUN_TEST(test_step_given_a_kernel_leaves_it_the_usual_step_only);
    RUN_TEST(test_step_given_the_closed_form_takes_it_where_every_sample_is_there);
    RUN_TEST(test_step_given_the_closed_form_and_samples_that_overflow_it_predicts);
    RUN_TEST(test_step_given_a_gap_or_bad_number_leaves_that_innovation_out);
    RUN_TEST(test_step_given_no_sample_predicts_and_says_so);
    RUN_TEST(test_step_given_wrong_arguments_leaves_state_and_out_untouched);
    RUN_TEST(test_step_given_samples_that_overflow_the_state_predicts);
    RUN_TEST(test_step_given_an_unstable_plant_recovers_after_any_time_without_samples);
    RUN_TEST(test_reset_given_a_start_takes_it_and_refuses_what_is_not_finite);
    RUN_TEST(test_ops_given_the_same_data_yield_the_same_bits);
    RUN_TEST(test_mem_len_given_another_model_is_zero);
    return UNITY_END();
}
