/* SPDX-License-Identifier: MIT */
#include "joint_model.h"

static blw_real_t  mem[MEM];
static blw_joint_t filter;

void setUp(void)
{
    make(false);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_joint_init(&filter, &model, mem, MEM));
}

void tearDown(void) {}

static void assert_init_refuses(blw_status_t expected, blw_joint_t *self,
                                const blw_joint_model_t *wanted, blw_real_t *memory, size_t len)
{
    const blw_joint_t before = filter;

    TEST_ASSERT_EQUAL_INT(expected, blw_joint_init(self, wanted, memory, len));
    TEST_ASSERT_EQUAL_MEMORY(&before, &filter, sizeof before);
}

/* Seal the broken model where it can be walked, then see it refused; afterwards it is whole. */
static void assert_model_refused(void)
{
    assert_init_refuses(BLW_ERR_MODEL, &filter, &model, mem, MEM);
    make(false);
}

static void assert_sealed_refused(void)
{
    seal();
    assert_model_refused();
}

static void test_init_given_null_or_little_memory_refuses(void)
{
    assert_init_refuses(BLW_ERR_ARG, NULL, &model, mem, MEM);
    assert_init_refuses(BLW_ERR_ARG, &filter, NULL, mem, MEM);
    assert_init_refuses(BLW_ERR_ARG, &filter, &model, NULL, MEM);
    assert_init_refuses(BLW_ERR_MEM, &filter, &model, mem, BLW_JOINT_MEM(1, 3, 2, 0) - 1U);
    make(true);
    assert_init_refuses(BLW_ERR_MEM, &filter, &model, mem, MEM - 1U);
}

static void test_init_given_a_bad_head_refuses(void)
{
    model.head.abi++;
    assert_model_refused();
    model.head.crc ^= 1U;
    assert_model_refused();
    model.schedule = NULL; /* no gains at all */
    assert_model_refused();
    model.recursive = &recursive; /* both kinds */
    assert_model_refused();
}

static void test_init_given_bad_sets_of_sensors_refuses(void)
{
    static const uint16_t no_sensor[4]  = {0U, 3U, 1U, 2U};
    static const uint16_t twice[4]      = {0U, 0U, 1U, 2U};
    static const uint16_t same_weak[4]  = {0U, 2U, 0U, 2U};
    static const uint16_t not_zero[3]   = {1U, 2U, 4U};
    static const uint16_t empty[3]      = {0U, 0U, 4U};
    static const uint16_t too_many[3]   = {0U, 4U, 4U};
    static const uint16_t no_flag[3]    = {0U, 2U, 1U};
    const uint16_t *const bad_sensor[3] = {no_sensor, twice, same_weak};
    const uint16_t *const bad_first[3]  = {not_zero, empty, too_many};

    for (size_t i = 0U; i < 3U; i++) {
        model.sensor = bad_sensor[i];
        assert_model_refused();
        model.first = bad_first[i];
        assert_model_refused();
    }
    model.strong = no_flag;
    assert_model_refused();
    model.r = 0U;
    assert_model_refused();
    model.r = 4U;
    assert_model_refused();
    model.first = NULL;
    assert_model_refused();
    model.sensor = NULL;
    assert_model_refused();
    model.strong = NULL;
    assert_model_refused();
}

static void test_init_given_bad_tables_refuses(void)
{
    static const blw_real_t zeros[24] = {BLW_R(0.0)};

    model.scale = NULL;
    assert_sealed_refused();
    model.scale = zeros;
    assert_sealed_refused();
    schedule.K = NULL;
    assert_sealed_refused();
    schedule.sd = zeros;
    assert_sealed_refused();
    schedule.sd_gap = zeros;
    assert_sealed_refused();
    schedule.steps = 0U;
    assert_sealed_refused();
}

static void test_init_given_bad_roots_refuses(void)
{
    static const blw_real_t flat[6]  = {BLW_R(0.2), BLW_R(0.0), BLW_R(0.0),
                                        BLW_R(0.1), BLW_R(0.0), BLW_R(0.4)};
    static const blw_real_t zeros[2] = {BLW_R(0.0)};

    make(true);
    recursive.E = flat; /* R is singular */
    assert_sealed_refused();
    make(true);
    recursive.theta_sd = zeros;
    assert_sealed_refused();
    make(true);
    recursive.V = NULL;
    assert_sealed_refused();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_init_given_null_or_little_memory_refuses);
    RUN_TEST(test_init_given_a_bad_head_refuses);
    RUN_TEST(test_init_given_bad_sets_of_sensors_refuses);
    RUN_TEST(test_init_given_bad_tables_refuses);
    RUN_TEST(test_init_given_bad_roots_refuses);
    return UNITY_END();
}
