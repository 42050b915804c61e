/* SPDX-License-Identifier: MIT */
/** @file support.h  Shared by the unit tests: comparisons and two hand-made models.
 *
 *  Both models are of the plant
 *      x(k+1) = x(k)/2 + u(k),   y_i = x + offset_i,   i = 0..2,   offsets 1, 2, 3,   p = 1,
 *  with the gain K_i = 1/6 (optimal for no particular noise, but easy to compute with):
 *      x_hat(k) = x_bar + (1/6) sum_i (y_i - offset_i - x_bar),   x_bar = x_hat/2 + u.
 *  Then A - K C A = 1/4 = J, b = 1, and from J G = G A - b C A:  G_i = 2, D_i = G_i - b = 1,
 *  F_i = K_i = 1/6.  Z has the orthonormal columns (2, -1, -1)/sqrt(6) and (0, 1, -1)/sqrt(2), so
 *  S = Z Z' = I - 1 1'/3, and with c = 1 the fusion is Huber's estimate of a location:
 *  2 x_hat = mu with sum_i clip(zeta_i - mu, -1, 1) = 0.
 */
#ifndef SUPPORT_H
#define SUPPORT_H
#include "blw/blw_kalman.h"
#include "blw/blw_lasso.h"
#include "unity.h"

#define TEST_ASSERT_REAL_WITHIN(tolerance, expected, actual) \
    TEST_ASSERT_DOUBLE_WITHIN((tolerance), (double)(expected), (double)(actual))

/* Rounding of a few operations on numbers of magnitude 1 to 100. */
#define SUPPORT_TOL (64.0 * (double)BLW_REAL_EPS)

/* Steps of an endurance test; the emulated targets, which get the same bits, run fewer. */
#ifndef SUPPORT_LONG_RUN
#define SUPPORT_LONG_RUN 1000000U
#endif

/* As volatile: a constant would be folded, with a warning. */
extern volatile const blw_real_t support_nan;
extern volatile const blw_real_t support_inf;

/** A writable copy of a model with all that hangs on it, so that a test can break any part. */
typedef struct support_kalman {
    blw_plant_t        plant;
    blw_kalman_model_t model;
} support_kalman_t;

typedef struct support_lasso {
    blw_plant_t        plant;
    blw_jordan_model_t jordan;
    blw_l1_model_t     l1;
    blw_lasso_model_t  model;
} support_lasso_t;

/** Write the model of this file's head, sealed.  canonical: with P_i = 1 (the same estimates). */
void support_kalman_make(support_kalman_t *made);
void support_lasso_make(support_lasso_t *made, blw_method_t method);
/** Set head.crc to the sum of the tables as they are now. */
void support_kalman_seal(support_kalman_t *made);
void support_lasso_seal(support_lasso_t *made);

#endif
