/* SPDX-License-Identifier: MIT */
/* Models that init refuses, and samples that are missing, huge or not numbers. */
#include <string.h>
#include "guard_model.h"

static const blw_real_t u[1]      = {BLW_R(1.0)};
static const blw_real_t benign[3] = {BLW_R(4.5), BLW_R(5.0), BLW_R(5.5)};

static guard_made_t        made;
static blw_real_t          mem[GUARD_MEM];
static blw_guard_t         guard;
static blw_estimator_out_t out;

void setUp(void)
{
    guard_make(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_guard_init(&guard, &made.model, mem, GUARD_MEM));
}

void tearDown(void) {}

static void step(const blw_real_t *y, blw_mask_t valid)
{
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_guard_step(&guard, u, y, valid, &out));
}

/* The model as it is now is refused with the state untouched; then it is made anew. */
static void assert_refused(void)
{
    const blw_guard_t before = guard;

    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, blw_guard_init(&guard, &made.model, mem, GUARD_MEM));
    TEST_ASSERT_EQUAL_MEMORY(&before, &guard, sizeof before);
    guard_make(&made);
}

static void test_init_given_null_or_little_memory_refuses(void)
{
    TEST_ASSERT_EQUAL_size_t(GUARD_MEM, blw_guard_ops.mem_len(&made.model.head));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_guard_init(NULL, &made.model, mem, GUARD_MEM));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_guard_init(&guard, NULL, mem, GUARD_MEM));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_guard_init(&guard, &made.model, NULL, GUARD_MEM));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MEM, blw_guard_init(&guard, &made.model, mem, GUARD_MEM - 1U));
}

static void test_init_given_sizes_out_of_limits_refuses(void)
{
    made.model.r = 0U;
    assert_refused();
    made.model.reach = 0U;
    assert_refused();
    made.model.reach = 2U;
    assert_refused();
    made.model.pairs = 2U;
    assert_refused();
    made.kalman.plant.p = 0U; /* nothing to be excluded */
    assert_refused();
    made.model.n_u = 2U;
    assert_refused();
    made.model.n_units = 4U;
    assert_refused();
    made.model.n_units = 1U;
    assert_refused();
    made.model.most = 0U;
    assert_refused();
    made.model.most = 4U;
    assert_refused();
    made.model.search = 3U;
    assert_refused();
    made.model.max_updates = 0U;
    assert_refused();
    made.model.solver = NULL;
    assert_refused();
}

static void test_init_given_the_solver_for_one_liar_without_what_it_needs_refuses(void)
{
    made.model.solver = &blw_guard_one_ops;
    made.model.pairs  = 0U;
    assert_refused();
    made.model.solver   = &blw_guard_one_ops;
    made.kalman.plant.p = 2U;
    made.model.most     = 2U;
    assert_refused();
}

static void test_init_given_wrong_units_or_ranks_refuses(void)
{
    static const uint16_t outside[3] = {0U, 1U, 3U};
    static const uint16_t pair[3]    = {0U, 0U, 1U};
    static const uint16_t rank[3]    = {1U, 2U, 1U};

    made.model.unit = NULL;
    assert_refused();
    made.model.rank = NULL;
    assert_refused();
    made.model.n_units = 2U; /* pairs are for sensors */
    made.model.unit    = pair;
    assert_refused();
    made.model.unit = outside;
    assert_refused();
    made.model.rank = rank;
    assert_refused();
    made.model.unit = pair; /* the pair does not fit into most = 1 */
    made.model.most = 1U;
    assert_refused();
}

static void test_init_given_wrong_numbers_refuses(void)
{
    static const blw_real_t zeros[3] = {BLW_R(0.0), BLW_R(0.0), BLW_R(0.0)};
    static const blw_real_t minus[3] = {BLW_R(-1.0), BLW_R(1.0), BLW_R(1.0)};
    blw_real_t *const       value[7] = {&made.model.k,    &made.model.exclude, &made.model.gross,
                                        &made.model.gain, &made.model.kappa,   &made.model.omega,
                                        &made.model.sigma};
    const blw_real_t        bad[7]   = {BLW_R(0.0),  BLW_R(1.0),  BLW_R(0.0), BLW_R(0.0),
                                        BLW_R(-1.0), BLW_R(-1.0), BLW_R(-1.0)};

    for (size_t i = 0U; i < 7U; i++) {
        *value[i] = bad[i];
        guard_seal(&made);
        assert_refused();
    }
    made.model.gain = BLW_R(1.5);
    guard_seal(&made);
    assert_refused();
    made.model.drift = zeros;
    guard_seal(&made);
    assert_refused();
    made.model.effect = minus;
    guard_seal(&made);
    assert_refused();
}

static void test_init_given_missing_tables_or_a_wrong_sum_refuses(void)
{
    const blw_real_t **const table[9] = {&made.model.Lam,   &made.model.b,  &made.model.S,
                                         &made.model.Fu,    &made.model.Gu, &made.model.effect,
                                         &made.model.drift, &made.model.V,  &made.model.s};

    for (size_t i = 0U; i < 9U; i++) {
        *table[i] = NULL;
        assert_refused();
    }
    made.model.head.crc ^= 1U;
    assert_refused();
    made.model.head.method = (uint8_t)BLW_METHOD_KALMAN;
    assert_refused();
    made.model.head.abi ^= 0x0100U;
    assert_refused();
}

static void test_step_given_wrong_arguments_leaves_state_and_out_untouched(void)
{
    const blw_real_t bad_u[1] = {support_nan};
    blw_real_t       mem_before[GUARD_MEM];

    step(benign, 7U);
    const blw_guard_t         before     = guard;
    const blw_estimator_out_t out_before = out;
    memcpy(mem_before, mem, sizeof mem);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_guard_step(NULL, u, benign, 7U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_guard_step(&guard, u, benign, 7U, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_guard_step(&guard, u, NULL, 7U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_guard_step(&guard, u, benign, 8U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_INPUT, blw_guard_step(&guard, bad_u, benign, 7U, &out));
    TEST_ASSERT_EQUAL_MEMORY(&before, &guard, sizeof before);
    TEST_ASSERT_EQUAL_MEMORY(&out_before, &out, sizeof out);
    TEST_ASSERT_EQUAL_MEMORY(mem_before, mem, sizeof mem);
}

static void test_step_given_a_missing_sample_coasts_on_its_prediction(void)
{
    const blw_real_t bad[4] = {support_nan, support_inf, -support_inf, BLW_REAL_MAX};

    for (size_t i = 0U; i < 5U; i++) {
        const blw_real_t gap[3] = {bad[i % 4U], BLW_R(5.5), BLW_R(5.5)};

        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_guard_reset(&guard, NULL));
        step(gap, (i < 4U) ? 7U : 6U); /* innovations 0, 0.5, -0.5 */
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0, out.x_hat[0]);
        TEST_ASSERT_EQUAL_HEX64(6U, out.used);
        TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING, out.flags);
        TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.suspicion[0]);
        TEST_ASSERT_TRUE(out.suspicion[1] < BLW_R(0.5));
    }
}

static void test_step_given_no_sample_predicts_and_says_so(void)
{
    step(benign, 0U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_KALMAN, out.outcome);
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING | BLW_FLAG_DEGRADED | BLW_FLAG_BLIND, out.flags);
}

static void test_step_given_a_sample_that_overflows_its_filter_takes_it_as_missing(void)
{
    const blw_real_t b[3] = {BLW_SIGNAL_MAX, BLW_R(1.0), BLW_R(1.0)};
    const blw_real_t y[3] = {BLW_R(1e6), BLW_R(5.0), BLW_R(6.0)};

    made.model.b = b;
    guard_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_guard_init(&guard, &made.model, mem, GUARD_MEM));
    step(y, 7U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX64(6U, out.used);
}

static void test_step_given_an_overflow_in_the_fusion_predicts(void)
{
    const blw_real_t Fu[3] = {BLW_REAL_MAX, BLW_REAL_MAX, BLW_REAL_MAX};
    const blw_real_t y[3]  = {BLW_R(24.0), BLW_R(25.0), BLW_R(26.0)};

    made.model.Fu = Fu;
    guard_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_guard_init(&guard, &made.model, mem, GUARD_MEM));
    step(y, 7U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX64(0U, out.used);
    TEST_ASSERT_TRUE((out.flags & BLW_FLAG_BLIND) != 0U);
}

static void test_reset_given_a_start_uses_it_and_refuses_what_is_no_number(void)
{
    const blw_real_t x0[1]  = {BLW_R(2.0)};
    const blw_real_t bad[1] = {support_nan};

    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_guard_reset(&guard, x0));
    step(benign, 0U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_guard_reset(&guard, bad));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_guard_reset(NULL, x0));
}

static void test_ops_serve_the_common_interface(void)
{
    blw_estimator_t *const self = &guard.base;

    TEST_ASSERT_EQUAL_size_t(0U, blw_guard_ops.mem_len(NULL));
    TEST_ASSERT_EQUAL_size_t(0U, blw_guard_ops.mem_len(&made.kalman.model.head));
    TEST_ASSERT_EQUAL_size_t(sizeof guard, blw_guard_ops.state_size);
    TEST_ASSERT_EQUAL_INT(
        BLW_OK, blw_estimator_init(self, &blw_guard_ops, &made.model.head, mem, GUARD_MEM));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_reset(self, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_step(self, u, benign, 7U, &out));
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0, out.x_hat[0]);
    made.model.head.plant = NULL;
    TEST_ASSERT_EQUAL_size_t(0U, blw_guard_ops.mem_len(&made.model.head));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_given_null_or_little_memory_refuses);
    RUN_TEST(test_init_given_sizes_out_of_limits_refuses);
    RUN_TEST(test_init_given_the_solver_for_one_liar_without_what_it_needs_refuses);
    RUN_TEST(test_init_given_wrong_units_or_ranks_refuses);
    RUN_TEST(test_init_given_wrong_numbers_refuses);
    RUN_TEST(test_init_given_missing_tables_or_a_wrong_sum_refuses);
    RUN_TEST(test_step_given_wrong_arguments_leaves_state_and_out_untouched);
    RUN_TEST(test_step_given_a_missing_sample_coasts_on_its_prediction);
    RUN_TEST(test_step_given_no_sample_predicts_and_says_so);
    RUN_TEST(test_step_given_a_sample_that_overflows_its_filter_takes_it_as_missing);
    RUN_TEST(test_step_given_an_overflow_in_the_fusion_predicts);
    RUN_TEST(test_reset_given_a_start_uses_it_and_refuses_what_is_no_number);
    RUN_TEST(test_ops_serve_the_common_interface);
    return UNITY_END();
}
