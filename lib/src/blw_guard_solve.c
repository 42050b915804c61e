/* SPDX-License-Identifier: MIT */
/* Block coordinate descent on (2), and exclusion.
 *
 * Since S_ii = diag(I, 0), the minimum over nu_i alone is (3), and with s = min(1, k_i / |h_i|) it
 * moves tau_i, and l_i, by
 *     step = s h_i - l_i.                                                                    (7)
 * tau is kept rather than nu: it stays at noise size however large the attack, and a sensor that
 * leaves the support gets tau_i = e_i exactly.  What a gross attack has left in l by rounding is
 * removed by computing l = S tau again once nothing moves any more. */
#include "blw_guard_internal.h"
#include "blw_la.h"

/* Largest |step| that ends the descent, relative to k: eps^(2/3), about. */
#define TOLERANCE ((BLW_REAL_EPS > BLW_R(1e-10)) ? BLW_R(3e-5) : BLW_R(3e-11))

/* |step| / k above which rounding in l would show. */
#define GROSS BLW_R(64.0)

/* Sensors may come up for another update so many times before Newton steps are tried. */
#define PATIENCE 2U

/* The units to exclude are beyond doubt if no |h_i| is nearer to where it would matter than this
 * many times the largest |step|. */
#define CLEAR BLW_R(8.0)

/* A sensor is excluded at once if its |h_i| is larger than all others and than the threshold by this
 * many times k. */
#define AT_ONCE BLW_R(4.0)

typedef struct descent {
    blw_real_t pending; /* sum over the sensors of effect_i |step_i| */
    blw_real_t largest; /* largest |step_i| */
    size_t     sensor;  /* whose it is */
    unsigned   limit;   /* on self->updates */
    unsigned   repeats; /* updates of sensors that had had one */
    bool       gross;   /* l may hold the rounding of a gross attack */
    bool       decides; /* ends as soon as it is clear which units to exclude */
    bool       fresh;   /* the survey is up to date */
    blw_mask_t chosen;  /* what `decides` has ended with, or 0 */
} descent_t;

/* s of (7) from |h_i|. */
static blw_real_t shrink(blw_real_t h, blw_real_t k)
{
    return (h > k) ? (k / h) : BLW_R(1.0);
}

/* |step| of (7) for a sensor with nu_i /= 0 from its l, e and tau [r]; also h_i and its length. */
static blw_real_t attacked_step(size_t r, blw_real_t k, const blw_real_t *l, const blw_real_t *e,
                                const blw_real_t *tau, blw_real_t *h, blw_real_t *length)
{
    blw_real_t sum = BLW_R(0.0);

    for (size_t a = 0U; a < r; a++) {
        h[a] = l[a] + (e[a] - tau[a]);
        sum += h[a] * h[a];
    }
    *length            = blw_la_sqrt(sum);
    const blw_real_t s = shrink(*length, k);
    sum                = BLW_R(0.0);
    for (size_t a = 0U; a < r; a++) {
        const blw_real_t step = (s * h[a]) - l[a];
        sum += step * step;
    }
    return blw_la_sqrt(sum);
}

static void note_step(descent_t *descent, size_t i, blw_real_t length)
{
    if (length > descent->largest) {
        descent->largest = length;
        descent->sensor  = i;
    }
}

/* All |h_i|, and the largest step.  What the first loop says of a sensor with nu_i /= 0 or k_i = 0 is
 * less than its step, which the second finds. */
static void survey(blw_guard_t *self, descent_t *descent)
{
    const blw_guard_model_t *const model    = self->model;
    const size_t                   r        = model->r;
    const size_t                   m        = model->head.plant->m;
    const blw_real_t               k        = model->k;
    blw_mask_t                     excluded = self->excluded;
    size_t                         row      = 0U;

    descent->pending = BLW_R(0.0);
    descent->largest = BLW_R(0.0);
    blw_guard_squares(model, self->l, self->h);
    for (size_t i = 0U; i < m; i++) {
        const blw_real_t h = blw_la_sqrt(self->h[i]);

        self->h[i] = h;
        if (h > k) {
            descent->pending += model->effect[i] * (h - k);
            note_step(descent, i, h - k);
        }
    }
    for (blw_mask_t rest = self->attacked | excluded; rest != 0U; rest >>= 1) {
        if ((rest & 1U) != 0U) {
            const size_t     i      = row / r;
            const blw_real_t limit  = ((excluded & 1U) != 0U) ? BLW_R(0.0) : k;
            const blw_real_t length = attacked_step(r, limit, &self->l[row], &self->e[row],
                                                    &self->eta[row], self->step, &self->h[i]);

            descent->pending += model->effect[i] * length;
            note_step(descent, i, length);
        }
        excluded >>= 1;
        row += r;
    }
}

/* (7) for sensor i. */
static void update_sensor(blw_guard_t *self, size_t i)
{
    const size_t            r   = self->model->r;
    const blw_real_t        k   = guard_has(self->excluded, i) ? BLW_R(0.0) : self->model->k;
    const blw_real_t        s   = shrink(self->h[i], k);
    const blw_real_t *const e   = &self->e[i * r];
    const blw_real_t *const l   = &self->l[i * r];
    blw_real_t *const       tau = &self->eta[i * r];

    for (size_t a = 0U; a < r; a++) {
        self->step[a] = (s * (l[a] + (e[a] - tau[a]))) - l[a];
    }
    blw_guard_move(self, i, self->step);
    self->attacked |= guard_bit(i);
    if (!(self->h[i] > k)) {
        blw_la_copy(r, e, tau);
        self->attacked &= ~guard_bit(i);
    }
    self->updates++;
}

/* Block updates that a joint step on some sensors counts as: its spreads, and its factorisation. */
static unsigned cost_of(const blw_guard_t *self, blw_mask_t set)
{
    const unsigned sensors = blw_mask_count(set);
    const unsigned rate    = 6U * self->model->head.plant->m;

    return (sensors <= 1U)
               ? 1U
               : (sensors + 1U + ((sensors * sensors * sensors * self->model->r) / rate));
}

/* Try a Newton step on a set of sensors.  @return whether anything was done. */
static bool update_jointly(blw_guard_t *self, blw_mask_t set, unsigned limit)
{
    const unsigned cost = self->updates + cost_of(self, set);

    if ((blw_mask_count(set) > self->model->most) || (cost > limit)
        || !blw_guard_newton(self, set)) {
        return false;
    }
    self->updates = (uint16_t)cost;
    return true;
}

/* The one excluded sensor, if there are tables for it; else m. */
static size_t excluded_one(const blw_guard_t *self)
{
    const size_t m     = self->model->head.plant->m;
    size_t       found = m;

    for (size_t i = 0U; (self->model->pairs != 0U) && (i < m); i++) {
        found = guard_has(self->excluded, i) ? i : found;
    }
    return found;
}

/* Reduce the largest step.  @return false if what is left of the limit is too little for that. */
static bool update(blw_guard_t *self, descent_t *descent)
{
    const size_t     i       = descent->sensor;
    const size_t     j       = excluded_one(self);
    const blw_mask_t support = self->attacked | self->excluded;
    const bool several = guard_has(self->excluded, i) && (blw_mask_count(self->excluded) > 1U);
    const bool beside  = (j < self->model->head.plant->m) && (j != i);

    if (guard_has(self->attacked, i)) {
        descent->repeats++;
    }
    if (several || (descent->repeats > PATIENCE)) {
        if (update_jointly(self, support, descent->limit)
            || (several && update_jointly(self, self->excluded, descent->limit))) {
            return true;
        }
    }
    if ((self->updates + (beside ? 2U : 1U)) > descent->limit) {
        return false;
    }
    if (beside) {
        blw_guard_update_beside(self, i, j);
        self->updates = (uint16_t)(self->updates + 2U);
    } else {
        update_sensor(self, i);
    }
    return true;
}

/* Descend until nothing moves, the choice is clear, or the limit is reached.  @return whether
 * nothing moves. */
static bool descend(blw_guard_t *self, unsigned limit, descent_t *descent)
{
    const blw_real_t k       = self->model->k;
    bool             clear   = false;
    bool             renewed = false;

    descent->limit   = limit;
    descent->repeats = 0U;
    for (;;) {
        if (!descent->fresh) {
            survey(self, descent);
        }
        descent->fresh   = false;
        const bool still = descent->largest <= (TOLERANCE * k);
        if (still && descent->gross && !renewed) {
            blw_guard_multipliers(self->model, self->eta, self->l);
            renewed = true;
            continue;
        }
        if (!still && descent->decides && (self->updates > 0U)) {
            descent->chosen = blw_guard_choose(self, CLEAR * descent->largest, &clear);
        }
        if (clear) {
            return false;
        }
        descent->chosen = 0U;
        if (still || !update(self, descent)) {
            return still;
        }
        descent->gross = descent->gross || (descent->largest > (GROSS * k));
    }
}

/* l_I = 0 for the excluded sensors I. */
static void eliminate(blw_guard_t *self)
{
    const size_t m = self->model->head.plant->m;

    if (blw_mask_count(self->excluded) > 1U) {
        (void)blw_guard_newton(self, self->excluded);
        self->updates = (uint16_t)(self->updates + cost_of(self, self->excluded));
        return;
    }
    for (size_t i = 0U; i < m; i++) {
        if (guard_has(self->excluded, i)) {
            update_sensor(self, i);
        }
    }
}

/* Set k_I = 0 for a set of sensors I, and l_I to 0.  After a gross attack its rounding is removed from
 * l first: where tau_I starts makes no difference, so it starts from 0. */
static void exclude(blw_guard_t *self, blw_mask_t set, descent_t *descent)
{
    const blw_guard_model_t *const model = self->model;
    const size_t                   r     = model->r;

    self->excluded = set;
    for (size_t i = 0U; descent->gross && (i < model->head.plant->m); i++) {
        if (guard_has(set, i)) {
            blw_la_fill(r, BLW_R(0.0), &self->eta[i * r]);
        }
    }
    if (descent->gross) {
        blw_guard_multipliers(model, self->eta, self->l);
    }
    descent->gross = false;
    eliminate(self);
}

/* Solve on without the sensors of a set.  Unless pairs keep l_I = 0 all the time, the work for that
 * is kept back, since (8) would not hold otherwise. */
static bool descend_without(blw_guard_t *self, blw_mask_t set, unsigned limit, descent_t *descent)
{
    const unsigned cost = cost_of(self, set);
    const unsigned kept = (self->model->pairs != 0U) ? 0U : cost;

    if (set != self->excluded) {
        if ((self->updates + cost) > limit) {
            self->excluded = 0U;
            return false;
        }
        exclude(self, set, descent);
    }
    descent->decides     = false;
    const bool converged = descend(self, limit - kept, descent);
    if (!converged && (kept > 0U) && ((self->updates + kept) <= limit)) {
        eliminate(self);
    }
    return converged;
}

/* Exclude the sensor with the largest step at once if it stands out so far that the first descent
 * would end with that; else leave the choice to that descent, which may start from anywhere. */
static void exclude_at_once(blw_guard_t *self, descent_t *descent)
{
    const blw_guard_model_t *const model  = self->model;
    const blw_real_t               margin = AT_ONCE * model->k;

    if ((model->pairs == 0U) || !descent->decides) {
        return;
    }
    size_t           chosen  = 0U;
    const blw_real_t largest = blw_guard_largest(self, 0U, &chosen);
    if (!(largest > (model->exclude + model->k + margin))) {
        return;
    }
    descent->gross = largest > (GROSS * model->k);
    exclude(self, guard_bit(chosen), descent);
    survey(self, descent);
    size_t           i = 0U;
    const blw_real_t others =
        blw_la_max(model->exclude, blw_guard_largest(self, self->excluded, &i));
    descent->fresh = (self->h[chosen] - others) > margin;
    if (!descent->fresh) {
        self->excluded = 0U;
    }
}

/* The first descent, and what it excludes.  @return that set. */
static blw_mask_t find_excluded(blw_guard_t *self, unsigned limit, descent_t *descent,
                                bool *converged)
{
    const unsigned most  = self->model->max_updates;
    bool           clear = false;
    blw_mask_t     set   = 0U;

    exclude_at_once(self, descent);
    if (self->excluded != 0U) {
        return self->excluded;
    }
    *converged = descend(self, descent->decides ? limit : most, descent);
    if (descent->decides) {
        set =
            (descent->chosen != 0U) ? descent->chosen : blw_guard_choose(self, BLW_R(0.0), &clear);
    }
    if ((set == 0U) && !*converged) {
        descent->decides = false;
        *converged       = descend(self, most, descent);
    }
    return set;
}

blw_real_t blw_guard_solve(blw_guard_t *self, bool *converged)
{
    const blw_guard_model_t *const model   = self->model;
    const bool                     search  = model->search != 0U;
    const size_t                   N       = (size_t)model->head.plant->m * model->r;
    const unsigned                 most    = model->max_updates;
    descent_t                      descent = {.decides = self->warm_up == 0U};

    blw_la_copy(N, self->e, self->eta);
    const blw_mask_t set =
        find_excluded(self, search ? (most / 4U) : (most / 2U), &descent, converged);
    if (set != 0U) {
        *converged = descend_without(self, set, search ? (most / 2U) : most, &descent);
    }
    const bool unexplained = (self->attacked & ~self->excluded) != 0U;
    if ((set != 0U) && ((unexplained && search) || (model->search > 1U))) {
        const blw_mask_t known = unexplained ? 0U : set;

        blw_la_copy(N, self->e, self->eta);
        blw_guard_multipliers(model, self->eta, self->l);
        self->attacked = 0U;
        self->excluded = 0U;
        *converged     = descend_without(self, blw_guard_search(self, known), most, &descent);
    }
    return *converged ? descent.pending : blw_guard_bound(self);
}
