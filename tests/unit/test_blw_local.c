/* SPDX-License-Identifier: MIT */
/* Local filters on their sensors and a fusion node yield the bits of the central estimator. */
#include "blw/blw_local.h"
#include <string.h>
#include "pendulum_physical_model.h"
#include "support.h"

#define N        PENDULUM_PHYSICAL_N
#define M        PENDULUM_PHYSICAL_M
#define MEM      BLW_PENDULUM_PHYSICAL_CANONICAL_MEM
#define R        4U
#define STEPS    2000U
#define ATTACKED 3U

static const blw_lasso_model_t *const model = &blw_pendulum_physical_canonical;

static blw_lasso_t         central;
static blw_real_t          central_mem[MEM];
static blw_lasso_t         fusion;
static blw_real_t          fusion_mem[MEM];
static blw_local_t         local[M];
static blw_real_t          local_mem[M][BLW_LOCAL_MEM(N, R)];
static blw_estimator_out_t out;
static blw_estimator_out_t split_out;
static uint32_t            seed;

void setUp(void)
{
    TEST_ASSERT_EQUAL_UINT(R, model->jordan->r);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_init(&central, model, central_mem, MEM));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_init(&fusion.base, &blw_lasso_fusion_ops,
                                                     &model->head, fusion_mem, MEM));
    for (uint8_t i = 0U; i < M; i++) {
        TEST_ASSERT_EQUAL_INT(
            BLW_OK, blw_local_init(&local[i], model, i, local_mem[i], BLW_LOCAL_MEM(N, R)));
    }
    seed = 1U;
}

void tearDown(void) {}

/* In [-1, 1), the same everywhere. */
static blw_real_t noise(void)
{
    seed = (1664525U * seed) + 1013904223U;
    return (blw_real_t)((int32_t)(seed >> 8) - 8388608) / BLW_R(8388608.0);
}

/* One step of everybody; what is not in valid is not sampled. */
static void step(const blw_real_t *u, const blw_real_t *y, blw_mask_t valid)
{
    blw_real_t zeta[M * R];
    blw_mask_t sent = 0U;

    for (size_t i = 0U; i < M; i++) {
        if (blw_local_step(&local[i], u, y[i], ((valid >> i) & 1U) != 0U)) {
            sent |= (blw_mask_t)1U << i;
        }
        (void)memcpy(&zeta[i * R], local[i].zeta, sizeof(blw_real_t) * R);
    }
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_step(&central, u, y, valid, &out));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_estimator_step(&fusion.base, u, zeta, sent, &split_out));
    for (size_t i = 0U; i < M; i++) {
        TEST_ASSERT_EQUAL_INT(BLW_OK, blw_local_correct(&local[i], split_out.x_hat));
    }
}

static void assert_same(void)
{
    TEST_ASSERT_EQUAL_MEMORY(out.x_hat, split_out.x_hat, sizeof(blw_real_t) * N);
    TEST_ASSERT_EQUAL_MEMORY(out.suspicion, split_out.suspicion, sizeof(blw_real_t) * M);
    TEST_ASSERT_EQUAL_MEMORY(&out.statistic, &split_out.statistic, sizeof out.statistic);
    TEST_ASSERT_EQUAL_HEX64(out.used, split_out.used);
    TEST_ASSERT_EQUAL_HEX8(out.flags, split_out.flags);
    TEST_ASSERT_EQUAL_UINT(out.iterations, split_out.iterations);
}

static void test_split_given_attacks_and_gaps_yields_the_bits_of_the_central_estimator(void)
{
    for (size_t k = 1U; k <= STEPS; k++) {
        const blw_real_t u[1]  = {noise()};
        blw_real_t       y[M]  = {noise(), noise(), noise(), noise()};
        blw_mask_t       valid = BLW_MASK_ALL(M);

        if ((k % 100U) > 60U) {
            y[ATTACKED] += BLW_R(30.0) * noise();
        }
        if ((k % 7U) == 0U) {
            valid &= ~((blw_mask_t)1U << (k % M));
        }
        if ((k % 50U) == 0U) {
            y[1] = (blw_real_t)support_nan;
        }
        step(u, y, valid);
        assert_same();
    }
}

static void test_split_given_samples_that_overflow_yields_the_same_bits(void)
{
    for (size_t k = 1U; k <= 20U; k++) {
        const blw_real_t u[1] = {BLW_R(0.0)};
        const blw_real_t y[M] = {BLW_R(9e6) * noise(), BLW_R(9e6), noise(), BLW_R(-9e6)};

        step(u, y, BLW_MASK_ALL(M));
        assert_same();
    }
}

static void test_fuse_given_a_filter_that_is_no_number_starts_it_again(void)
{
    blw_real_t zeta[M * R] = {BLW_R(0.0)};

    zeta[R] = (blw_real_t)support_nan;
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_fuse(&fusion, NULL, zeta, 15U, &split_out));
    TEST_ASSERT_EQUAL_HEX64(13U, split_out.used);
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, split_out.x_hat[0]);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_lasso_fuse(NULL, NULL, zeta, 15U, &split_out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_lasso_fuse(&fusion, NULL, NULL, 15U, &split_out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_lasso_fuse(&fusion, NULL, zeta, 16U, &split_out));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_lasso_fuse(&fusion, NULL, zeta, 15U, NULL));
}

static void test_init_given_wrong_arguments_refuses_with_nothing_changed(void)
{
    support_lasso_t   made;
    const blw_local_t before = local[0];
    blw_real_t *const mem    = local_mem[0];
    const size_t      len    = BLW_LOCAL_MEM(N, R);

    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_local_init(NULL, model, 0U, mem, len));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_local_init(&local[0], NULL, 0U, mem, len));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_local_init(&local[0], model, 0U, NULL, len));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_local_init(&local[0], model, M, mem, len));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MEM, blw_local_init(&local[0], model, 0U, mem, len - 1U));
    support_lasso_make(&made, BLW_METHOD_LASSO);
    made.model.head.crc ^= 1U;
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, blw_local_init(&local[0], &made.model, 0U, mem, len));
    TEST_ASSERT_EQUAL_MEMORY(&before, &local[0], sizeof before);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, blw_estimator_init(&fusion.base, &blw_lasso_fusion_ops,
                                                            &made.model.head, fusion_mem, MEM));
}

static void test_correct_given_what_is_not_finite_refuses(void)
{
    const blw_real_t bad[N] = {(blw_real_t)support_nan};

    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_local_correct(&local[0], bad));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_local_reset(&local[0], bad));
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_local_reset(&local[0], model->head.plant->x0));
}

static void test_step_given_a_filter_thrown_out_of_bounds_starts_it_again(void)
{
    support_lasso_t  made;
    blw_real_t       mem[BLW_LOCAL_MEM(1, 1)];
    blw_local_t      filter;
    const blw_real_t b[3] = {BLW_SIGNAL_MAX, BLW_R(1.0), BLW_R(1.0)};

    support_lasso_make(&made, BLW_METHOD_LASSO);
    made.jordan.b = b;
    support_lasso_seal(&made);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_local_init(&filter, &made.model, 0U, mem, 4U));
    TEST_ASSERT_FALSE(blw_local_step(&filter, NULL, BLW_R(100.0), true));
    TEST_ASSERT_REAL_WITHIN(0.0, 0.0, filter.zeta[0]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_split_given_attacks_and_gaps_yields_the_bits_of_the_central_estimator);
    RUN_TEST(test_split_given_samples_that_overflow_yields_the_same_bits);
    RUN_TEST(test_fuse_given_a_filter_that_is_no_number_starts_it_again);
    RUN_TEST(test_init_given_wrong_arguments_refuses_with_nothing_changed);
    RUN_TEST(test_correct_given_what_is_not_finite_refuses);
    RUN_TEST(test_step_given_a_filter_thrown_out_of_bounds_starts_it_again);
    return UNITY_END();
}
