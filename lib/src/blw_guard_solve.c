/* SPDX-License-Identifier: MIT */
/* Block coordinate descent on (2), several sensors at a time, and exclusion: for any number of
 * liars. */
#include "blw_cold.h"
#include "blw_guard_internal.h"
#include "blw_la.h"

/* While it is only to be decided which units to exclude, the steps of the sensors that move
 * together end at this part of the largest one. */
#define COARSE BLW_R(0.01)

/* Sensors may come up again so many times before Newton steps are tried, in sweeps over several at
 * a time. */
#define PATIENCE 1U

/* Updates that looking at all sensors counts as, wherever that leads. */
#define LOOK 2U

typedef struct descent {
    blw_guard_view_t view;
    unsigned         limit;   /* on self->updates */
    unsigned         repeats; /* updates of sensors that had had one */
    bool             gross;   /* l may hold the rounding of a gross attack */
    bool             decides; /* ends as soon as it is clear which units to exclude */
    bool             fresh;   /* the view is up to date */
    blw_mask_t       chosen;  /* what `decides` has ended with, or 0 */
} descent_t;

/* Block updates that a joint step on some sensors counts as: its spreads, and its factorisation. */
static BLW_COLD unsigned cost_of(const blw_guard_t *self, blw_mask_t set)
{
    const unsigned m       = self->model->head.plant->m;
    const unsigned sensors = blw_mask_count(set);

    if ((sensors <= 1U) || (sensors > m)) { /* more than m cannot be: it tells that m is not 0 */
        return 1U;
    }
    return (2U * (sensors + 1U)) + ((sensors * sensors * sensors * self->model->r) / (6U * m));
}

/* Try a Newton step on a set of sensors.  @return whether anything was done. */
static BLW_COLD BLW_APART bool update_jointly(blw_guard_t *self, blw_mask_t set, unsigned limit)
{
    const unsigned cost = self->updates + cost_of(self, set);

    if ((blw_mask_count(set) > self->model->most) || (cost > limit)
        || !blw_guard_newton(self, set)) {
        return false;
    }
    self->updates = (uint16_t)cost;
    return true;
}

/* The sensors to move next: the support, the one with the largest step, and what clips beside them;
 * fewer if these are too many. */
static BLW_COLD void list_next(blw_guard_t *self, const descent_t *descent, blw_guard_some_t *some)
{
    const blw_mask_t next    = guard_bit(descent->view.sensor);
    const blw_mask_t support = self->attacked | self->excluded;

    if (!blw_guard_list(self, support | next | ((support != 0U) ? blw_guard_clipping(self) : 0U),
                        some)
        && !blw_guard_list(self, support | next, some)
        && !blw_guard_list(self, self->excluded | next, some)) {
        (void)blw_guard_list(self, next, some);
    }
}

/* Move those, fewer still if they do not move, and count the look at all sensors.
 * @return whether anything moved. */
static BLW_COLD BLW_APART bool move_next(blw_guard_t *self, const descent_t *descent)
{
    const unsigned   limit = descent->limit - LOOK;
    blw_real_t       close = GUARD_TOLERANCE * self->model->k;
    blw_guard_some_t some;

    if (descent->decides) {
        close = blw_la_max(close, COARSE * descent->view.largest);
    }
    list_next(self, descent, &some);
    bool moved = blw_guard_move_some(self, &some, close, limit);
    if (!moved) {
        (void)blw_guard_list(self, self->excluded | guard_bit(descent->view.sensor), &some);
        moved = blw_guard_move_some(self, &some, close, limit);
    }
    self->updates = (uint16_t)(self->updates + LOOK);
    return moved;
}

/* Newton steps on sensors that would come up again and again.  @return whether anything was
 * done. */
static BLW_COLD BLW_APART bool move_support(blw_guard_t *self, descent_t *descent)
{
    const blw_mask_t next    = guard_bit(descent->view.sensor);
    const blw_mask_t support = self->attacked | self->excluded;
    const bool       several = !blw_guard_exact(self, blw_mask_count(self->excluded));

    if ((self->attacked & next) != 0U) {
        descent->repeats++;
    }
    return ((((self->excluded & next) != 0U) && several) || (descent->repeats > PATIENCE))
           && (update_jointly(self, support, descent->limit)
               || (several && update_jointly(self, self->excluded, descent->limit)));
}

/* Reduce the largest step.  @return false if what is left of the limit is too little for that. */
static BLW_COLD bool update(blw_guard_t *self, descent_t *descent)
{
    if ((self->updates + LOOK + ((self->excluded != 0U) ? 4U : 1U)) > descent->limit) {
        return false;
    }
    return move_support(self, descent) || move_next(self, descent);
}

/* Descend until nothing moves, the choice is clear, or the limit is reached.  @return whether
 * nothing moves. */
static BLW_COLD bool descend(blw_guard_t *self, unsigned limit, descent_t *descent)
{
    const blw_real_t k       = self->model->k;
    bool             clear   = false;
    bool             renewed = false;

    descent->limit   = limit;
    descent->repeats = 0U;
    for (;;) {
        if (!descent->fresh) {
            blw_guard_survey(self, &descent->view);
        }
        descent->fresh   = false;
        const bool still = descent->view.largest <= (GUARD_TOLERANCE * k);
        if (still && descent->gross && !renewed) {
            blw_guard_multipliers(self->model, self->eta, self->l);
            renewed = true;
            continue;
        }
        if (!still && descent->decides && (self->updates > 0U)) {
            descent->chosen = blw_guard_choose(self, GUARD_CLEAR * descent->view.largest, &clear);
        }
        if (clear) {
            return false;
        }
        descent->chosen = 0U;
        if (still || !update(self, descent)) {
            return still;
        }
        descent->gross = descent->gross || (descent->view.largest > (GUARD_GROSS * k));
    }
}

/* l_I = 0 for the excluded sensors I, together with what else has nu_i /= 0. */
static BLW_COLD BLW_APART void eliminate(blw_guard_t *self, unsigned limit)
{
    if (!blw_guard_exact(self, blw_mask_count(self->excluded))) {
        (void)blw_guard_newton(self, self->excluded);
        self->updates = (uint16_t)(self->updates + cost_of(self, self->excluded));
        return;
    }
    blw_guard_move_together(self, self->attacked | self->excluded, self->excluded,
                            GUARD_TOLERANCE * self->model->k, limit);
}

/* Solve for what clips beside the excluded sensors, if these stand out; for the one that clips most
 * if the limit allows no more. */
static BLW_COLD BLW_APART void move_clipping(blw_guard_t *self, unsigned limit)
{
    const blw_mask_t more = blw_guard_clipping(self);
    size_t           most = 0U;
    size_t           i    = 0U;

    if (more == 0U) {
        return;
    }
    for (blw_mask_t rest = more; rest != 0U; rest >>= 1) {
        if ((rest & 1U) != 0U) {
            self->h[i] = blw_la_sqrt(self->suspicion[i]);
            most       = (((more >> most) & 1U) == 0U) || (self->h[i] > self->h[most]) ? i : most;
        }
        i++;
    }
    if (!blw_guard_stands_out(self, self->excluded, GUARD_AT_ONCE * self->model->k)) {
        return;
    }
    blw_guard_move_together(self, self->attacked | self->excluded | more,
                            self->excluded | guard_bit(most), GUARD_TOLERANCE * self->model->k,
                            limit);
}

/* Updates that eliminate() takes at least. */
static BLW_COLD unsigned elimination_cost(const blw_guard_t *self, blw_mask_t set)
{
    const unsigned count = blw_mask_count(set);

    if (blw_guard_exact(self, count)) {
        return (count <= 1U) ? 1U : 4U; /* as blw_guard_move_some() has it */
    }
    return cost_of(self, set);
}

/* Solve on without the sensors of a set.  Unless l_I = 0 is kept all the time, the work for that is
 * kept back, since (8) would not hold otherwise. */
static BLW_COLD bool descend_without(blw_guard_t *self, blw_mask_t set, unsigned limit,
                                     descent_t *descent)
{
    const unsigned cost = elimination_cost(self, set);
    const unsigned kept = blw_guard_exact(self, blw_mask_count(set)) ? 0U : cost;

    if (set != self->excluded) {
        if ((self->updates + cost) > limit) {
            self->excluded = 0U;
            return false;
        }
        self->excluded = set;
        eliminate(self, limit);
    }
    descent->decides     = false;
    const bool converged = descend(self, (limit > kept) ? (limit - kept) : 0U, descent);
    if (!converged && (kept > 0U) && ((self->updates + kept) <= limit)) {
        eliminate(self, limit);
    }
    return converged;
}

/* Exclude what stands out, and see whether it still does; else leave the choice to the first
 * descent, which may start from anywhere. */
static BLW_COLD BLW_APART void exclude_at_once(blw_guard_t *self, unsigned limit,
                                               descent_t *descent)
{
    const blw_real_t margin = GUARD_AT_ONCE * self->model->k;
    bool             clear  = false;
    blw_mask_t       set    = blw_guard_choose(self, margin, &clear);
    if (!clear && !descent->fresh) {
        blw_guard_survey(self, &descent->view);
        descent->fresh = true;
        set            = blw_guard_choose(self, margin, &clear);
    }

    if (!clear || ((self->updates + elimination_cost(self, set)) >= limit)) {
        return;
    }
    self->excluded = set;
    eliminate(self, limit - 1U);
    if (blw_guard_exact(self, blw_mask_count(set))) {
        move_clipping(self, limit - 1U);
    }
    self->updates++;
    blw_guard_survey(self, &descent->view);
    descent->fresh = blw_guard_stands_out(self, set, margin);
    if (!descent->fresh) {
        self->excluded = 0U;
    }
}

/* The first descent, and what it excludes.  @return that set. */
static BLW_COLD BLW_APART blw_mask_t find_excluded(blw_guard_t *self, unsigned limit,
                                                   descent_t *descent, bool *converged)
{
    const unsigned most  = self->model->max_updates;
    blw_mask_t     set   = 0U;
    bool           clear = false;

    *converged = descend(self, descent->decides ? limit : most, descent);
    if (descent->decides) {
        set = descent->chosen;
        set = (set != 0U) ? set : blw_guard_choose(self, BLW_R(0.0), &clear);
    }
    if ((set == 0U) && !*converged) {
        descent->decides = false;
        *converged       = descend(self, most, descent);
    }
    return set;
}

static BLW_COLD blw_real_t solve(blw_guard_t *self, bool *converged)
{
    const blw_guard_model_t *const model   = self->model;
    const unsigned                 most    = model->max_updates;
    const bool                     search  = model->search != 0U;
    const unsigned                 limit   = search ? (most / 4U) : (most / 2U);
    descent_t                      descent = {.decides = self->warm_up == 0U};

    descent.gross = blw_guard_begin(self);
    if (descent.decides) {
        exclude_at_once(self, 2U * limit, &descent);
    }
    blw_mask_t set = self->excluded;
    if (set == 0U) {
        set = find_excluded(self, limit, &descent, converged);
    }
    if (set != 0U) {
        *converged = descend_without(self, set, search ? (most / 2U) : most, &descent);
    }
    const bool unexplained = (self->attacked & ~self->excluded) != 0U;
    if ((set != 0U) && ((unexplained && search) || (model->search > 1U))) {
        const blw_mask_t known = unexplained ? 0U : set;

        blw_guard_multipliers(model, self->e, self->l);
        self->excluded         = 0U;
        const blw_mask_t found = blw_guard_search(self, known);
        blw_guard_start_without(self, found);
        *converged = descend_without(self, found, most, &descent);
    }
    if (*converged) {
        return descent.view.pending;
    }
    blw_guard_survey(self, &descent.view);
    return blw_guard_bound(self, descent.view.l);
}

const blw_guard_solver_t blw_guard_many_ops = {.solve = solve};
