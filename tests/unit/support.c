/* SPDX-License-Identifier: MIT */
#include "support.h"
#include <math.h>

volatile const blw_real_t support_nan = (blw_real_t)NAN;
volatile const blw_real_t support_inf = (blw_real_t)INFINITY;

static const blw_real_t A[1]      = {BLW_R(0.5)};
static const blw_real_t Bu[1]     = {BLW_R(1.0)};
static const blw_real_t C[3]      = {BLW_R(1.0), BLW_R(1.0), BLW_R(1.0)};
static const blw_real_t offset[3] = {BLW_R(1.0), BLW_R(2.0), BLW_R(3.0)};
static const blw_real_t y_min[3]  = {-BLW_REAL_MAX, BLW_R(-50.0), BLW_R(-50.0)};
static const blw_real_t y_max[3]  = {BLW_REAL_MAX, BLW_R(50.0), BLW_R(50.0)};
static const blw_real_t x0[1]     = {BLW_R(4.0)};
static const blw_real_t K[3]      = {BLW_R(1.0) / BLW_R(6.0), BLW_R(1.0) / BLW_R(6.0),
                                     BLW_R(1.0) / BLW_R(6.0)};

static const blw_real_t J[1]     = {BLW_R(0.25)};
static const blw_real_t none[1]  = {BLW_R(0.0)};
static const blw_real_t G[3]     = {BLW_R(2.0), BLW_R(2.0), BLW_R(2.0)};
static const blw_real_t P[3]     = {BLW_R(1.0), BLW_R(1.0), BLW_R(1.0)};
static const uint16_t   first[4] = {0U, 1U, 2U, 3U};
static const blw_real_t Z[5]     = {
        BLW_R(0.81649658092772603),  BLW_R(-0.40824829046386302), BLW_R(0.70710678118654752),
        BLW_R(-0.40824829046386302), BLW_R(-0.70710678118654752),
};

static const blw_plant_t plant_of_head = {
    .n      = 1U,
    .m      = 3U,
    .l      = 1U,
    .p      = 1U,
    .A      = A,
    .Bu     = Bu,
    .C      = C,
    .offset = offset,
    .y_min  = y_min,
    .y_max  = y_max,
    .x0     = x0,
};

void support_kalman_make(support_kalman_t *made)
{
    made->plant      = plant_of_head;
    made->model.head = (blw_model_t){
        .abi = BLW_MODEL_ABI, .method = (uint8_t)BLW_METHOD_KALMAN, .plant = &made->plant};
    made->model.K    = K;
    made->model.Acl  = NULL;
    made->model.Bcl  = NULL;
    made->model.step = NULL;
    support_kalman_seal(made);
}

void support_kalman_seal(support_kalman_t *made)
{
    blw_table_check_t check;

    (void)blw_model_begin(&made->model.head, BLW_METHOD_KALMAN, &check);
    blw_table_add(&check, made->model.K, (size_t)made->plant.n * made->plant.m);
    if (made->model.Acl != NULL) {
        blw_table_add(&check, made->model.Acl, (size_t)made->plant.n * made->plant.n);
        blw_table_add(&check, made->model.Bcl, (size_t)made->plant.n * made->plant.l);
    }
    made->model.head.crc = check.crc;
}

void support_lasso_make(support_lasso_t *made, blw_method_t method)
{
    made->plant  = plant_of_head;
    made->jordan = (blw_jordan_model_t){.r  = 1U,
                                        .m  = 3U,
                                        .l  = 1U,
                                        .J0 = J,
                                        .J1 = none,
                                        .J2 = none,
                                        .Jm = none,
                                        .b  = C,
                                        .D  = C,
                                        .G  = G};
    made->l1     = (blw_l1_model_t){.N              = 3U,
                                    .d              = 2U,
                                    .n_groups       = 3U,
                                    .max_iterations = 20U,
                                    .n              = 1U,
                                    .engine         = &blw_l1_active_set_ops,
                                    .first          = first,
                                    .Z              = Z,
                                    .F              = K,
                                    .c              = C,
                                    .kappa_G        = BLW_R(0.16666667),
                                    .kappa_W        = BLW_R(2.0)};
    made->model  = (blw_lasso_model_t){
         .head   = {.abi = BLW_MODEL_ABI, .method = (uint8_t)method, .plant = &made->plant},
         .jordan = &made->jordan,
         .l1     = &made->l1,
         .P      = (method == BLW_METHOD_CANONICAL) ? P : NULL};
    support_lasso_seal(made);
}

void support_lasso_seal(support_lasso_t *made)
{
    const blw_method_t method = (blw_method_t)made->model.head.method;
    blw_table_check_t  check;

    (void)blw_model_begin(&made->model.head, method, &check);
    (void)blw_jordan_check(&made->jordan, &made->plant, &check);
    (void)blw_l1_check(&made->l1, &check);
    if (made->model.P != NULL) {
        blw_table_add(&check, made->model.P, (size_t)made->l1.N * made->jordan.r);
    }
    made->model.head.crc = check.crc;
}
