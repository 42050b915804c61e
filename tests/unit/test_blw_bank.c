/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>
#include "bank_model.h"

static const blw_real_t u[1] = {BLW_R(1.0)};

static bank_model_t        made;
static blw_real_t          mem[BANK_MEM];
static blw_bank_t          bank;
static blw_estimator_out_t out;

static void start_bank(void)
{
    bank_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_bank_init(&bank, &made.model, mem, BANK_MEM));
}

void setUp(void)
{
    bank_make(&made);
    start_bank();
}

void tearDown(void) {}

/* One step with u = 1 and samples that differ by e_i from x, offsets 1, 2, 3 added. */
static void step_with(double x, double e0, double e1, double e2, blw_mask_t valid)
{
    const double     e[3] = {e0, e1, e2};
    blw_real_t       y[3];
    const blw_real_t offset[3] = {BLW_R(1.0), BLW_R(2.0), BLW_R(3.0)};

    for (size_t i = 0U; i < 3U; i++) {
        y[i] = (blw_real_t)(x + e[i]) + offset[i];
    }
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_bank_step(&bank, u, y, valid, &out));
}

static void test_step_given_an_attacked_sensor_yields_hand_computed_decision(void)
{
    step_with(1.0, 0.0, 0.0, 6.0, 7U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 1.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_WARMING_UP, out.flags);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_CONVERGED, out.outcome);

    /* Block of both steps: x_2 = 0.6*6 + 0.8*6 = 8.4, x_0 = x_1 = 0, x_s = 0, 1.5, 1.5 */
    step_with(1.5, 0.0, 0.0, 6.0, 7U);
    const double expected[BANK_PAIRS] = {0.25, 0.25, 1.375, 2.25, 1.375, 2.25};
    for (size_t i = 0U; i < BANK_PAIRS; i++) {
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, expected[i], bank.average[i]);
    }
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 1.5, out.x_hat[0]);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.25, out.statistic);
    TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.threshold);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.2, out.suspicion[0]);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.25 / 3.25, out.suspicion[2]);
    TEST_ASSERT_EQUAL_HEX64(4U, out.excluded);
    TEST_ASSERT_EQUAL_HEX64(7U, out.used);
    TEST_ASSERT_EQUAL_HEX8(0U, out.flags);
}

static void test_step_given_prediction_version_returns_estimates_without_the_newest_sample(void)
{
    made.model.filtered = 0U;
    start_bank();
    step_with(1.0, 4.0, 4.0, 4.0, 7U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 1.0, out.x_hat[0]);
    step_with(1.0, 0.0, 0.0, 0.0, 7U); /* x(1) = 1 + 2, x_bar(2) = 3/2 + 1 */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.5, out.x_hat[0]);
}

static void test_step_given_a_gross_sample_changes_the_set_at_once(void)
{
    step_with(1.0, 0.0, 0.0, 0.0, 7U);
    step_with(1.5, 0.0, 0.0, 0.0, 7U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.25, out.statistic);
    step_with(1.75, 20.0, 0.0, 0.0, 7U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 1.75, out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
    TEST_ASSERT_TRUE(out.statistic >= BLW_R(4.0) * (BLW_R(1.0) - BLW_REAL_EPS * BLW_R(64.0)));
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_CONVERGED, out.outcome);
}

static void test_step_given_a_gross_sample_keeps_its_sets_out_for_a_block(void)
{
    for (size_t i = 0U; i < BANK_PAIRS; i++) {
        made.scale[i] = BLW_R(1e-6); /* the averages never object */
    }
    start_bank();
    step_with(1.0, 0.0, 0.0, 0.0, 7U);
    step_with(1.5, 0.0, 0.0, 0.0, 7U);
    step_with(1.75, 20.0, 0.0, 0.0, 7U);
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
    step_with(1.875, 0.0, 0.0, 0.0, 7U);
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
    TEST_ASSERT_REAL_WITHIN(0.0, 2.25, out.statistic); /* the ceiling */
    step_with(1.9375, 0.0, 0.0, 0.0, 7U);
    TEST_ASSERT_EQUAL_HEX64(0U, out.excluded);
}

static void test_step_given_no_passing_set_leaves_a_choice_that_the_gate_rejects(void)
{
    made.scale[4] = BLW_R(1e6); /* {1,2} fails at the least residue */
    start_bank();
    step_with(1.0, 0.0, 1.0, 0.0, 7U);
    step_with(1.5, 0.0, 1.0, 0.0, 7U);
    TEST_ASSERT_EQUAL_HEX64(0U, bank.choice);
    TEST_ASSERT_TRUE(bank.worst[2] > BLW_R(1.0));
    step_with(1.75, 30.0, 1.0, 0.0, 7U);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_HELD, out.outcome);
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
    TEST_ASSERT_TRUE(out.x_hat[0] < BLW_R(3.0));
}

static void test_step_given_no_passing_set_holds_the_last_choice(void)
{
    step_with(1.0, 6.0, 0.0, 0.0, 7U);
    step_with(1.5, 6.0, 0.0, 0.0, 7U);
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
    step_with(1.75, 90.0, -90.0, 300.0, 7U);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_HELD, out.outcome);
    TEST_ASSERT_EQUAL_HEX64(1U, out.excluded);
}

static void test_step_given_a_gap_prefers_complete_sets_and_waits_for_complete_blocks(void)
{
    step_with(1.0, 0.0, 0.0, 0.0, 7U);
    step_with(1.5, 0.0, 0.0, 0.0, 7U);
    step_with(1.75, 0.0, 0.0, 1.0, 5U); /* sensor 1 is missing: set {0,2}, x = 1.75 + 1/4 */
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.0, out.x_hat[0]);
    TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.suspicion[1]);
    TEST_ASSERT_EQUAL_HEX64(5U, out.used);
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING, out.flags);
    TEST_ASSERT_REAL_WITHIN(0.0, 0.25, bank.average[1]); /* {0,1} by sensor 1 */
    step_with(1.875, 0.0, 0.0, 0.0, 7U);
    TEST_ASSERT_REAL_WITHIN(0.0, 0.25, bank.average[1]);
    step_with(1.9375, 0.0, 0.0, 0.0, 7U);
    TEST_ASSERT_TRUE(bank.average[1] < BLW_R(0.25));
}

static void test_step_given_seldom_samples_judges_a_block_by_those_it_has(void)
{
    made.model.max_gap = 1U;
    start_bank();
    step_with(1.0, 0.0, 4.0, 0.0, 7U); /* x_s = 2, 1, 2 */
    step_with(1.5, 0.0, 0.0, 0.0, 5U);
    /* x_0 = x_2 = 1; sensor 1 has its first sample only: 0.6 (5 - x_s) */
    const double expected[BANK_PAIRS] = {0.75, 1.87, 0.25, 0.25, 1.87, 0.75};
    for (size_t i = 0U; i < BANK_PAIRS; i++) {
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, expected[i], bank.average[i]);
    }
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 1.5, out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX64(2U, out.excluded);
}

static void test_step_given_seldom_samples_leaves_a_sensor_out_after_the_gap_only(void)
{
    made.model.max_gap = 1U;
    start_bank();
    step_with(1.0, 0.0, 0.0, 0.0, 7U);
    step_with(1.5, 0.0, 0.0, 0.0, 5U);
    TEST_ASSERT_EQUAL_UINT8(0U, bank.choice); /* {0,1}, although sensor 1 has not sent now */
    step_with(1.75, 0.0, 0.0, 0.0, 5U);
    TEST_ASSERT_EQUAL_UINT8(1U, bank.choice); /* {0,2} */
    for (size_t k = 0U; k < 300U; k++) {
        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_bank_step(&bank, u, made.offset, 5U, &out));
    }
    TEST_ASSERT_EQUAL_UINT8(UINT8_MAX, bank.silent[1]);
}

static void test_step_given_no_sample_predicts_and_says_so(void)
{
    step_with(0.0, 0.0, 0.0, 0.0, 0U);
    TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.x_hat[0]);
    TEST_ASSERT_EQUAL_HEX8(
        BLW_FLAG_MISSING | BLW_FLAG_DEGRADED | BLW_FLAG_BLIND | BLW_FLAG_WARMING_UP, out.flags);
    step_with(1.5, 0.0, 0.0, 0.0, 1U);
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING | BLW_FLAG_DEGRADED,
                           (unsigned)out.flags & ~BLW_FLAG_WARMING_UP);
}

static void test_step_given_a_window_decides_at_its_end_with_fresh_sums(void)
{
    made.model.window = 4U;
    made.model.groups = 2U;
    start_bank();
    for (size_t k = 1U; k <= 4U; k++) { /* the blocks 1 to 3 */
        step_with(2.0 - pow(0.5, (double)k - 1.0), 0.0, 0.0, 6.0, 7U);
        TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_WARMING_UP, out.flags);
    }
    step_with(1.9375, 0.0, 0.0, 6.0, 7U);
    TEST_ASSERT_EQUAL_HEX8(0U, out.flags);
    TEST_ASSERT_EQUAL_HEX64(4U, out.excluded);
    for (size_t i = 0U; i < (2U * BANK_PAIRS); i++) {
        TEST_ASSERT_REAL_WITHIN(0.0, 0.0, bank.average[i]);
    }
    for (size_t k = 6U; k <= 9U; k++) { /* sensor 2 is silent: its blocks count as benign, 1/2 */
        step_with(2.0 - pow(0.5, (double)k - 1.0), 0.0, 0.0, 0.0, 3U);
    }
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, bank.worst[0]);
    TEST_ASSERT_TRUE(bank.worst[1] >= BLW_R(0.5));
}

/* The same bank written down as in blw_bank.h, with absolute estimates and of the
 * past the last step. */
#define STEPS 400U
typedef struct textbook {
    double x[BANK_SETS][2];
    double y[2][3];
    double average[BANK_PAIRS];
} textbook_t;

static void textbook_step(textbook_t *book, size_t k)
{
    static const size_t member[BANK_SETS][2] = {{0U, 1U}, {0U, 2U}, {1U, 2U}};

    for (size_t s = 0U; s < BANK_SETS; s++) {
        const double x_bar = ((k > 0U) ? (0.5 * book->x[s][(k - 1U) % 2U]) : 0.0) + 1.0;

        book->x[s][k % 2U] = x_bar;
        for (size_t i = 0U; i < 2U; i++) {
            book->x[s][k % 2U] += 0.25 * (book->y[k % 2U][member[s][i]] - x_bar);
        }
    }
    for (size_t i = 0U; (k > 0U) && (i < BANK_PAIRS); i++) {
        const size_t j   = member[i / 2U][i % 2U];
        const double x_i = (0.6 * book->y[(k - 1U) % 2U][j]) + (0.8 * (book->y[k % 2U][j] - 1.0));
        const double rho = x_i - book->x[i / 2U][(k - 1U) % 2U];

        book->average[i] = fmin(book->average[i] + (0.5 * ((rho * rho) - book->average[i])), 2.25);
    }
}

static void test_step_given_random_data_follows_the_textbook_whatever_the_reference(void)
{
    static textbook_t book;
    const double      tol   = 1.0e4 * (double)BLW_REAL_EPS;
    uint32_t          state = 1U;
    unsigned          moves = 0U;

    memset(&book, 0, sizeof book);
    for (size_t i = 0U; i < BANK_PAIRS; i++) {
        book.average[i] = 0.5;
    }
    for (size_t k = 0U; k < STEPS; k++) {
        for (size_t i = 0U; i < 3U; i++) {
            state             = (state * 1664525U) + 1013904223U;
            book.y[k % 2U][i] = 2.0 + (((double)(state >> 8) / 16777216.0) - 0.5);
            book.y[k % 2U][i] += (((k / 50U) % 4U) == (i + 1U)) ? 5.0 : 0.0;
        }
        const uint8_t last = bank.choice;
        textbook_step(&book, k);
        step_with(0.0, book.y[k % 2U][0], book.y[k % 2U][1], book.y[k % 2U][2], 7U);
        moves += (bank.choice != last) ? 1U : 0U;
        TEST_ASSERT_REAL_WITHIN(tol, book.x[bank.choice][k % 2U], out.x_hat[0]);
        for (size_t i = 0U; i < BANK_PAIRS; i++) {
            TEST_ASSERT_REAL_WITHIN(tol, book.average[i], bank.average[i]);
        }
    }
    TEST_ASSERT_TRUE(moves >= 6U);
}

static double uniform(uint32_t *state)
{
    *state = (*state * 1664525U) + 1013904223U;
    return ((double)(*state >> 8) / 16777216.0) - 0.5;
}

static void test_step_given_a_million_steps_with_huge_spikes_neither_drifts_nor_locks(void)
{
    uint32_t state = 7U;
    double   x     = 0.0;

    for (size_t k = 0U; k < SUPPORT_LONG_RUN; k++) {
        const bool   spike = (k % 1000U) == 999U;
        const size_t hit   = (k / 1000U) % 3U;
        double       e[3];

        x = (0.5 * x) + 1.0 + (0.1 * uniform(&state));
        for (size_t i = 0U; i < 3U; i++) {
            e[i] = (0.5 * uniform(&state)) + ((spike && (i == hit)) ? 1.5e5 : 0.0);
        }
        step_with(x, e[0], e[1], e[2], 7U);
        TEST_ASSERT_REAL_WITHIN(1.0, x, out.x_hat[0]);
        if (spike) {
            TEST_ASSERT_EQUAL_HEX64((blw_mask_t)1U << hit, out.excluded);
        } else if ((k % 1000U) >= 100U) {
            TEST_ASSERT_TRUE(out.statistic <= BLW_R(1.0));
        }
    }
    for (size_t i = 0U; i < 200U; i++) {
        step_with(x = (0.5 * x) + 1.0, 0.0, 0.0, 0.0, 7U);
    }
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, out.statistic);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, x, out.x_hat[0]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_step_given_an_attacked_sensor_yields_hand_computed_decision);
    RUN_TEST(test_step_given_prediction_version_returns_estimates_without_the_newest_sample);
    RUN_TEST(test_step_given_a_gross_sample_changes_the_set_at_once);
    RUN_TEST(test_step_given_a_gross_sample_keeps_its_sets_out_for_a_block);
    RUN_TEST(test_step_given_no_passing_set_leaves_a_choice_that_the_gate_rejects);
    RUN_TEST(test_step_given_no_passing_set_holds_the_last_choice);
    RUN_TEST(test_step_given_a_gap_prefers_complete_sets_and_waits_for_complete_blocks);
    RUN_TEST(test_step_given_seldom_samples_judges_a_block_by_those_it_has);
    RUN_TEST(test_step_given_seldom_samples_leaves_a_sensor_out_after_the_gap_only);
    RUN_TEST(test_step_given_no_sample_predicts_and_says_so);
    RUN_TEST(test_step_given_a_window_decides_at_its_end_with_fresh_sums);
    RUN_TEST(test_step_given_random_data_follows_the_textbook_whatever_the_reference);
    RUN_TEST(test_step_given_a_million_steps_with_huge_spikes_neither_drifts_nor_locks);
    return UNITY_END();
}
