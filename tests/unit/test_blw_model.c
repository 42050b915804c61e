/* SPDX-License-Identifier: MIT */
#include "support.h"

static support_kalman_t  made;
static blw_table_check_t check;

void setUp(void)
{
    support_kalman_make(&made);
}

void tearDown(void) {}

static blw_status_t begin(void)
{
    return blw_model_begin(&made.model.head, BLW_METHOD_KALMAN, &check);
}

static void test_table_add_given_known_numbers_yields_the_crc_of_zlib(void)
{
    static const blw_real_t table[4] = {BLW_R(1.0), BLW_R(-2.5), BLW_R(0.1), BLW_R(3e20)};

    blw_table_begin(&check);
    blw_table_add(&check, table, 4U);
    TEST_ASSERT_EQUAL_HEX32(BLW_CRC(0xEAA13D8AU, 0x4352E454U), check.crc);
    TEST_ASSERT_TRUE(check.ok);
}

static void test_table_add_real_given_one_number_equals_a_table_of_one(void)
{
    blw_table_begin(&check);
    TEST_ASSERT_EQUAL_HEX32(0U, check.crc);
    blw_table_add_real(&check, BLW_R(1.0));
    TEST_ASSERT_EQUAL_HEX32(BLW_CRC(0xACA16A6AU, 0xC7F813E9U), check.crc);
}

static void test_table_add_given_null_fails_unless_it_is_empty(void)
{
    blw_table_begin(&check);
    blw_table_add(&check, NULL, 0U);
    TEST_ASSERT_TRUE(check.ok);
    blw_table_add(&check, NULL, 1U);
    TEST_ASSERT_FALSE(check.ok);
}

static void test_table_add_given_nan_or_infinity_fails_for_good(void)
{
    const blw_real_t bad[3] = {support_nan, support_inf, -support_inf};

    for (size_t i = 0U; i < 3U; i++) {
        blw_table_begin(&check);
        blw_table_add_real(&check, bad[i]);
        blw_table_add_real(&check, BLW_R(1.0));
        TEST_ASSERT_FALSE(check.ok);
    }
}

static void test_model_begin_given_null_is_an_argument_error(void)
{
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_model_begin(NULL, BLW_METHOD_KALMAN, &check));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_model_begin(&made.model.head, BLW_METHOD_KALMAN, NULL));
}

static void test_model_begin_given_a_sound_model_adds_the_plant_in_order_of_its_members(void)
{
    const blw_plant_t *const p        = &made.plant;
    blw_table_check_t        expected = {0};

    blw_table_begin(&expected);
    blw_table_add(&expected, p->A, 1U);
    blw_table_add(&expected, p->Bu, 1U);
    blw_table_add(&expected, p->C, 3U);
    blw_table_add(&expected, p->offset, 3U);
    blw_table_add(&expected, p->y_min, 3U);
    blw_table_add(&expected, p->y_max, 3U);
    blw_table_add(&expected, p->x0, 1U);
    TEST_ASSERT_EQUAL_INT(BLW_OK, begin());
    TEST_ASSERT_EQUAL_HEX32(expected.crc, check.crc);
}

static void test_model_begin_given_a_wrong_head_refuses(void)
{
    made.model.head.abi ^= 0x0CU; /* float <-> double */
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, begin());
    support_kalman_make(&made);
    made.model.head.method = (uint8_t)BLW_METHOD_LASSO;
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, begin());
    support_kalman_make(&made);
    made.model.head.plant = NULL;
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, begin());
}

static void test_model_begin_given_impossible_sizes_refuses(void)
{
    static const struct {
        uint8_t n, m, p;
    } sizes[4] = {{0U, 3U, 1U}, {1U, 0U, 0U}, {1U, 65U, 1U}, {1U, 3U, 3U}};

    for (size_t i = 0U; i < 4U; i++) {
        made.plant.n = sizes[i].n;
        made.plant.m = sizes[i].m;
        made.plant.p = sizes[i].p;
        TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, begin());
    }
}

static void test_model_begin_given_a_missing_table_refuses(void)
{
    const blw_real_t **const tables[7] = {
        &made.plant.A,     &made.plant.Bu,    &made.plant.C,  &made.plant.offset,
        &made.plant.y_min, &made.plant.y_max, &made.plant.x0,
    };

    for (size_t i = 0U; i < 7U; i++) {
        const blw_real_t *const table = *tables[i];

        *tables[i] = NULL;
        TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, begin());
        *tables[i] = table;
    }
    TEST_ASSERT_EQUAL_INT(BLW_OK, begin());
}

static void test_model_begin_given_no_input_needs_no_table_of_inputs(void)
{
    made.plant.l  = 0U;
    made.plant.Bu = NULL;
    TEST_ASSERT_EQUAL_INT(BLW_OK, begin());
}

static void test_model_begin_given_an_empty_range_refuses(void)
{
    made.plant.y_max = made.plant.y_min;
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, begin());
}

static void test_model_begin_given_a_start_beyond_the_largest_signal_refuses(void)
{
    const blw_real_t far[1] = {BLW_R(2.0) * BLW_SIGNAL_MAX};

    made.plant.x0 = far;
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, begin());
}

static void test_model_end_given_a_wrong_sum_or_a_bad_table_refuses(void)
{
    check = (blw_table_check_t){.crc = made.model.head.crc, .ok = true};
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_model_end(&made.model.head, &check));
    check.ok = false;
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, blw_model_end(&made.model.head, &check));
    check = (blw_table_check_t){.crc = made.model.head.crc ^ 1U, .ok = true};
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, blw_model_end(&made.model.head, &check));
}

static void test_input_ok_given_each_kind_of_input_accepts_only_bounded_ones(void)
{
    const blw_real_t u[5] = {BLW_SIGNAL_MAX, BLW_R(2.0) * BLW_SIGNAL_MAX, support_nan, support_inf,
                             -support_inf};

    TEST_ASSERT_TRUE(blw_plant_input_ok(&made.plant, NULL));
    TEST_ASSERT_TRUE(blw_plant_input_ok(&made.plant, &u[0]));
    for (size_t i = 1U; i < 5U; i++) {
        TEST_ASSERT_FALSE(blw_plant_input_ok(&made.plant, &u[i]));
    }
}

static void test_screen_given_good_and_bad_samples_keeps_the_good_ones(void)
{
    const struct {
        blw_real_t y[3];
        blw_mask_t valid;
        blw_mask_t used;
    } cases[] = {
        {{BLW_R(1.0), BLW_R(2.0), BLW_R(3.0)}, 7U, 7U},
        {{BLW_R(1.0), BLW_R(2.0), BLW_R(3.0)}, 5U, 5U},
        {{BLW_R(1.0), BLW_R(-50.0), BLW_R(50.0)}, 7U, 7U}, /* the limits belong to the range */
        {{BLW_R(1.0), BLW_R(-50.1), BLW_R(50.1)}, 7U, 1U},
        {{support_nan, support_inf, -support_inf}, 7U, 0U},
        {{-support_inf, support_nan, BLW_R(0.0)}, 7U, 4U},
        {{BLW_SIGNAL_MAX, BLW_R(0.0), BLW_R(0.0)}, 7U, 7U},
        {{BLW_R(1.1) * BLW_SIGNAL_MAX, BLW_R(0.0), BLW_R(0.0)}, 7U, 6U},
        {{BLW_R(0.0), BLW_R(0.0), BLW_R(0.0)}, ~(blw_mask_t)0, 7U},
    };

    for (size_t i = 0U; i < (sizeof cases / sizeof cases[0]); i++) {
        TEST_ASSERT_EQUAL_HEX64(cases[i].used,
                                blw_plant_screen(&made.plant, cases[i].y, cases[i].valid));
    }
}

static void test_screen_given_the_most_sensors_reaches_the_last_bit(void)
{
    blw_real_t lo[BLW_MAX_SENSORS];
    blw_real_t hi[BLW_MAX_SENSORS];
    blw_real_t y[BLW_MAX_SENSORS];

    for (size_t i = 0U; i < BLW_MAX_SENSORS; i++) {
        lo[i] = BLW_R(-1.0);
        hi[i] = BLW_R(1.0);
        y[i]  = BLW_R(0.0);
    }
    made.plant.m     = (uint8_t)BLW_MAX_SENSORS;
    made.plant.y_min = lo;
    made.plant.y_max = hi;
    y[63]            = BLW_R(2.0);
    TEST_ASSERT_EQUAL_HEX64(0x7FFFFFFFFFFFFFFFULL,
                            blw_plant_screen(&made.plant, y, ~(blw_mask_t)0));
}

static void test_predict_given_two_states_and_inputs_yields_hand_computed_state(void)
{
    static const blw_real_t A[4]  = {BLW_R(1.0), BLW_R(2.0), BLW_R(3.0), BLW_R(4.0)};
    static const blw_real_t Bu[6] = {BLW_R(1.0), BLW_R(0.0), BLW_R(-1.0),
                                     BLW_R(2.0), BLW_R(5.0), BLW_R(0.0)};
    static const blw_real_t x[2]  = {BLW_R(10.0), BLW_R(-1.0)};
    static const blw_real_t u[3]  = {BLW_R(1.0), BLW_R(2.0), BLW_R(3.0)};
    const blw_plant_t       plant = {.n = 2U, .m = 1U, .l = 3U, .A = A, .Bu = Bu};
    blw_real_t              x_bar[2];

    blw_plant_predict(&plant, x, u, x_bar); /* (8, 26) + (-2, 12) */
    TEST_ASSERT_REAL_WITHIN(0.0, 6.0, x_bar[0]);
    TEST_ASSERT_REAL_WITHIN(0.0, 38.0, x_bar[1]);
    blw_plant_predict(&plant, x, NULL, x_bar);
    TEST_ASSERT_REAL_WITHIN(0.0, 8.0, x_bar[0]);
    TEST_ASSERT_REAL_WITHIN(0.0, 26.0, x_bar[1]);
}

static void test_predict_given_a_state_that_leaves_the_bounds_starts_again_from_x0(void)
{
    const blw_real_t bad[3] = {BLW_REAL_MAX, support_nan, BLW_R(3.0) * BLW_SIGNAL_MAX};
    blw_real_t       x_bar[1];

    for (size_t i = 0U; i < 3U; i++) {
        blw_plant_predict(&made.plant, &bad[i], NULL, x_bar);
        TEST_ASSERT_REAL_WITHIN(0.0, made.plant.x0[0], x_bar[0]);
    }
}

static void test_innovate_given_gaps_leaves_them_at_their_prediction(void)
{
    const blw_real_t y[3]     = {BLW_R(11.0), support_nan, BLW_R(13.0)};
    const blw_real_t x_bar[1] = {BLW_R(7.0)};
    blw_real_t       out[3];

    blw_plant_innovate(&made.plant, y, 5U, x_bar, out);
    TEST_ASSERT_REAL_WITHIN(0.0, 3.0, out[0]);
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, out[1]);
    TEST_ASSERT_REAL_WITHIN(0.0, 3.0, out[2]);
}

static void test_mask_count_given_masks_counts_their_bits(void)
{
    TEST_ASSERT_EQUAL_UINT(0U, blw_mask_count(0U));
    TEST_ASSERT_EQUAL_UINT(1U, blw_mask_count((blw_mask_t)1U << 63));
    TEST_ASSERT_EQUAL_UINT(3U, blw_mask_count(0x8011U));
    TEST_ASSERT_EQUAL_UINT(64U, blw_mask_count(~(blw_mask_t)0));
    TEST_ASSERT_EQUAL_HEX64(1U, BLW_MASK_ALL(1U));
    TEST_ASSERT_EQUAL_HEX64(~(blw_mask_t)0, BLW_MASK_ALL(64U));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_table_add_given_known_numbers_yields_the_crc_of_zlib);
    RUN_TEST(test_table_add_real_given_one_number_equals_a_table_of_one);
    RUN_TEST(test_table_add_given_null_fails_unless_it_is_empty);
    RUN_TEST(test_table_add_given_nan_or_infinity_fails_for_good);
    RUN_TEST(test_model_begin_given_null_is_an_argument_error);
    RUN_TEST(test_model_begin_given_a_sound_model_adds_the_plant_in_order_of_its_members);
    RUN_TEST(test_model_begin_given_a_wrong_head_refuses);
    RUN_TEST(test_model_begin_given_impossible_sizes_refuses);
    RUN_TEST(test_model_begin_given_a_missing_table_refuses);
    RUN_TEST(test_model_begin_given_no_input_needs_no_table_of_inputs);
    RUN_TEST(test_model_begin_given_an_empty_range_refuses);
    RUN_TEST(test_model_begin_given_a_start_beyond_the_largest_signal_refuses);
    RUN_TEST(test_model_end_given_a_wrong_sum_or_a_bad_table_refuses);
    RUN_TEST(test_input_ok_given_each_kind_of_input_accepts_only_bounded_ones);
    RUN_TEST(test_screen_given_good_and_bad_samples_keeps_the_good_ones);
    RUN_TEST(test_screen_given_the_most_sensors_reaches_the_last_bit);
    RUN_TEST(test_predict_given_two_states_and_inputs_yields_hand_computed_state);
    RUN_TEST(test_predict_given_a_state_that_leaves_the_bounds_starts_again_from_x0);
    RUN_TEST(test_innovate_given_gaps_leaves_them_at_their_prediction);
    RUN_TEST(test_mask_count_given_masks_counts_their_bits);
    return UNITY_END();
}
