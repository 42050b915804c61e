/* SPDX-License-Identifier: MIT */
#include "bank_model.h"

static const blw_real_t y[3] = {BLW_R(2.0), BLW_R(3.0), BLW_R(4.0)};

static bank_model_t        made;
static blw_real_t          mem[BANK_MEM];
static blw_bank_t          bank;
static blw_estimator_out_t out;

void setUp(void)
{
    bank_make(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_bank_init(&bank, &made.model, mem, BANK_MEM));
}

void tearDown(void) {}

/* The model as it is now, sealed, is refused with the state untouched; then it is made anew. */
static void assert_refused(void)
{
    const blw_bank_t before = bank;

    bank_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, blw_bank_init(&bank, &made.model, mem, BANK_MEM));
    TEST_ASSERT_EQUAL_MEMORY(&before, &bank, sizeof before);
    bank_make(&made);
}

static void test_init_given_null_or_little_memory_refuses(void)
{
    const size_t needed = blw_bank_ops.mem_len(&made.model.head);

    TEST_ASSERT_EQUAL_size_t(BLW_BANK_MEM(1, 3, 3, 3, 6, 2, 0), needed);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_bank_init(NULL, &made.model, mem, needed));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_bank_init(&bank, NULL, mem, needed));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_bank_init(&bank, &made.model, NULL, needed));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MEM, blw_bank_init(&bank, &made.model, mem, needed - 1U));
}

static void test_init_given_sizes_out_of_limits_refuses(void)
{
    made.plant.m = 9U;
    assert_refused();
    made.plant.m = 4U;
    made.plant.p = 3U;
    assert_refused();
    made.model.sets = 0U;
    assert_refused();
    made.model.sets = BLW_BANK_MAX_SETS + 1U;
    assert_refused();
    made.model.subsets = 0U;
    assert_refused();
    made.model.per_set = 0U;
    assert_refused();
    made.model.horizon = 0U;
    assert_refused();
    made.model.warm_up = 1U;
    assert_refused();
    made.model.filtered = 2U;
    assert_refused();
}

static void test_init_given_a_bad_average_refuses(void)
{
    made.model.gain = BLW_R(0.0);
    assert_refused();
    made.model.gain = BLW_R(1.5);
    assert_refused();
    made.model.ceiling = BLW_R(1.0);
    assert_refused();
    made.model.groups = 0U;
    assert_refused();
    made.model.groups = 2U;
    assert_refused();
    made.model.groups = 2U;
    made.model.window = 5U;
    assert_refused();
}

static void test_init_given_bad_index_tables_refuses(void)
{
    made.model.set_mask = NULL;
    assert_refused();
    made.model.subset_mask = NULL;
    assert_refused();
    made.model.pair = NULL;
    assert_refused();
    made.set_mask[1] = 0U;
    assert_refused();
    made.subset_mask[2] = 8U;
    assert_refused();
    made.pair[3] = 3U;
    assert_refused();
    made.pair[3] = 1U; /* sensor 1 is not in {0,2} */
    assert_refused();
}

static void test_init_given_bad_numbers_refuses(void)
{
    made.scale[1] = BLW_R(0.0);
    assert_refused();
    made.start[1] = BLW_R(-0.1);
    assert_refused();
    made.start[1] = BLW_R(1.1);
    assert_refused();
    made.gate[5] = BLW_R(0.0);
    assert_refused();
    made.Z[0] = support_nan;
    assert_refused();
    made.model.K = NULL;
    assert_refused();
    made.model.head.abi++;
    assert_refused();
    made.K[0] = BLW_R(0.5); /* the checksum no longer fits */
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, blw_bank_init(&bank, &made.model, mem, BANK_MEM));
}

static void test_step_given_wrong_arguments_leaves_state_and_out_untouched(void)
{
    const blw_real_t bad_u[1] = {support_nan};

    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_bank_step(&bank, NULL, y, 7U, &out));
    const blw_estimator_out_t before = out;
    const blw_bank_t          state  = bank;
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_bank_step(NULL, NULL, y, 7U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_bank_step(&bank, NULL, NULL, 7U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_bank_step(&bank, NULL, y, 8U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_bank_step(&bank, NULL, y, 7U, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_INPUT, blw_bank_step(&bank, bad_u, y, 7U, &out));
    TEST_ASSERT_EQUAL_MEMORY(&before, &out, sizeof out);
    TEST_ASSERT_EQUAL_MEMORY(&state, &bank, sizeof bank);
}

static void test_step_given_bad_numbers_takes_them_for_missing(void)
{
    const blw_real_t bad[3] = {support_nan, support_inf, BLW_REAL_MAX};

    for (size_t i = 0U; i < 3U; i++) {
        const blw_real_t gap[3] = {bad[i], y[1], y[2]};

        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_bank_reset(&bank, NULL));
        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_bank_step(&bank, NULL, gap, 7U, &out));
        TEST_ASSERT_EQUAL_HEX64(6U, out.used);
        TEST_ASSERT_REAL_WITHIN(0.0, 0.5, out.x_hat[0]); /* {1,2}: 2 (1/4) 1 */
    }
}

static void test_step_given_a_sample_that_overflows_a_filter_restarts_that_filter(void)
{
    const blw_real_t far[3] = {BLW_SIGNAL_MAX, y[1], y[2]};

    for (size_t i = 0U; i < 4U; i++) { /* the sets that hold sensor 0 */
        made.K[i] = ((i % 2U) == 0U) ? BLW_R(8.0) : BLW_R(0.25);
    }
    bank_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_bank_init(&bank, &made.model, mem, BANK_MEM));
    for (size_t k = 0U; k < 5U; k++) {
        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_bank_step(&bank, NULL, far, 7U, &out));
        TEST_ASSERT_TRUE((out.x_hat[0] >= BLW_R(0.0)) && (out.x_hat[0] <= BLW_R(1.0)));
    }
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
}

static void test_reset_given_a_start_takes_it_and_refuses_what_is_not_finite(void)
{
    const blw_real_t start[1] = {BLW_R(10.0)};
    const blw_real_t bad[1]   = {support_inf};

    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_bank_reset(&bank, start));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_bank_reset(&bank, bad));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_bank_reset(NULL, start));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_bank_step(&bank, NULL, y, 0U, &out));
    TEST_ASSERT_REAL_WITHIN(0.0, 5.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_bank_reset(&bank, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_bank_step(&bank, NULL, y, 0U, &out));
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, out.x_hat[0]);
}

static void test_ops_given_the_same_data_yield_the_same_bits(void)
{
    static blw_real_t                other_mem[BANK_MEM];
    static blw_bank_t                other;
    blw_estimator_t *const           base = &other.base;
    blw_estimator_out_t              other_out;
    const blw_estimator_ops_t *const ops = &blw_bank_ops;

    TEST_ASSERT_EQUAL_INT(BLW_METHOD_BANK, ops->method);
    TEST_ASSERT_EQUAL_size_t(sizeof(blw_bank_t), ops->state_size);
    TEST_ASSERT_EQUAL_INT(BLW_OK,
                          blw_estimator_init(base, ops, &made.model.head, other_mem, BANK_MEM));
    TEST_ASSERT_EQUAL_PTR(ops, base->ops);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_reset(base, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_step(base, NULL, y, 7U, &other_out));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_bank_step(&bank, NULL, y, 7U, &out));
    TEST_ASSERT_EQUAL_MEMORY(out.x_hat, other_out.x_hat, sizeof(blw_real_t));
}

static void test_mem_len_given_another_model_is_zero(void)
{
    TEST_ASSERT_EQUAL_size_t(0U, blw_bank_ops.mem_len(NULL));
    made.model.head.method = (uint8_t)BLW_METHOD_GUARD;
    TEST_ASSERT_EQUAL_size_t(0U, blw_bank_ops.mem_len(&made.model.head));
    bank_make(&made);
    made.model.head.plant = NULL;
    TEST_ASSERT_EQUAL_size_t(0U, blw_bank_ops.mem_len(&made.model.head));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_given_null_or_little_memory_refuses);
    RUN_TEST(test_init_given_sizes_out_of_limits_refuses);
    RUN_TEST(test_init_given_a_bad_average_refuses);
    RUN_TEST(test_init_given_bad_index_tables_refuses);
    RUN_TEST(test_init_given_bad_numbers_refuses);
    RUN_TEST(test_step_given_wrong_arguments_leaves_state_and_out_untouched);
    RUN_TEST(test_step_given_bad_numbers_takes_them_for_missing);
    RUN_TEST(test_step_given_a_sample_that_overflows_a_filter_restarts_that_filter);
    RUN_TEST(test_reset_given_a_start_takes_it_and_refuses_what_is_not_finite);
    RUN_TEST(test_ops_given_the_same_data_yield_the_same_bits);
    RUN_TEST(test_mem_len_given_another_model_is_zero);
    return UNITY_END();
}
