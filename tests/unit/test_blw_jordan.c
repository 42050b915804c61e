/* SPDX-License-Identifier: MIT */
#include <string.h>
#include "support.h"

#define R_MAX 5U
#define M     2U
#define L     2U
#define N_X   3U /* states of the plant: only G depends on them */

static blw_real_t J0[R_MAX];
static blw_real_t J1[R_MAX];
static blw_real_t J2[R_MAX];
static blw_real_t Jm[R_MAX];
static blw_real_t b[M * R_MAX];
static blw_real_t D[M * R_MAX * L];
static blw_real_t G[M * R_MAX * N_X];

static const blw_plant_t  plant = {.n = N_X, .m = M, .l = L};
static blw_jordan_model_t model;
static blw_table_check_t  check;

/* Quarters between -3 and 3, never 0: exact in float, so that results can be compared exactly. */
static blw_real_t some_number(size_t i)
{
    const int quarters = (int)((i * 7U) % 25U) - 12;

    return (quarters == 0) ? BLW_R(0.75) : ((blw_real_t)quarters * BLW_R(0.25));
}

static void fill(blw_real_t *table, size_t len, size_t seed)
{
    for (size_t i = 0U; i < len; i++) {
        table[i] = some_number(i + seed);
    }
}

static void make(size_t r)
{
    model = (blw_jordan_model_t){.r  = (uint8_t)r,
                                 .m  = M,
                                 .l  = L,
                                 .J0 = J0,
                                 .J1 = J1,
                                 .J2 = J2,
                                 .Jm = Jm,
                                 .b  = b,
                                 .D  = D,
                                 .G  = G};
    fill(J0, r, 1U);
    fill(J1, r, 2U);
    fill(J2, r, 3U);
    fill(Jm, r, 4U);
    fill(b, M * r, 5U);
    fill(D, M * r * L, 6U);
    fill(G, M * r * N_X, 8U);
    J1[r - 1U]                    = BLW_R(0.0);
    J2[r - 1U]                    = BLW_R(0.0);
    J2[(r >= 2U) ? (r - 2U) : 0U] = BLW_R(0.0);
    Jm[0]                         = BLW_R(0.0);
}

void setUp(void)
{
    make(R_MAX);
    blw_table_begin(&check);
}

void tearDown(void) {}

/* (1) by the definition of J, dense. */
static double expected_state(size_t i, size_t j, const blw_real_t *u, blw_real_t y,
                             const blw_real_t *zeta_i)
{
    const size_t r   = model.r;
    double       sum = (double)b[(i * r) + j] * (double)y;

    for (size_t k = 0U; k < r; k++) {
        const blw_real_t J = (k == j)          ? J0[j]
                             : (k == (j + 1U)) ? J1[j]
                             : (k == (j + 2U)) ? J2[j]
                             : ((k + 1U) == j) ? Jm[j]
                                               : BLW_R(0.0);
        sum += (double)J * (double)zeta_i[k];
    }
    for (size_t k = 0U; (u != NULL) && (k < L); k++) {
        sum += (double)D[(((i * r) + j) * L) + k] * (double)u[k];
    }
    return sum;
}

static void test_step_given_every_order_yields_the_dense_product(void)
{
    static const blw_real_t u[L] = {BLW_R(2.0), BLW_R(-0.5)};
    static const blw_real_t y[M] = {BLW_R(1.5), BLW_R(-4.0)};
    blw_real_t              zeta[M * R_MAX];
    blw_real_t              before[M * R_MAX];

    for (size_t r = 1U; r <= R_MAX; r++) {
        for (size_t with_u = 0U; with_u < 2U; with_u++) {
            const blw_real_t *const input = (with_u == 1U) ? u : NULL;

            make(r);
            fill(zeta, M * r, 9U);
            memcpy(before, zeta, sizeof before);
            blw_jordan_step(&model, input, y, zeta);
            for (size_t row = 0U; row < (M * r); row++) {
                const size_t i = row / r;
                TEST_ASSERT_REAL_WITHIN(
                    0.0, expected_state(i, row % r, input, y[i], &before[i * r]), zeta[row]);
            }
        }
    }
}

static void marking_kernel(const blw_real_t *u, const blw_real_t *y, blw_real_t *zeta)
{
    zeta[0] = (u != NULL) ? u[0] : y[0];
}

static void test_step_given_a_kernel_leaves_all_to_it(void)
{
    const blw_real_t u[L] = {BLW_R(2.0), BLW_R(-0.5)};
    const blw_real_t y[M] = {BLW_R(1.5), BLW_R(-4.0)};
    blw_real_t       zeta[M * R_MAX];

    model.step = marking_kernel;
    fill(zeta, M * R_MAX, 9U);
    blw_jordan_step(&model, u, y, zeta);
    TEST_ASSERT_REAL_WITHIN(0.0, 2.0, zeta[0]);
    blw_jordan_step(&model, NULL, y, zeta);
    TEST_ASSERT_REAL_WITHIN(0.0, 1.5, zeta[0]);
    TEST_ASSERT_REAL_WITHIN(0.0, some_number(10U), zeta[1]);
}

static void test_step_sensor_given_one_sensor_leaves_the_others_alone(void)
{
    blw_real_t       zeta[M * R_MAX];
    blw_real_t       all[M * R_MAX];
    const blw_real_t y[M] = {BLW_R(1.5), BLW_R(-4.0)};

    fill(zeta, M * R_MAX, 9U);
    memcpy(all, zeta, sizeof all);
    blw_jordan_step(&model, NULL, y, all);
    blw_jordan_step_sensor(&model, 1U, NULL, y[1], &zeta[R_MAX]);
    TEST_ASSERT_EQUAL_MEMORY(&all[R_MAX], &zeta[R_MAX], R_MAX * sizeof(blw_real_t));
    TEST_ASSERT_REAL_WITHIN(0.0, some_number(9U), zeta[0]);
}

static void test_reset_given_a_state_yields_its_image(void)
{
    const blw_real_t x0[N_X] = {BLW_R(1.0), BLW_R(-2.0), BLW_R(0.5)};
    blw_real_t       zeta[M * R_MAX];

    blw_jordan_reset(&model, N_X, x0, zeta);
    for (size_t row = 0U; row < (M * R_MAX); row++) {
        const blw_real_t *const g = &G[row * N_X];
        TEST_ASSERT_REAL_WITHIN(0.0, g[0] - (BLW_R(2.0) * g[1]) + (BLW_R(0.5) * g[2]), zeta[row]);
    }
}

static void test_check_given_sound_tables_adds_them_in_order_of_the_members(void)
{
    blw_table_check_t expected;

    blw_table_begin(&expected);
    blw_table_add(&expected, J0, R_MAX);
    blw_table_add(&expected, J1, R_MAX);
    blw_table_add(&expected, J2, R_MAX);
    blw_table_add(&expected, Jm, R_MAX);
    blw_table_add(&expected, b, M * R_MAX);
    blw_table_add(&expected, D, M * R_MAX * L);
    blw_table_add(&expected, G, M * R_MAX * N_X);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_jordan_check(&model, &plant, &check));
    TEST_ASSERT_EQUAL_HEX32(expected.crc, check.crc);
}

static void test_check_given_null_is_an_argument_error(void)
{
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_jordan_check(NULL, &plant, &check));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_jordan_check(&model, NULL, &check));
    TEST_ASSERT_EQUAL_INT(BLW_ERR_ARG, blw_jordan_check(&model, &plant, NULL));
}

static void assert_refused(void)
{
    blw_table_begin(&check);
    TEST_ASSERT_EQUAL_INT(BLW_ERR_MODEL, blw_jordan_check(&model, &plant, &check));
    make(R_MAX);
}

static void test_check_given_sizes_of_another_plant_refuses(void)
{
    model.r = 0U;
    assert_refused();
    model.m = M + 1U;
    assert_refused();
    model.l = L - 1U;
    assert_refused();
}

static void test_check_given_a_missing_table_refuses(void)
{
    const blw_real_t **const tables[7] = {&model.J0, &model.J1, &model.J2, &model.Jm,
                                          &model.b,  &model.D,  &model.G};

    for (size_t i = 0U; i < 7U; i++) {
        *tables[i] = NULL;
        assert_refused();
    }
}

static void test_check_given_entries_outside_j_refuses(void)
{
    blw_real_t *const outside[4] = {&J1[R_MAX - 1U], &J2[R_MAX - 1U], &J2[R_MAX - 2U], &Jm[0]};

    for (size_t i = 0U; i < 4U; i++) {
        *outside[i] = BLW_R(-0.5);
        assert_refused();
    }
    make(1U);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_jordan_check(&model, &plant, &check));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_step_given_every_order_yields_the_dense_product);
    RUN_TEST(test_step_given_a_kernel_leaves_all_to_it);
    RUN_TEST(test_step_sensor_given_one_sensor_leaves_the_others_alone);
    RUN_TEST(test_reset_given_a_state_yields_its_image);
    RUN_TEST(test_check_given_sound_tables_adds_them_in_order_of_the_members);
    RUN_TEST(test_check_given_null_is_an_argument_error);
    RUN_TEST(test_check_given_sizes_of_another_plant_refuses);
    RUN_TEST(test_check_given_a_missing_table_refuses);
    RUN_TEST(test_check_given_entries_outside_j_refuses);
    return UNITY_END();
}
