/* SPDX-License-Identifier: MIT */
/** @file blw_guard_internal.h  Private: what the parts of `guard` share.
 */
#ifndef BLW_GUARD_INTERNAL_H
#define BLW_GUARD_INTERNAL_H
#include "blw/blw_guard.h"

/** Sensors that move together at most. */
#define GUARD_SOME 4U

/** A pivot of S_II (whose diagonal is 1) below this belongs to a direction that the sensors outside
 *  I check a hundred times worse than all sensors do together, and in which float has few digits
 *  left. */
#define GUARD_PIVOT_MIN BLW_R(1e-4)

/** |h_i| / k above which rounding in l would show. */
#define GUARD_GROSS BLW_R(64.0)

/** Largest |step| that ends the descent, relative to k: eps^(2/3), about. */
#define GUARD_TOLERANCE ((BLW_REAL_EPS > BLW_R(1e-10)) ? BLW_R(3e-5) : BLW_R(3e-11))

/** The units to exclude are beyond doubt if no |h_i| is nearer to where it would matter than this
 *  many times the largest |step|. */
#define GUARD_CLEAR BLW_R(8.0)

/** Units are excluded at once if their |h_i| are larger than all others and than the threshold by
 *  this many times k. */
#define GUARD_AT_ONCE BLW_R(4.0)

/** How a minimiser of (2) is found, and the bound on |x_hat - that of the minimiser|. */
struct blw_guard_solver {
    /** From e [N] and l = S e, or from tau and l as blw_guard_start_without() leaves them, and the
     *  |h_i| there; tau is left in self->eta.  Fills h, attacked, excluded. */
    blw_real_t (*solve)(blw_guard_t *self, bool *converged);
    bool single; /* for p = 1 with pairs only */
};

/** What all sensors would do next. */
typedef struct blw_guard_view {
    blw_real_t pending; /* sum over the sensors of effect_i |step_i| */
    blw_real_t largest; /* largest |step_i| */
    size_t     sensor;  /* whose it is */
    blw_real_t l;       /* largest |l_i| */
} blw_guard_view_t;

/** Sensors that move together; their copies of l and tau are in self->L and self->step. */
typedef struct blw_guard_some {
    uint8_t count;
    uint8_t penalised; /* the first ones; the others are excluded */
    uint8_t sensor[GUARD_SOME];
    bool    attacked[GUARD_SOME]; /* nu_i /= 0 */
} blw_guard_some_t;

/** l = S tau, every row. */
void blw_guard_multipliers(const blw_guard_model_t *model, const blw_real_t *tau, blw_real_t *l);
/** squares [m] = |l_i|^2 */
void blw_guard_squares(const blw_guard_model_t *model, const blw_real_t *l, blw_real_t *squares);
/** Add `step` [r] to tau_i, and S_ji step to l_j for all sensors j. */
void blw_guard_move(blw_guard_t *self, size_t i, const blw_real_t *step);
/** y += S_ij x, i /= j */
void blw_guard_couple(const blw_guard_model_t *model, size_t i, size_t j, const blw_real_t *x,
                      blw_real_t *y);
/** Copy row a of S_ij, i > j, to row [r]. */
void blw_guard_row(const blw_guard_model_t *model, size_t i, size_t j, size_t a, blw_real_t *row);

/** (1) with the samples in used; the others are replaced by their prediction. */
void blw_guard_advance(blw_guard_t *self, const blw_real_t *y, blw_mask_t used);
/** Check every table and dimension. */
blw_status_t blw_guard_check(const blw_guard_model_t *model);

/** The sensors whose filters a gross attack has reached; none if they are so many that it may be
 *  the reference that is off.  Overwrites suspicion. */
blw_mask_t blw_guard_gross(blw_guard_t *self);
/** tau = e, but 0 for the sensors of a set, l = S tau, and nu_i /= 0 for that set. */
void blw_guard_start_without(blw_guard_t *self, blw_mask_t set);
/** blw_guard_start_without() and all |h_i| there.  @return the square of the largest one. */
blw_real_t blw_guard_test_without(blw_guard_t *self, blw_mask_t set);
/** h_i = l_i + (e_i - tau_i) of a sensor, all [r].  @return |h_i| */
blw_real_t blw_guard_pull(size_t r, const blw_real_t *l, const blw_real_t *e, const blw_real_t *tau,
                          blw_real_t *h);
/** The step (7) of blw_guard_alone.c of a sensor with k_i = k, all [r]; *square = |step|^2.
 *  @return |h_i| */
blw_real_t blw_guard_step_alone(size_t r, blw_real_t k, const blw_real_t *l, const blw_real_t *e,
                                const blw_real_t *tau, blw_real_t *step, blw_real_t *square);

/** All |h_i|, and what would move.  The step of an excluded sensor is -l_i. */
void blw_guard_survey(blw_guard_t *self, blw_guard_view_t *view);
/** tau = e, unless blw_guard_start_without() has set it.  @return whether l holds the rounding of a
 *  gross attack. */
bool blw_guard_begin(blw_guard_t *self);
/** Add `step` [r] to tau_i, with what that does to all l; attacked: nu_i /= 0 then. */
void blw_guard_move_to(blw_guard_t *self, size_t i, const blw_real_t *step, bool attacked);
/** (7) of blw_guard_alone.c for sensor i with k_i = k. */
void blw_guard_move_alone(blw_guard_t *self, size_t i, blw_real_t k);
/** Sensors i and j to the minimum of (2) over nu_i and nu_j, where j is the one excluded, and
 *  l_j = 0. */
void blw_guard_move_beside(blw_guard_t *self, size_t i, size_t j);
/** (9) of blw_guard_bound.c from e, tau and l with l' S^+ l = l' tau, and the largest |l_i|;
 *  BLW_REAL_MAX if the model has no kappa. */
blw_real_t blw_guard_bound(const blw_guard_t *self, blw_real_t largest);
/** Whether changes of |h_i| by `margin` would leave the sensors of a set above all others, and
 *  above the threshold. */
bool blw_guard_stands_out(const blw_guard_t *self, blw_mask_t set, blw_real_t margin);
/** The p units with the largest |h_i| above the threshold, as sensors; *clear: these are p, and
 *  stand out by `margin`. */
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
/** One Newton step of (2) on the sensors of the set, at most model->most.  @return false with
 *  nothing changed if an attack would change sides, where the model of second order is of no
 *  use. */
bool blw_guard_newton(blw_guard_t *self, blw_mask_t set);
/** List a set of sensors, the excluded ones last.  @return false if they are too many. */
bool blw_guard_list(const blw_guard_t *self, blw_mask_t set, blw_guard_some_t *some);
/** Minimise (2) over the nu of the sensors in the list.  That counts as one update each for the
 *  sums of their steps, and one for each step but that of a sensor alone.  @return false with
 *  nothing changed if the list is empty or that is more than the limit allows. */
bool blw_guard_move_some(blw_guard_t *self, blw_guard_some_t *some, blw_real_t tolerance,
                         unsigned limit);
/** Move the sensors of a set so, or else, if they are too many or do not move, those of a smaller
 *  set. */
void blw_guard_move_together(blw_guard_t *self, blw_mask_t set, blw_mask_t smaller,
                             blw_real_t close, unsigned limit);
/** The sensors without nu_i that clip; suspicion is filled with all |l_i|^2. */
blw_mask_t blw_guard_clipping(blw_guard_t *self);
/** y = (S_ii - S_ij S_ji)^-1 x, 0 where nothing but i and j can check; turned [r] is
 *  overwritten. */
void blw_guard_divide(const blw_guard_model_t *model, size_t i, size_t j, const blw_real_t *x,
                      blw_real_t *turned, blw_real_t *y);

/** Whether blw_guard_relax() eliminates so many excluded sensors exactly. */
static inline bool blw_guard_exact(const blw_guard_t *self, size_t excluded)
{
    return (excluded <= 1U) || ((excluded == 2U) && (self->model->pairs != 0U));
}

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
