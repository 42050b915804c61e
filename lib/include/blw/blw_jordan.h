/* SPDX-License-Identifier: MIT */
/** @file blw_jordan.h  Local filters, one per sensor, in the real Jordan form J of A - K C A.
 *
 *      zeta_i(k) = J zeta_i(k-1) + b_i y_i(k) + D_i u(k-1),   D_i = G_i Bu - b_i C_i Bu       (1)
 *
 *  Without attack zeta_i estimates G_i x, and sum_i F_i zeta_i is exactly the Kalman estimate
 *  ([L] (12), Theorem 1; the term in u is ours).  J is shared by all sensors and consists of real
 *  Jordan blocks; a complex pair z, z* is kept real as r = sqrt2 [Re z; Im z].  The rows of every
 *  block are scaled, per sensor, to unit benign multiplier (see blw_l1.h); since the scale is
 *  constant over a block it changes b_i and D_i, not J.
 */
#ifndef BLW_JORDAN_H
#define BLW_JORDAN_H
#include "blw/blw_model.h"
#ifdef __cplusplus
extern "C" {
#endif

/** (1) for all sensors as straight-line code that the design tool writes: zeta [m r] with u [l] or
 *  NULL and y [m] without offset.  The same numbers as the loops of blw_jordan_step(); only the
 *  sign of a zero may differ, which no sum over zeta that starts from +0 lets through. */
typedef void (*blw_jordan_kernel_t)(const blw_real_t *u, const blw_real_t *y, blw_real_t *zeta);

typedef struct blw_jordan_model {
    uint8_t             r;    /**< local states per sensor, >= 1 */
    uint8_t             m;    /**< sensors */
    uint8_t             l;    /**< known inputs */
    const blw_real_t   *J0;   /**< [r] diagonal of J */
    const blw_real_t   *J1;   /**< [r] J(i, i+1), 0 in the last row */
    const blw_real_t   *J2;   /**< [r] J(i, i+2): chains of complex pairs; 0 in the last two rows */
    const blw_real_t   *Jm;   /**< [r] J(i, i-1), 0 in the first row */
    const blw_real_t   *b;    /**< [m r] */
    const blw_real_t   *D;    /**< [m r x l], NULL if l = 0 */
    const blw_real_t   *G;    /**< [m r x n] zeta = G x without noise */
    blw_jordan_kernel_t step; /**< straight-line code for all filters; may be NULL */
} blw_jordan_model_t;

/** Add the tables to a walk and check the dimensions against the plant. */
blw_status_t blw_jordan_check(const blw_jordan_model_t *model, const blw_plant_t *plant,
                              blw_table_check_t *check);
/** zeta = G x0, [m r]: the state of (1) at rest in x0 [n]. */
void blw_jordan_reset(const blw_jordan_model_t *model, size_t n, const blw_real_t *x0,
                      blw_real_t *zeta);
/** One step (1) of the filter of sensor i alone, in place: zeta_i [r], y_i without offset, u [l] or
 *  NULL.  At most r (5 + l) multiply-adds. */
void blw_jordan_step_sensor(const blw_jordan_model_t *model, size_t i, const blw_real_t *u,
                            blw_real_t y_i, blw_real_t *zeta_i);
/** One step (1) of all filters, in place: zeta [m r], y [m] without offset, no sample missing. */
void blw_jordan_step(const blw_jordan_model_t *model, const blw_real_t *u, const blw_real_t *y,
                     blw_real_t *zeta);
#ifdef __cplusplus
}
#endif
#endif
