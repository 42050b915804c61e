/* SPDX-License-Identifier: MIT */
/** @file blw_l1_newton.h  What the parts of the Newton engine share; not installed. */
#ifndef BLW_L1_NEWTON_H
#define BLW_L1_NEWTON_H
#include "blw_l1_internal.h"

/* Where a solve is.  tau, l and x satisfy  tau = W l + G x  up to rounding. */
typedef struct blw_l1_newton {
    blw_l1_t         *l1;
    const blw_real_t *zeta;
    blw_real_t       *x;     /* [n] */
    blw_real_t        kappa; /* smoothing: a group is inside while |nu_g| <= kappa width_g */
    size_t            free;  /* columns of the last system before those of G */
    bool              weak;  /* that system was singular within rounding */
} blw_l1_newton_t;

/* Whether group g, which starts at row i, is outside: nu_g /= 0 and l_g = c_g dir_g. */
static inline bool blw_l1_outside(const blw_l1_t *self, size_t g, size_t i)
{
    const blw_real_t second = (blw_l1_size(self->model, g) == 2U) ? self->dir[i + 1U] : BLW_R(0.0);

    return ((self->dir[i] * self->dir[i]) + (second * second)) > BLW_R(0.5);
}

/* Product of two vectors of one row or two. */
static inline blw_real_t blw_l1_dot(size_t rows, const blw_real_t *a, const blw_real_t *b)
{
    const blw_real_t first = a[0] * b[0];

    return (rows == 2U) ? (first + (a[1] * b[1])) : first;
}

/* nu_g = zeta_g - tau_g, the second row 0 if there is none.  @return |nu_g|. */
blw_real_t blw_l1_nu(const blw_l1_newton_t *at, size_t g, blw_real_t nu[2]);

/* Largest residual of the smoothed problem, relative to c_g. */
blw_real_t blw_l1_newton_residual(const blw_l1_newton_t *at);

/* Newton step for the groups in dir: x moves; self->z = change of l, self->dz = change of tau, and
 * the first n numbers of self->step = change of x. */
void blw_l1_newton_step(blw_l1_newton_t *at);

/* The system of such a step, factored in self->L; self->dz = its columns. */
void blw_l1_newton_factor(blw_l1_newton_t *at);
/* out = E' v, v with its rows `stride` apart, for the first `count` columns E of the system; out
 * may be v. */
void blw_l1_newton_gather(const blw_l1_t *self, size_t count, const blw_real_t *v, size_t stride,
                          blw_real_t *out);
/* v += E y. */
void blw_l1_newton_spread(const blw_l1_t *self, size_t count, const blw_real_t *y, blw_real_t *v);
/* The column that is a row inside. */
size_t blw_l1_newton_column(const blw_l1_newton_t *at, size_t row);

/* Steps with kappa = 0 from l, x and the sides in dir.  @return whether they end in the minimum. */
bool blw_l1_newton_finish(blw_l1_newton_t *at, blw_l1_info_t *info);

/* The first tau, l, x and sides, widths to A, and kappa; from l = S zeta and what was
 * remembered. */
void blw_l1_newton_start(blw_l1_newton_t *at);

/* |nu_g| of the groups under a gross attack to A, 0 for the others; dir holds the directions. */
void blw_l1_newton_remember(const blw_l1_newton_t *at);

#endif
