/* SPDX-License-Identifier: MIT */
/** @file blw_kalman.h  Steady-state Kalman filter: the estimate that is optimal without attack.
 *
 *      x_bar    = A x_hat(k-1) + Bu u(k-1)                                                    (1)
 *      x_hat(k) = x_bar + K (y(k) - offset - C x_bar)                                         (2)
 *
 *  or, where every sample is there and the plant is dense, the same with a third less work:
 *
 *      x_hat(k) = Acl x_hat(k-1) + Bcl u(k-1) + K (y(k) - offset)                             (3)
 *
 *  It has no defence; it is here as the yardstick and as the peer of the secure methods.  A missing
 *  sample leaves its innovation out of (2).  [L] (7), known input added.
 */
#ifndef BLW_KALMAN_H
#define BLW_KALMAN_H
#include "blw/blw_estimator.h"
#ifdef __cplusplus
extern "C" {
#endif

/** (1) and (2), or (3), for one plant as straight-line code that the design tool writes: x_hat [n]
 *  from k-1 to k with u [l] and all of y [m], the same bits as the loops of blw_kalman_step().
 *  @return false with x_hat untouched unless u, x_hat and y are so small that no bound and no range
 *  can be exceeded, which also refuses NaN. */
typedef bool (*blw_kalman_kernel_t)(const blw_real_t *u, const blw_real_t *y, blw_real_t *x_hat);

typedef struct blw_kalman_model {
    blw_model_t         head;
    const blw_real_t   *K;    /**< [n x m] steady-state gain */
    const blw_real_t   *Acl;  /**< [n x n] A - K C A; NULL if (3) is not used */
    const blw_real_t   *Bcl;  /**< [n x l] Bu - K C Bu; NULL with Acl or without inputs */
    blw_kalman_kernel_t step; /**< straight-line code for the usual step; may be NULL */
} blw_kalman_model_t;

/** Filter state.  The caller owns it; the members are private. */
typedef struct blw_kalman {
    blw_estimator_t           base;
    const blw_kalman_model_t *model;
    blw_real_t               *x_hat;     /* [n] */
    blw_real_t               *x_bar;     /* [n] */
    blw_real_t               *suspicion; /* [m] */
    blw_mask_t                all;       /* every sensor */
    bool                      calm;      /* suspicion is all 0 */
} blw_kalman_t;

/** Number of blw_real_t that init() needs. */
#define BLW_KALMAN_MEM(n, m) (2U * (size_t)(n) + (size_t)(m))

/** As blw_estimator_ops.init. */
blw_status_t blw_kalman_init(blw_kalman_t *self, const blw_kalman_model_t *model, blw_real_t *mem,
                             size_t mem_len);
/** As blw_estimator_ops.reset. */
blw_status_t blw_kalman_reset(blw_kalman_t *self, const blw_real_t *x0);
/** As blw_estimator_ops.step.  n (n + l + 2 m) multiply-adds, n (n + l + m) by (3). */
blw_status_t blw_kalman_step(blw_kalman_t *self, const blw_real_t *u, const blw_real_t *y,
                             blw_mask_t valid, blw_estimator_out_t *out);

/** The same through blw_estimator_t. */
extern const blw_estimator_ops_t blw_kalman_ops;
#ifdef __cplusplus
}
#endif
#endif
