/* SPDX-License-Identifier: MIT */
/** @file guard_model.h  A hand-made model of `guard` for the plant of support.h.
 *
 *  One local state per sensor with Lam = 1/4, b = s, s = sqrt(2/3), all modes secure: Gu_i = 2 s,
 *  Fu_i = 1 / (6 s), and S = I - 1 1'/3 in coordinates with S_ii = 1, so S_ij = -1/2.  With the
 *  innovations v about x_bar:  e = s v,  l_i = 3/2 s (v_i - mean v),
 *  x_hat = x_bar + mean(tau) / 2 s.  k = 2, exclude = 3; the sensors are units of their own.
 */
#ifndef GUARD_MODEL_H
#define GUARD_MODEL_H
#include "blw/blw_guard.h"
#include "support.h"

#define GUARD_S    0.81649658092772603
#define GUARD_MOST 2U
#define GUARD_MEM  BLW_GUARD_MEM(1, 3, 1, GUARD_MOST)

typedef struct guard_made {
    support_kalman_t  kalman; /* its plant is used */
    blw_guard_model_t model;
} guard_made_t;

static const uint16_t   guard_unit[3] = {0U, 1U, 2U};
static const uint16_t   guard_rank[3] = {1U, 1U, 1U};
static const blw_real_t guard_Lam[3]  = {BLW_R(0.25), BLW_R(0.25), BLW_R(0.25)};
static const blw_real_t guard_b[3]    = {(blw_real_t)GUARD_S, (blw_real_t)GUARD_S,
                                         (blw_real_t)GUARD_S};
static const blw_real_t guard_S[3]    = {BLW_R(-0.5), BLW_R(-0.5), BLW_R(-0.5)};
static const blw_real_t guard_V[6]    = {BLW_R(1.0), BLW_R(1.0), BLW_R(1.0),
                                         BLW_R(1.0), BLW_R(1.0), BLW_R(1.0)};
static const blw_real_t guard_s[6]    = {BLW_R(0.75), BLW_R(0.75), BLW_R(0.75),
                                         BLW_R(0.75), BLW_R(0.75), BLW_R(0.75)};
static const blw_real_t guard_Fu[3]   = {(blw_real_t)(1.0 / (6.0 * GUARD_S)),
                                         (blw_real_t)(1.0 / (6.0 * GUARD_S)),
                                         (blw_real_t)(1.0 / (6.0 * GUARD_S))};
static const blw_real_t guard_Gu[3]   = {(blw_real_t)(2.0 * GUARD_S), (blw_real_t)(2.0 * GUARD_S),
                                         (blw_real_t)(2.0 * GUARD_S)};
static const blw_real_t guard_ones[3] = {BLW_R(1.0), BLW_R(1.0), BLW_R(1.0)};

/** Set head.crc to the sum of the tables as they are now. */
static inline void guard_seal(guard_made_t *made)
{
    const blw_guard_model_t *const model = &made->model;
    const size_t                   N     = (size_t)3U * model->r;
    const size_t                   n_s   = (size_t)(1U - model->n_u);
    blw_table_check_t              check;

    (void)blw_model_begin(&model->head, BLW_METHOD_GUARD, &check);
    blw_table_add(&check, model->Lam, N * model->r);
    blw_table_add(&check, model->b, N);
    blw_table_add(&check, model->S, 3U * model->r * model->r);
    blw_table_add(&check, model->V, (model->pairs != 0U) ? 6U : 0U);
    blw_table_add(&check, model->s, (model->pairs != 0U) ? 6U : 0U);
    blw_table_add(&check, model->Fu, model->n_u * N);
    blw_table_add(&check, model->Gu, model->n_u * N);
    blw_table_add(&check, model->Xs, n_s);
    blw_table_add(&check, model->Sig, n_s * N);
    blw_table_add(&check, model->effect, 3U);
    blw_table_add(&check, model->drift, 3U);
    blw_table_add_real(&check, model->k);
    blw_table_add_real(&check, model->exclude);
    blw_table_add_real(&check, model->gross);
    blw_table_add_real(&check, model->gain);
    blw_table_add_real(&check, model->kappa);
    blw_table_add_real(&check, model->omega);
    blw_table_add_real(&check, model->sigma);
    made->model.head.crc = check.crc;
}

static inline void guard_make(guard_made_t *made)
{
    support_kalman_make(&made->kalman);
    made->model = (blw_guard_model_t){
        .head        = {.abi    = BLW_MODEL_ABI,
                        .method = (uint8_t)BLW_METHOD_GUARD,
                        .plant  = &made->kalman.plant},
        .r           = 1U,
        .reach       = 1U,
        .n_u         = 1U,
        .n_units     = 3U,
        .most        = (uint8_t)GUARD_MOST,
        .pairs       = 1U,
        .solver      = &blw_guard_many_ops,
        .max_updates = 20U,
        .unit        = guard_unit,
        .rank        = guard_rank,
        .Lam         = guard_Lam,
        .b           = guard_b,
        .S           = guard_S,
        .V           = guard_V,
        .s           = guard_s,
        .Fu          = guard_Fu,
        .Gu          = guard_Gu,
        .effect      = guard_ones,
        .drift       = guard_ones,
        .k           = BLW_R(2.0),
        .exclude     = BLW_R(3.0),
        .gross       = BLW_R(128.0),
        .gain        = BLW_R(0.125),
        .kappa       = BLW_R(1.0),
        .omega       = BLW_R(1.0),
        .sigma       = BLW_R(0.0),
    };
    guard_seal(made);
}

#endif
