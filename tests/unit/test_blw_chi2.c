/* SPDX-License-Identifier: MIT */
#include "blw/blw_chi2.h"
#include <string.h>
#include "support.h"

#define SIZE    2U
#define WINDOW  4U
#define N_RATES 2U

/* S = [4 1.2; 1.2 1]; thresholds F^-1(1 - alpha; 2 w) for alpha = 1e-3 and 0.05 */
static const blw_real_t Linv[3] = {BLW_R(0.5), BLW_R(-0.375), BLW_R(1.25)};
static const blw_real_t rate[2] = {BLW_R(1e-3), BLW_R(0.05)};
static const blw_real_t thr[8]  = {
     BLW_R(13.815510557964274), BLW_R(18.466826952903173), BLW_R(22.457744484825326),
     BLW_R(26.124481558376143), BLW_R(5.9914645471079799), BLW_R(9.4877290367811558),
     BLW_R(12.591587243743977), BLW_R(15.507313055865454),
};

static const blw_real_t r_unit[2] = {BLW_R(2.0), BLW_R(1.0)};  /* L^-1 r = (1, 1/2), g = 1.25 */
static const blw_real_t r_huge[2] = {BLW_R(20.0), BLW_R(6.0)}; /* L^-1 r = (10, 0),  g = 100  */

static blw_chi2_model_t model;
static blw_real_t       mem[BLW_CHI2_MEM(WINDOW)];
static blw_chi2_t       det;
static blw_chi2_out_t   out;

static void seal(void)
{
    blw_table_check_t check;

    blw_table_begin(&check);
    blw_table_add(&check, model.Linv, (SIZE * (SIZE + 1U)) / 2U);
    blw_table_add(&check, model.rate, N_RATES);
    blw_table_add(&check, model.thr, N_RATES * WINDOW);
    model.crc = check.crc;
}

void setUp(void)
{
    model = (blw_chi2_model_t){.abi     = BLW_MODEL_ABI,
                               .p       = SIZE,
                               .W       = WINDOW,
                               .n_rates = N_RATES,
                               .Linv    = Linv,
                               .rate    = rate,
                               .thr     = thr};
    seal();
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_chi2_init(&det, &model, mem, BLW_CHI2_MEM(WINDOW)));
}

void tearDown(void) {}

static void assert_refused(blw_status_t expected, size_t len)
{
    const blw_chi2_t before = det;

    TEST_ASSERT_EQUAL_INT(expected, blw_chi2_init(&det, &model, mem, len));
    TEST_ASSERT_EQUAL_MEMORY(&before, &det, sizeof before);
}

static void test_init_given_bad_arguments_refuses(void)
{
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_chi2_init(NULL, &model, mem, WINDOW));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_chi2_init(&det, NULL, mem, WINDOW));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_chi2_init(&det, &model, NULL, WINDOW));
    assert_refused(BLW_ERR_MEM, WINDOW - 1U);
}

static void test_init_given_wrong_sizes_or_sum_refuses(void)
{
    uint8_t *const sizes[3] = {&model.p, &model.W, &model.n_rates};

    for (size_t i = 0U; i < 3U; i++) {
        const uint8_t whole = *sizes[i];
        *sizes[i]           = 0U;
        assert_refused(BLW_ERR_MODEL, WINDOW);
        *sizes[i] = whole;
    }
    model.abi++;
    assert_refused(BLW_ERR_MODEL, WINDOW);
    model.abi--;
    model.crc++;
    assert_refused(BLW_ERR_MODEL, WINDOW);
}

static void test_init_given_wrong_tables_refuses(void)
{
    const blw_real_t bad_rate[2] = {BLW_R(1e-3), BLW_R(1.0)};
    const blw_real_t no_rate[2]  = {BLW_R(0.0), BLW_R(0.05)};
    blw_real_t       bad_thr[8];

    model.thr = NULL;
    assert_refused(BLW_ERR_MODEL, WINDOW);
    model.thr  = thr;
    model.rate = bad_rate;
    seal();
    assert_refused(BLW_ERR_MODEL, WINDOW);
    model.rate = no_rate;
    seal();
    assert_refused(BLW_ERR_MODEL, WINDOW);
    model.rate = rate;
    memcpy(bad_thr, thr, sizeof thr);
    bad_thr[6] = bad_thr[5];
    model.thr  = bad_thr;
    seal();
    assert_refused(BLW_ERR_MODEL, WINDOW);
}

static void test_step_given_known_residual_yields_hand_computed_statistic(void)
{
    for (size_t w = 1U; w <= 6U; w++) { /* fills at w = 4, then slides */
        const size_t used = (w < WINDOW) ? w : WINDOW;
        blw_chi2_step(&det, r_unit, &out);
        TEST_ASSERT_REAL_WITHIN(1e-6, 1.25, out.g);
        TEST_ASSERT_REAL_WITHIN(1e-6, 1.25 * (double)used, out.G);
        TEST_ASSERT_REAL_WITHIN(0.0, thr[used - 1U], out.thr);
        TEST_ASSERT_FALSE(out.alarm);
    }
}

static void test_step_given_one_bad_sample_alarms_until_it_leaves_the_window(void)
{
    const blw_real_t        nan[2] = {support_nan, BLW_R(0.0)};
    const blw_real_t *const bad[2] = {r_huge, nan};

    for (size_t c = 0U; c < 2U; c++) {
        blw_chi2_reset(&det);
        for (size_t k = 0U; k < 6U; k++) {
            blw_chi2_step(&det, (k == 1U) ? bad[c] : r_unit, &out);
            TEST_ASSERT_EQUAL((k >= 1U) && (k <= 4U), out.alarm);
        }
    }
}

static void test_select_given_another_rate_changes_the_threshold_only(void)
{
    blw_chi2_step(&det, r_unit, &out);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_chi2_select(&det, 1U));
    blw_chi2_step(&det, r_unit, &out);
    TEST_ASSERT_REAL_WITHIN(0.0, thr[5], out.thr);
    TEST_ASSERT_REAL_WITHIN(1e-6, 2.5, out.G);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_chi2_select(&det, N_RATES));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_chi2_select(NULL, 0U));
    blw_chi2_reset(&det);
    blw_chi2_step(&det, r_unit, &out);
    TEST_ASSERT_REAL_WITHIN(0.0, thr[4], out.thr);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_given_bad_arguments_refuses);
    RUN_TEST(test_init_given_wrong_sizes_or_sum_refuses);
    RUN_TEST(test_init_given_wrong_tables_refuses);
    RUN_TEST(test_step_given_known_residual_yields_hand_computed_statistic);
    RUN_TEST(test_step_given_one_bad_sample_alarms_until_it_leaves_the_window);
    RUN_TEST(test_select_given_another_rate_changes_the_threshold_only);
    return UNITY_END();
}
