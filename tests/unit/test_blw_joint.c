/* SPDX-License-Identifier: MIT */
#include <string.h>
#include "joint_model.h"

#define TOL_RECURSIVE ((sizeof(blw_real_t) == 8U) ? 1e-11 : 2e-5)

static const blw_real_t u[1] = {BLW_R(1.0)};
static const blw_real_t y[3] = {BLW_R(10.0), BLW_R(8.0), BLW_R(6.0)};

static blw_real_t          mem[MEM];
static blw_joint_t         filter;
static blw_estimator_out_t out;

static void start(bool own_gains)
{
    make(own_gains);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_init(&filter, &model, mem, MEM));
}

void setUp(void)
{
    start(false);
}

void tearDown(void) {}

static void step(const blw_real_t *input, const blw_real_t *samples, blw_mask_t valid)
{
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_step(&filter, input, samples, valid, &out));
}

static blw_joint_attack_t attack_on(size_t sensor)
{
    blw_joint_attack_t attack = {.heard = false};

    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_get_attack(&filter, sensor, &attack));
    return attack;
}

/* x_hat, theta and sd of sensors 0 and 1 */
static void assert_estimates(double tolerance, const blw_real_t expected[5])
{
    TEST_ASSERT_REAL_WITHIN(tolerance, expected[0], out.x_hat[0]);
    for (size_t sensor = 0U; sensor < 2U; sensor++) {
        const blw_joint_attack_t attack = attack_on(sensor);
        TEST_ASSERT_REAL_WITHIN(tolerance, expected[1U + sensor], attack.theta);
        TEST_ASSERT_REAL_WITHIN(tolerance, expected[3U + sensor], attack.sd);
    }
}

static void test_step_given_a_schedule_yields_hand_computed_estimates(void)
{
    const blw_real_t at_1[5] = {BLW_R(4.875), BLW_R(3.0), BLW_R(3.0), BLW_R(1.0), BLW_R(2.0)};
    const blw_real_t at_2[5] = {BLW_R(2.765625), BLW_R(4.5), BLW_R(3.75), BLW_R(3.0), BLW_R(0.25)};

    TEST_ASSERT_REAL_WITHIN(0.0, 3.0, attack_on(0U).sd);
    step(u, y, 7U);
    assert_estimates(SUPPORT_TOL, at_1);
    TEST_ASSERT_TRUE(attack_on(0U).heard);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.25, out.statistic); /* (3/2)^2 */
    TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.threshold);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.36, out.suspicion[1]); /* 9/16 : 25/16 */
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, out.suspicion[2]);
    TEST_ASSERT_EQUAL_INT(BLW_OUTCOME_CONVERGED, out.outcome);
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_WARMING_UP, out.flags);
    step(NULL, y, 6U); /* sensor 0 is missing, and so is its innovation */
    assert_estimates(SUPPORT_TOL, at_2);
    TEST_ASSERT_FALSE(attack_on(0U).heard);
    TEST_ASSERT_TRUE(attack_on(1U).heard);
    TEST_ASSERT_REAL_WITHIN(0.0, 1.0, out.suspicion[0]);
    TEST_ASSERT_EQUAL_HEX8(BLW_FLAG_MISSING, out.flags);
    TEST_ASSERT_EQUAL_HEX64(0U, out.excluded);
}

static void test_step_given_the_recursion_yields_the_estimates_of_numpy(void)
{
    static const blw_real_t expected[5][5] = {
        {BLW_R(3.4236292923380667), BLW_R(5.3304239401496263), BLW_R(2.8536860110976674),
         BLW_R(0.33405988980280521), BLW_R(0.44168463697127036)},
        {BLW_R(3.4600411950484715), BLW_R(10.660847880299253), BLW_R(0.58402874191331389),
         BLW_R(2.1339203265585507), BLW_R(0.43549995909876144)},
        {BLW_R(3.4037626193955499), BLW_R(2.9196009288450622), BLW_R(3.5770773098110151),
         BLW_R(0.33693807052703223), BLW_R(0.3499234981013401)},
        {BLW_R(2.1239799443498448), BLW_R(1.5446216873248237), BLW_R(0.38651343400878702),
         BLW_R(0.54282398870314275), BLW_R(0.58639403601812479)},
        {BLW_R(2.243051460866337), BLW_R(-1.025809984431892), BLW_R(0.33803873132922213),
         BLW_R(0.3535020055099784), BLW_R(0.73823986693330845)},
    };
    static const blw_real_t A[1]   = {BLW_R(0.8)};
    static const blw_real_t C[3]   = {BLW_R(1.0), BLW_R(2.0), BLW_R(1.0)};
    static const blw_real_t y_2[3] = {BLW_R(3.0), BLW_R(6.0), BLW_R(7.0)};
    static const blw_real_t y_3[3] = {BLW_R(5.0), BLW_R(9.0), BLW_R(4.0)};
    static const blw_real_t y_4[3] = {BLW_R(4.0), BLW_R(5.0), BLW_R(6.0)};
    static const blw_real_t y_5[3] = {BLW_R(2.0), BLW_R(7.0), BLW_R(5.0)};

    start(true);
    step(u, y, 7U);
    assert_estimates(TOL_RECURSIVE, expected[0]);
    step(u, y_2, 6U);
    assert_estimates(TOL_RECURSIVE, expected[1]);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_set_strong(&filter, 5U));
    step(NULL, y_3, 7U);
    assert_estimates(TOL_RECURSIVE, expected[2]);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_set_strong(&filter, 0U));
    step(u, y_4, 7U);
    assert_estimates(TOL_RECURSIVE, expected[3]);
    TEST_ASSERT_EQUAL_HEX64(4U, out.excluded);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_set_strong(&filter, 4U));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_set_plant(&filter, A, NULL, C));
    step(u, y_5, 7U);
    assert_estimates(TOL_RECURSIVE, expected[4]);
}

/* Moving x_hat by -1 and all remainders by +1 leaves the local estimates where they are, so that
 * the fused one must stay, too, if the weights sum to 1. */
static void test_step_given_any_mask_uses_weights_that_sum_to_one(void)
{
    static blw_real_t saved[MEM];

    start(true);
    for (size_t k = 0U; k < 300U; k++) {
        const blw_mask_t valid = (blw_mask_t)((k / 3U) % 8U);
        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_set_strong(&filter, (blw_mask_t)(k % 8U)));
        const blw_joint_t before = filter;
        memcpy(saved, mem, sizeof mem);
        step(u, y, valid);
        const blw_real_t x_hat = out.x_hat[0];
        TEST_ASSERT_TRUE((x_hat < BLW_R(100.0)) && (x_hat > BLW_R(-100.0)));
        filter = before;
        memcpy(mem, saved, sizeof mem);
        filter.x_hat[0] -= BLW_R(1.0);
        filter.delta[0] += BLW_R(1.0);
        filter.delta[1] += BLW_R(1.0);
        step(u, y, valid);
        TEST_ASSERT_REAL_WITHIN(32.0 * SUPPORT_TOL, x_hat, out.x_hat[0]);
    }
}

static void test_step_given_identical_estimators_fuses_to_them(void)
{
    start(true);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_set_strong(&filter, 4U));
    for (size_t k = 0U; k < 50U; k++) { /* no weak sample is ever there: the two are the same */
        step(u, y, 4U);
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, filter.delta[0]);
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, filter.delta[1]);
    }
    TEST_ASSERT_TRUE(out.x_hat[0] > BLW_R(2.0));
    TEST_ASSERT_TRUE(out.x_hat[0] < BLW_R(3.0)); /* y_2 - offset_2 = 3, A x + u = 2 at x = 2 */
}

static void test_step_given_three_estimators_that_agree_fuses_to_them(void)
{
    static const uint16_t   first[4]   = {0U, 2U, 4U, 6U};
    static const uint16_t   sensor[6]  = {0U, 2U, 1U, 2U, 2U, 0U};
    static const blw_real_t three[3]   = {BLW_R(1.0), BLW_R(2.0), BLW_R(3.0)};
    static const blw_real_t perfect[3] = {BLW_R(3.0), BLW_R(4.0), BLW_R(5.0)}; /* x = 2 */
    static blw_real_t       room[BLW_JOINT_MEM(1, 3, 3, 1)];

    make(true);
    model.r            = 3U;
    model.first        = first;
    model.sensor       = sensor;
    model.scale        = three;
    recursive.theta_sd = three;
    seal();
    TEST_ASSERT_EQUAL_INT(BLW_OK,
                          blw_joint_init(&filter, &model, room, sizeof room / sizeof *room));
    for (size_t k = 0U; k < 100U; k++) {
        step(u, perfect, 7U);
    }
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.0, out.x_hat[0]);
    for (size_t i = 0U; i < 3U; i++) {
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 0.0, attack_on(i).theta);
    }
}

static void test_step_given_one_estimator_needs_no_weights(void)
{
    schedule.G = NULL;
    model.r    = 1U;
    seal();
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_init(&filter, &model, mem, MEM));
    step(u, y, 7U);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 6.0, out.x_hat[0]); /* 3 + 6/2 */
    TEST_ASSERT_EQUAL_HEX64(2U, out.excluded);
}

static void test_step_given_more_steps_than_it_can_count_goes_on(void)
{
    for (size_t k = 0U; k < 70000U; k++) {
        step(u, y, 0U);
    }
    TEST_ASSERT_EQUAL_HEX8(0U, out.flags & (unsigned)BLW_FLAG_WARMING_UP);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 2.0, out.x_hat[0]);
}

static void test_step_given_no_sample_predicts_and_says_so(void)
{
    for (size_t own = 0U; own < 2U; own++) {
        start(own == 1U);
        step(u, y, 0U);
        TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 3.0, out.x_hat[0]);
        TEST_ASSERT_EQUAL_HEX8(
            BLW_FLAG_MISSING | BLW_FLAG_DEGRADED | BLW_FLAG_BLIND | BLW_FLAG_WARMING_UP, out.flags);
        TEST_ASSERT_REAL_WITHIN(0.0, 0.0, out.statistic);
    }
}

static void test_step_given_samples_that_overflow_starts_again_from_the_prediction(void)
{
    const blw_real_t far[3] = {BLW_SIGNAL_MAX, y[1], y[2]};

    for (size_t row = 0U; row < 3U; row++) { /* x, theta or phi of the first estimator */
        blw_real_t huge[24] = {BLW_R(0.0)};
        huge[2U * row]      = BLW_SIGNAL_MAX;
        make(false);
        schedule.K = huge;
        seal();
        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_init(&filter, &model, mem, MEM));
        step(u, far, 7U);
        TEST_ASSERT_REAL_WITHIN(0.0, 3.0, out.x_hat[0]);
        TEST_ASSERT_EQUAL_HEX64(0U, out.used);
        TEST_ASSERT_REAL_WITHIN(0.0, 0.0, attack_on(0U).theta);
    }
}

static void test_step_given_an_unstable_plant_recovers_after_any_time_without_samples(void)
{
    const blw_real_t A[1]    = {BLW_R(2.0)};
    const blw_real_t zero[3] = {BLW_R(1.0), BLW_R(2.0), BLW_R(3.0)}; /* the offsets: x = 0 */

    start(true);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_set_plant(&filter, A, NULL, NULL));
    for (size_t k = 0U; k < 1200U; k++) {
        step(NULL, zero, 0U);
        TEST_ASSERT_TRUE(out.x_hat[0] <= BLW_SIGNAL_MAX);
        TEST_ASSERT_TRUE(attack_on(0U).sd <= BLW_SIGNAL_MAX);
    }
    for (size_t k = 0U; k < 300U; k++) {
        step(NULL, zero, 7U);
    }
    TEST_ASSERT_REAL_WITHIN(1e-3, 0.0, out.x_hat[0]);
}

static void test_step_given_wrong_arguments_leaves_state_and_out_untouched(void)
{
    const blw_real_t bad_u[1] = {support_nan};

    step(u, y, 7U);
    const blw_estimator_out_t before = out;
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_step(NULL, u, y, 7U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_step(&filter, u, NULL, 7U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_step(&filter, u, y, 8U, &out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_step(&filter, u, y, 7U, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_INPUT, blw_joint_step(&filter, bad_u, y, 7U, &out));
    TEST_ASSERT_EQUAL_MEMORY(&before, &out, sizeof out);
    TEST_ASSERT_REAL_WITHIN(SUPPORT_TOL, 4.875, out.x_hat[0]);
}

static void test_accessors_given_wrong_arguments_refuse(void)
{
    const blw_real_t   bad[3] = {support_nan, BLW_R(0.0), BLW_R(0.0)};
    blw_joint_attack_t attack;

    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_get_attack(NULL, 0U, &attack));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_get_attack(&filter, 0U, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_get_attack(&filter, 2U, &attack));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_set_strong(NULL, 4U));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_set_strong(&filter, 4U)); /* a schedule */
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_set_plant(NULL, NULL, NULL, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_set_plant(&filter, NULL, NULL, NULL));
    start(true);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_set_strong(&filter, 8U));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_set_plant(&filter, bad, NULL, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_set_plant(&filter, NULL, bad, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_set_plant(&filter, NULL, NULL, bad));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_set_plant(&filter, NULL, u, NULL));
}

static void test_reset_given_a_start_takes_it_and_forgets_the_rest(void)
{
    const blw_real_t begin[1] = {BLW_R(10.0)};
    const blw_real_t bad[1]   = {support_inf};

    step(u, y, 7U);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_reset(&filter, begin));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_reset(&filter, bad));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_joint_reset(NULL, begin));
    step(NULL, y, 0U);
    TEST_ASSERT_REAL_WITHIN(0.0, 5.0, out.x_hat[0]);
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, attack_on(0U).theta);
}

static void test_ops_given_the_same_data_yield_the_same_bits(void)
{
    static blw_real_t                other_mem[MEM];
    static blw_joint_t               other;
    blw_estimator_t *const           base = &other.base;
    blw_estimator_out_t              other_out;
    const blw_estimator_ops_t *const ops = &blw_joint_ops;

    start(true);
    TEST_ASSERT_EQUAL_INT(BLW_METHOD_JOINT, ops->method);
    TEST_ASSERT_EQUAL_size_t(sizeof(blw_joint_t), ops->state_size);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_init(base, ops, &model.head, other_mem, MEM));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_reset(base, NULL));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_step(base, u, y, 7U, &other_out));
    step(u, y, 7U);
    TEST_ASSERT_EQUAL_MEMORY(out.x_hat, other_out.x_hat, sizeof(blw_real_t));
    TEST_ASSERT_EQUAL_size_t(MEM, ops->mem_len(&model.head));
    TEST_ASSERT_EQUAL_size_t(0U, ops->mem_len(NULL));
    model.head.method = (uint8_t)BLW_METHOD_GUARD;
    TEST_ASSERT_EQUAL_size_t(0U, ops->mem_len(&model.head));
    make(false);
    TEST_ASSERT_EQUAL_size_t(BLW_JOINT_MEM(1, 3, 2, 0), ops->mem_len(&model.head));
    model.head.plant = NULL;
    TEST_ASSERT_EQUAL_size_t(0U, ops->mem_len(&model.head));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_step_given_a_schedule_yields_hand_computed_estimates);
    RUN_TEST(test_step_given_the_recursion_yields_the_estimates_of_numpy);
    RUN_TEST(test_step_given_any_mask_uses_weights_that_sum_to_one);
    RUN_TEST(test_step_given_identical_estimators_fuses_to_them);
    RUN_TEST(test_step_given_three_estimators_that_agree_fuses_to_them);
    RUN_TEST(test_step_given_one_estimator_needs_no_weights);
    RUN_TEST(test_step_given_more_steps_than_it_can_count_goes_on);
    RUN_TEST(test_step_given_no_sample_predicts_and_says_so);
    RUN_TEST(test_step_given_samples_that_overflow_starts_again_from_the_prediction);
    RUN_TEST(test_step_given_an_unstable_plant_recovers_after_any_time_without_samples);
    RUN_TEST(test_step_given_wrong_arguments_leaves_state_and_out_untouched);
    RUN_TEST(test_accessors_given_wrong_arguments_refuse);
    RUN_TEST(test_reset_given_a_start_takes_it_and_forgets_the_rest);
    RUN_TEST(test_ops_given_the_same_data_yield_the_same_bits);
    return UNITY_END();
}
