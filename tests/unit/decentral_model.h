/* SPDX-License-Identifier: MIT */
/** @file decentral_model.h  A hand-made model of the method `decentral`.
 *
 *      x(k+1) = x(k)/2 + u(k),   y_i = x + offset_i,   i = 0..2,   offsets 1, 2, 3,   p = 1
 *
 *  Steady: F_i = 1/4, K_i = 1/2, P = I, so that x_hat - x_bar is the mean of delta, g = sum of
 *  (delta_i - mean)^2 with two degrees of freedom, and with sensor i left out both are those of the
 *  other two.  N = [2 -1 -1]/sqrt6, [0 1 -1]/sqrt2.  A set of two, {0, 1}, is no candidate.
 *  Recursive: W = 0, R = I, P0 = 1: after one step K_i = 1/5, P = 0.16 1 1' + 0.04 I.
 */
#ifndef DECENTRAL_MODEL_H
#define DECENTRAL_MODEL_H
#include "blw/blw_decentral.h"
#include "blw_decentral_internal.h"
#include "blw_la.h"
#include "support.h"

#define DECENTRAL_THR     BLW_R(9.0) /* of all sensors */
#define DECENTRAL_THR_ONE BLW_R(4.0) /* with one sensor left out */
#define DECENTRAL_READMIT 3U

/** A writable copy of the model, so that a test can break any part. */
typedef struct decentral_made {
    blw_plant_t               plant;
    blw_decentral_sets_t      sets;
    blw_decentral_ranking_t   ranking;
    blw_decentral_steady_t    steady;
    blw_decentral_recursive_t recursive;
    blw_decentral_model_t     model;
    uint16_t                  parent[5];
    uint16_t                  sensor[5];
    uint16_t                  candidate[3];
    uint16_t                  removed[3];
    uint16_t                  at[6];
    uint16_t                  first[4];
    blw_real_t                thr[3];
    blw_real_t                scale[3];
    blw_real_t                knots[3];
    blw_real_t                c[3];
    blw_real_t                E[6];
} decentral_made_t;

static const blw_real_t decentral_half[1]   = {BLW_R(0.5)};
static const blw_real_t decentral_one[3]    = {BLW_R(1.0), BLW_R(1.0), BLW_R(1.0)};
static const blw_real_t decentral_zero[3]   = {BLW_R(0.0), BLW_R(0.0), BLW_R(0.0)};
static const blw_real_t decentral_offset[3] = {BLW_R(1.0), BLW_R(2.0), BLW_R(3.0)};
static const blw_real_t decentral_min[3]    = {-BLW_REAL_MAX, -BLW_REAL_MAX, -BLW_REAL_MAX};
static const blw_real_t decentral_max[3]    = {BLW_REAL_MAX, BLW_REAL_MAX, BLW_REAL_MAX};
static const blw_real_t decentral_F[3]      = {BLW_R(0.25), BLW_R(0.25), BLW_R(0.25)};
static const blw_real_t decentral_K[3]      = {BLW_R(0.5), BLW_R(0.5), BLW_R(0.5)};
static const blw_real_t decentral_third[3]  = {BLW_R(1.0) / BLW_R(3.0), BLW_R(1.0) / BLW_R(3.0),
                                               BLW_R(1.0) / BLW_R(3.0)};
static const blw_real_t decentral_N[5]      = {
         BLW_R(0.81649658092772603), BLW_R(-0.40824829046386302), BLW_R(-0.40824829046386302),
         BLW_R(0.70710678118654752), BLW_R(-0.70710678118654752),
};
static const blw_real_t decentral_Q[5] = {BLW_R(1.0), BLW_R(-0.5), BLW_R(0.86602540378443865),
                                          BLW_R(-0.5), BLW_R(-0.86602540378443865)};
static const blw_real_t decentral_Y[3] = {BLW_R(0.40824829046386302), BLW_R(0.40824829046386302),
                                          BLW_R(0.40824829046386302)};
/* 1 / R_i: R_i = 2/sqrt6, and by the signs of Q the same for all */
static const blw_real_t decentral_H[3] = {BLW_R(1.2247448713915890), BLW_R(1.2247448713915890),
                                          BLW_R(1.2247448713915890)};
/* {0, 1}: X = 1/sqrt3, T = 2/sqrt3, since Q_0' Q_1 = -1/2 */
static const blw_real_t decentral_M[2] = {BLW_R(0.57735026918962576), BLW_R(1.1547005383792515)};
static const blw_real_t decentral_S[3] = {BLW_R(0.5), BLW_R(0.5), BLW_R(0.5)};

/** Set head.crc to the sum of the tables as they are now. */
static inline void decentral_seal(decentral_made_t *made)
{
    const size_t      n_sets = made->sets.n_sets;
    blw_table_check_t check;

    (void)blw_model_begin(&made->model.head, BLW_METHOD_DECENTRAL, &check);
    blw_table_add(&check, made->model.Phi, 3U);
    blw_table_add(&check, made->model.scale, 3U);
    blw_table_add(&check, made->ranking.thr, made->ranking.n_dof);
    blw_table_add(&check, made->ranking.knots, made->ranking.n_knots);
    blw_table_add(&check, made->ranking.c, (size_t)made->ranking.n_ranked * made->ranking.n_knots);
    if (made->model.steady != NULL) {
        blw_table_add(&check, made->steady.F, 3U);
        blw_table_add(&check, made->steady.K, 3U);
        blw_table_add(&check, made->steady.N, 5U);
        blw_table_add(&check, made->steady.Psi, 3U);
        blw_table_add(&check, made->steady.Q, 5U);
        blw_table_add(&check, made->steady.Y, 3U);
        blw_table_add(&check, made->steady.H, (made->model.reseed != 0U) ? 3U : 0U);
        blw_table_add(&check, made->steady.M, made->at[n_sets]);
    } else {
        blw_table_add(&check, made->recursive.S, 3U);
        blw_table_add(&check, made->recursive.t, 3U);
        blw_table_add(&check, made->recursive.V, 3U);
        blw_table_add(&check, made->recursive.E, 6U);
        blw_table_add(&check, made->recursive.L0, 3U);
        blw_table_add(&check, made->recursive.Psi, 3U);
    }
    made->model.head.crc = check.crc;
}

static inline void decentral_point(decentral_made_t *made)
{
    made->sets      = (blw_decentral_sets_t){.n_sets       = 5U,
                                             .n_candidates = 3U,
                                             .parent       = made->parent,
                                             .sensor       = made->sensor,
                                             .candidate    = made->candidate};
    made->ranking   = (blw_decentral_ranking_t){.n_dof   = 3U,
                                                .removed = made->removed,
                                                .thr     = made->thr,
                                                .knots   = made->knots,
                                                .c       = made->c};
    made->steady    = (blw_decentral_steady_t){.d   = 2U,
                                               .F   = decentral_F,
                                               .K   = decentral_K,
                                               .N   = decentral_N,
                                               .Psi = decentral_third,
                                               .Q   = decentral_Q,
                                               .Y   = decentral_Y,
                                               .H   = decentral_H,
                                               .at  = made->at,
                                               .M   = decentral_M};
    made->recursive = (blw_decentral_recursive_t){.S   = decentral_S,
                                                  .t   = decentral_one,
                                                  .V   = decentral_zero,
                                                  .E   = made->E,
                                                  .L0  = decentral_one,
                                                  .Psi = decentral_third};
    made->model     = (blw_decentral_model_t){
            .head    = {.abi    = BLW_MODEL_ABI,
                        .method = (uint8_t)BLW_METHOD_DECENTRAL,
                        .plant  = &made->plant},
            .mu      = 3U,
            .rows    = 2U,
            .readmit = DECENTRAL_READMIT,
            .max_gap = 2U,
            .first   = made->first,
            .Phi     = decentral_one,
            .scale   = made->scale,
            .sets    = &made->sets,
            .ranking = &made->ranking,
    };
}

/** Write the model of this file's head, sealed, with steady or recursive gains. */
static inline void decentral_make(decentral_made_t *made, bool recursive)
{
    *made = (decentral_made_t){
        .plant     = {.n      = 1U,
                      .m      = 3U,
                      .l      = 1U,
                      .p      = 1U,
                      .A      = decentral_half,
                      .Bu     = decentral_one,
                      .C      = decentral_one,
                      .offset = decentral_offset,
                      .y_min  = decentral_min,
                      .y_max  = decentral_max,
                      .x0     = decentral_zero},
        .parent    = {0U, 0U, 0U, 0U, 1U},
        .sensor    = {0U, 0U, 1U, 2U, 1U},
        .candidate = {1U, 2U, 3U},
        .removed   = {1U, 0U, 2U},
        .at        = {0U, 0U, 0U, 0U, 0U, 2U},
        .first     = {0U, 1U, 2U, 3U},
        .thr       = {DECENTRAL_THR_ONE, DECENTRAL_THR, BLW_R(1.0)},
        .scale     = {BLW_R(0.25), BLW_R(0.25), BLW_R(0.25)},
        .knots     = {BLW_R(0.0), BLW_R(10.0), BLW_R(20.0)},
        .c         = {BLW_R(0.0), BLW_R(5.0), BLW_R(8.0)},
        .E         = {BLW_R(1.0), BLW_R(0.0), BLW_R(1.0), BLW_R(0.0), BLW_R(0.0), BLW_R(1.0)},
    };
    decentral_point(made);
    made->model.gains     = recursive ? &blw_decentral_recursive_ops : &blw_decentral_steady_ops;
    made->model.steady    = recursive ? NULL : &made->steady;
    made->model.recursive = recursive ? &made->recursive : NULL;
    decentral_seal(made);
}

#endif
