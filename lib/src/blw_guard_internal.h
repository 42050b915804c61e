/* SPDX-License-Identifier: MIT */
/** @file blw_guard_internal.h  Private: what the parts of `guard` share.
 */
#ifndef BLW_GUARD_INTERNAL_H
#define BLW_GUARD_INTERNAL_H
#include "blw/blw_guard.h"

/** l = S tau, every row. */
void blw_guard_multipliers(const blw_guard_model_t *model, const blw_real_t *tau, blw_real_t *l);
/** squares [m] = |l_i|^2 */
void blw_guard_squares(const blw_guard_model_t *model, const blw_real_t *l, blw_real_t *squares);
/** Add `step` [r] to tau_i, and S_ji step to l_j for all sensors j. */
void blw_guard_move(blw_guard_t *self, size_t i, const blw_real_t *step);
/** y = S_ij x, i /= j */
void blw_guard_couple(const blw_guard_model_t *model, size_t i, size_t j, const blw_real_t *x,
                      blw_real_t *y);
/** Copy row a of S_ij, i > j, to row [r]. */
void blw_guard_row(const blw_guard_model_t *model, size_t i, size_t j, size_t a, blw_real_t *row);

/** (1) with the samples in used; the others are replaced by their prediction. */
void blw_guard_advance(blw_guard_t *self, const blw_real_t *y, blw_mask_t used);
/** Check every table and dimension. */
blw_status_t blw_guard_check(const blw_guard_model_t *model);

/** Solve (2) from e [N] and l = S e; tau is left in self->eta.  Fills h, attacked, excluded.
 *  @return the bound on |x_hat - that of the minimiser|. */
blw_real_t blw_guard_solve(blw_guard_t *self, bool *converged);
/** (9) of blw_guard_bound.c from e, tau and l with l' S^+ l = l' tau; BLW_REAL_MAX if the model has no
 *  kappa.  Overwrites suspicion. */
blw_real_t blw_guard_bound(blw_guard_t *self);
/** The largest |h_i| of the sensors outside a set, 0 if there is none; and whose it is. */
blw_real_t blw_guard_largest(const blw_guard_t *self, blw_mask_t set, size_t *sensor);
/** The p units with the largest |h_i| above the threshold, as sensors; *clear: changes of |h_i| by
 *  `margin` would not change the choice. */
blw_mask_t blw_guard_choose(const blw_guard_t *self, blw_real_t margin, bool *clear);
/** The sets of p units: the one whose removal explains most of l = S e, as a mask of sensors; or a
 *  set that is `known` to explain all that clips, unless another explains k^2 / 4 more. */
blw_mask_t blw_guard_search(blw_guard_t *self, blw_mask_t known);
/** Copy S_II, I = set of at most model->most sensors, to self->L.  @return its rows. */
size_t blw_guard_gather(const blw_guard_t *self, blw_mask_t set);
/** Factor the first rows of self->L in place.  Directions that nothing outside the set can check
 *  get a zero on the diagonal. */
void blw_guard_factor(const blw_guard_t *self, size_t rows);
/** x = L^-1 x.  @return its squared length. */
blw_real_t blw_guard_reduce(const blw_guard_t *self, size_t rows, blw_real_t *x);
/** x = L'^-1 x */
void blw_guard_expand(const blw_guard_t *self, size_t rows, blw_real_t *x);
/** One Newton step of (2) on the sensors of the set, at most model->most.  @return false with nothing
 *  changed if an attack would change sides, where the model of second order is of no use. */
bool blw_guard_newton(blw_guard_t *self, blw_mask_t set);
/** The minimum of (2) over nu_i and nu_j, where j is the one excluded sensor and l_j = 0. */
void blw_guard_update_beside(blw_guard_t *self, size_t i, size_t j);

/** Numbers of Lam_i: r^2 without the triangle below `reach` diagonals. */
static inline size_t blw_guard_filter_len(const blw_guard_model_t *model)
{
    const size_t r = model->r;
    const size_t d = r - model->reach;

    return (r * r) - ((d * (d - 1U)) / 2U);
}

static inline bool guard_has(blw_mask_t mask, size_t i)
{
    return ((mask >> i) & 1U) != 0U;
}

static inline blw_mask_t guard_bit(size_t i)
{
    return (blw_mask_t)1U << i;
}

#endif
