/* SPDX-License-Identifier: MIT */
#include "blw_step.h"
#include "support.h"

static support_kalman_t made;

void setUp(void)
{
    support_kalman_make(&made);
}

void tearDown(void) {}

static void test_check_given_each_fault_names_it(void)
{
    const blw_real_t y[3] = {BLW_R(0.0), BLW_R(0.0), BLW_R(0.0)};
    const blw_real_t u[1] = {support_nan};

    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_step_check(&made.plant, NULL, y, 7U));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_step_check(&made.plant, NULL, NULL, 7U));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_step_check(&made.plant, NULL, y, 8U));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_INPUT, blw_step_check(&made.plant, u, y, 7U));
}

static void test_flags_given_sets_of_sensors_state_every_reservation(void)
{
    const unsigned missing  = BLW_FLAG_MISSING;
    const unsigned degraded = BLW_FLAG_DEGRADED;
    const unsigned blind    = BLW_FLAG_BLIND;

    /* m = 3, p = 1 */
    TEST_ASSERT_EQUAL_HEX8(0U, blw_step_flags(&made.plant, 7U, 0U));
    TEST_ASSERT_EQUAL_HEX8(0U, blw_step_flags(&made.plant, 7U, 1U));
    TEST_ASSERT_EQUAL_HEX8(missing, blw_step_flags(&made.plant, 6U, 0U));
    TEST_ASSERT_EQUAL_HEX8(missing, blw_step_flags(&made.plant, 6U, 1U));
    TEST_ASSERT_EQUAL_HEX8(missing | degraded, blw_step_flags(&made.plant, 6U, 2U));
    TEST_ASSERT_EQUAL_HEX8(degraded, blw_step_flags(&made.plant, 7U, 3U));
    TEST_ASSERT_EQUAL_HEX8(degraded | blind, blw_step_flags(&made.plant, 7U, 7U));
    TEST_ASSERT_EQUAL_HEX8(missing | degraded | blind, blw_step_flags(&made.plant, 0U, 0U));
}

static void test_suspicion_given_a_statistic_maps_it_to_0_to_1(void)
{
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, blw_step_suspicion(BLW_R(0.0)));
    TEST_ASSERT_REAL_WITHIN(0.0, 0.5, blw_step_suspicion(BLW_R(1.0)));
    TEST_ASSERT_REAL_WITHIN(0.0, 0.75, blw_step_suspicion(BLW_R(3.0)));
    TEST_ASSERT_REAL_WITHIN(0.0, 1.0, blw_step_suspicion(BLW_REAL_MAX));
    TEST_ASSERT_REAL_WITHIN(0.0, 1.0, blw_step_suspicion(support_inf));
    TEST_ASSERT_REAL_WITHIN(0.0, 1.0, blw_step_suspicion(support_nan));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_check_given_each_fault_names_it);
    RUN_TEST(test_flags_given_sets_of_sensors_state_every_reservation);
    RUN_TEST(test_suspicion_given_a_statistic_maps_it_to_0_to_1);
    return UNITY_END();
}
