/* SPDX-License-Identifier: MIT */
/** @file blw_local.h  One sensor's local filter of `lasso` or `canonical`, where the sensor is.
 *
 *  In a split deployment every sensor runs its own filter and sends zeta_i instead of y_i; the
 *  fusion node (blw_lasso_fuse()) sends its estimate back, which all take for the reference of the
 *  next step, as in blw_lasso.h:
 *      x_bar = A x_hat + Bu u,   zeta_i = J zeta_i + b_i (y_i - offset_i - C_i x_bar)         (1)
 *      zeta_i = zeta_i - G_i (x_hat(k) - x_bar)                                               (2)
 *  The arithmetic is that of the central estimator, operation by operation, so the estimates have
 *  the same bits.
 */
#ifndef BLW_LOCAL_H
#define BLW_LOCAL_H
#include "blw/blw_lasso.h"
#ifdef __cplusplus
extern "C" {
#endif

/** Filter state.  The caller owns it; the members are private, zeta may be read. */
typedef struct blw_local {
    const blw_lasso_model_t *model;
    blw_real_t              *zeta;  /**< [r] what is sent */
    blw_real_t              *xi;    /* [r] P_i zeta_i */
    blw_real_t              *x_hat; /* [n] reference of the next step */
    blw_real_t              *x_bar; /* [n] prediction of this one */
    uint8_t                  sensor;
} blw_local_t;

/** Number of blw_real_t that init() needs. */
#define BLW_LOCAL_MEM(n, r) ((2U * (size_t)(n)) + (2U * (size_t)(r)))

/** Bind model and memory, check every table, reset to the model's x0.
 *  @return BLW_OK; or BLW_ERR_ARG, BLW_ERR_MODEL, BLW_ERR_MEM with *self untouched. */
blw_status_t blw_local_init(blw_local_t *self, const blw_lasso_model_t *model, uint8_t sensor,
                            blw_real_t *mem, size_t mem_len);
/** Start again about x_hat [n]; NULL takes the model's x0.
 *  @return BLW_OK, or BLW_ERR_ARG with nothing changed if x_hat is not within BLW_SIGNAL_MAX. */
blw_status_t blw_local_reset(blw_local_t *self, const blw_real_t *x_hat);
/** (1) with u(k-1) [l] (NULL means 0), which is within BLW_SIGNAL_MAX.  A sample that is out of its
 *  range, or throws the filter out of bounds, is missing.  At most n (n + l + 1) + r (5 + r)
 *  multiply-adds.
 *  @return whether the sample was taken in. */
bool blw_local_step(blw_local_t *self, const blw_real_t *u, blw_real_t y, bool valid);
/** (2) with the fusion node's x_hat(k) [n].
 *  @return BLW_OK, or BLW_ERR_ARG with nothing changed if it is not within BLW_SIGNAL_MAX. */
blw_status_t blw_local_correct(blw_local_t *self, const blw_real_t *x_hat);
#ifdef __cplusplus
}
#endif
#endif
