/* SPDX-License-Identifier: MIT */
/** @file blw_lasso.h  Secure estimation by local filters and l1 fusion: methods `lasso` and
 *  `canonical`.
 *
 *  The local filters (blw_jordan.h) are linear, so they may run on the deviation from any
 *  trajectory of the plant; here from the estimate itself, which keeps their states at noise size
 *  wherever the plant is, and needs no term in u:
 *      x_bar = A x_hat + Bu u,   zeta_i = J zeta_i + b_i e_i,   e = y - offset - C x_bar      (1)
 *      x_hat = x_bar + d,   d = fusion of zeta (blw_l1.h)                                     (2)
 *      zeta  = zeta - G d                                                                     (3)
 *  A missing sample has e_i = 0, that is, its prediction C_i x_bar stands in for it.  The fusion
 *  returns the Kalman estimate if its certificate holds and the secure one otherwise.
 *    lasso      zeta in Jordan coordinates of A - K C A                     [L] (12), (31)
 *    canonical  the same filters, fused as P_i zeta_i with P_i G_i = H_i      [N] (17)
 *  The two differ in tables only: P is NULL for lasso.
 */
#ifndef BLW_LASSO_H
#define BLW_LASSO_H
#include "blw/blw_estimator.h"
#include "blw/blw_jordan.h"
#include "blw/blw_l1.h"
#include "blw/blw_l1_survey.h"
#ifdef __cplusplus
extern "C" {
#endif

typedef struct blw_lasso_model {
    blw_model_t               head; /**< method lasso or canonical */
    const blw_jordan_model_t *jordan;
    const blw_l1_model_t     *l1;
    const blw_real_t         *P;         /**< [m][r x r] to canonical coordinates; NULL for lasso */
    uint8_t                   ambiguous; /**< 1: the minimiser need not be unique (equal weights) */
} blw_lasso_model_t;

/** Estimator state.  The caller owns it; the members are private. */
typedef struct blw_lasso {
    blw_estimator_t          base;
    const blw_lasso_model_t *model;
    blw_l1_t                 l1;
    blw_real_t              *zeta;      /* [N] local states about the reference */
    blw_real_t              *xi;        /* [N] P zeta; zeta itself if there is no P */
    blw_real_t              *x_hat;     /* [n] */
    blw_real_t              *x_bar;     /* [n] */
    blw_real_t              *d;         /* [n] what the fusion adds to x_bar */
    blw_real_t              *e;         /* [m] innovations */
    blw_real_t              *suspicion; /* [m] */
} blw_lasso_t;

/** Number of blw_real_t that init() needs; N = m r rows, d = N - n.  Without P the second N of the
 *  transformed states is not used and may be left out: has_P = 0. */
#define BLW_LASSO_MEM(n, m, N, d, n_groups, has_P) \
    (BLW_L1_MEM((N), (d), (n_groups)) + ((1U + (size_t)(has_P)) * (size_t)(N)) \
     + (3U * (size_t)(n)) + (2U * (size_t)(m)))

/** As blw_estimator_ops.init, for both methods. */
blw_status_t blw_lasso_init(blw_lasso_t *self, const blw_lasso_model_t *model, blw_real_t *mem,
                            size_t mem_len);
/** As blw_estimator_ops.reset. */
blw_status_t blw_lasso_reset(blw_lasso_t *self, const blw_real_t *x0);
/** As blw_estimator_ops.step. */
blw_status_t blw_lasso_step(blw_lasso_t *self, const blw_real_t *u, const blw_real_t *y,
                            blw_mask_t valid, blw_estimator_out_t *out);

/** The same step where the local filters run elsewhere (blw_local.h): zeta [m r] after y(k), for
 *  the sensors in valid; the others go on without a sample.  Same bits as blw_lasso_step(). */
blw_status_t blw_lasso_fuse(blw_lasso_t *self, const blw_real_t *u, const blw_real_t *zeta,
                            blw_mask_t valid, blw_estimator_out_t *out);

/** The same through blw_estimator_t. */
extern const blw_estimator_ops_t blw_lasso_ops;
/** The same, but its step takes zeta [m r] for y: blw_lasso_fuse(). */
extern const blw_estimator_ops_t blw_lasso_fusion_ops;
#ifdef __cplusplus
}
#endif
#endif
