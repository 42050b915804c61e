/* SPDX-License-Identifier: MIT */
/* Block coordinate descent on (2), exclusion, and the bound on what is left.
 *
 * Since S_ii = diag(I, 0), the minimum over nu_i alone is (3), and with s = min(1, k_i / |h_i|) it
 * moves tau_i, and l_i, by
 *     step = s h_i - l_i.                                                                    (7)
 * tau is kept rather than nu: it stays at noise size however large the attack, and a sensor that
 * leaves the support gets tau_i = e_i exactly.  What a gross attack has left in l by rounding is
 * removed by computing l = S tau again once nothing moves any more.
 *
 * Bound.  With |t l_i| <= k, t = min(1, min k / |l_i|), the duality gap of (2) is
 *     gap = (1 - t)^2 l' S^+ l / 2 + sum_i (k |nu_i| - t l_i' nu_i),                         (8)
 * the minimiser is within |nu - nu*|_S^2 <= 2 gap, and with Gu x + W z = nu - nu*, x = Fu (nu - nu*):
 *     |x_hat - x*| <= kappa (2 f / k + omega (2 gap)^(1/2)) + sigma (2 gap)^(1/2),           (9)
 * because sum_i k |nu_i| and sum_i k |nu_i*| are both at most the objective f. */
#include "blw_guard_internal.h"
#include "blw_la.h"

/* Largest |step| that ends the descent, relative to k. */
#define TOLERANCE (BLW_R(256.0) * BLW_REAL_EPS)

/* |e_i - tau_i| / k above which rounding in l would show. */
#define GROSS BLW_R(32.0)

/* Sensors may come up for another update so many times before Newton steps are tried. */
#define PATIENCE 3U

typedef struct descent {
    blw_real_t pending; /* sum over the sensors of effect_i |step_i| */
    blw_real_t largest; /* largest |step_i| */
    size_t     sensor;  /* whose it is */
    bool       gross;   /* l holds the rounding of a gross attack */
    bool       renewed; /* l has been computed again already */
    unsigned   repeats; /* updates of sensors that had had one */
} descent_t;

static blw_real_t threshold_of(const blw_guard_t *self, size_t i)
{
    return guard_has(self->excluded, i) ? BLW_R(0.0) : self->model->k;
}

/* s of (7) from |h_i|. */
static blw_real_t shrink(blw_real_t h, blw_real_t k)
{
    return (h > k) ? (k / h) : BLW_R(1.0);
}

/* |step| of (7) for sensor i; also notes |h_i|. */
static blw_real_t step_length(blw_guard_t *self, size_t i)
{
    const size_t            r = self->model->r;
    const blw_real_t *const l = &self->l[i * r];

    if (!guard_has(self->attacked, i)) { /* h = l */
        self->h[i] = blw_la_norm(r, l);
        return blw_la_max(BLW_R(0.0), self->h[i] - threshold_of(self, i));
    }
    const blw_real_t *const e   = &self->e[i * r];
    const blw_real_t *const tau = &self->eta[i * r];
    blw_real_t              sum = BLW_R(0.0);
    for (size_t a = 0U; a < r; a++) {
        const blw_real_t h = l[a] + (e[a] - tau[a]);
        sum += h * h;
    }
    self->h[i]         = blw_la_sqrt(sum);
    const blw_real_t s = shrink(self->h[i], threshold_of(self, i));
    sum                = BLW_R(0.0);
    for (size_t a = 0U; a < r; a++) {
        const blw_real_t step = (s * (l[a] + (e[a] - tau[a]))) - l[a];
        sum += step * step;
    }
    return blw_la_sqrt(sum);
}

static void survey(blw_guard_t *self, descent_t *descent)
{
    descent->pending = BLW_R(0.0);
    descent->largest = BLW_R(0.0);
    for (size_t i = 0U; i < self->model->head.plant->m; i++) {
        const blw_real_t length = step_length(self, i);

        descent->pending += self->model->effect[i] * length;
        if (length > descent->largest) {
            descent->largest = length;
            descent->sensor  = i;
        }
    }
}

/* (7) for sensor i. */
static void update_sensor(blw_guard_t *self, size_t i)
{
    const size_t            r   = self->model->r;
    const blw_real_t *const e   = &self->e[i * r];
    blw_real_t *const       l   = &self->l[i * r];
    blw_real_t *const       tau = &self->eta[i * r];
    const blw_real_t        s   = shrink(self->h[i], threshold_of(self, i));

    for (size_t a = 0U; a < r; a++) {
        const blw_real_t clipped = s * (l[a] + (e[a] - tau[a]));

        self->step[a] = clipped - l[a];
        l[a]          = clipped;
        tau[a] += self->step[a];
    }
    self->attacked |= guard_bit(i);
    if (!(self->h[i] > threshold_of(self, i))) {
        blw_la_copy(r, e, tau);
        self->attacked &= ~guard_bit(i);
    }
    blw_guard_spread(self->model, i, self->step, self->l);
}

/* Try a Newton step on all sensors of the support; if it is too large for L, or the step is not
 * within reach of the quadratic model, on the excluded ones alone, where it is exact.  @return
 * whether anything was done. */
static bool update_jointly(blw_guard_t *self)
{
    const blw_mask_t support = self->attacked | self->excluded;
    const bool       several = blw_mask_count(self->excluded) > 1U;

    if ((blw_mask_count(support) > 1U) && (blw_mask_count(support) <= self->model->most)
        && blw_guard_newton(self, support)) {
        return true;
    }
    return several && blw_guard_newton(self, self->excluded);
}

static void update(blw_guard_t *self, descent_t *descent)
{
    const size_t i       = descent->sensor;
    const bool   several = guard_has(self->excluded, i) && (blw_mask_count(self->excluded) > 1U);
    bool         again   = false;

    if (guard_has(self->attacked, i)) {
        again = (descent->repeats >= PATIENCE);
        descent->repeats++;
    }
    if (!((several || again) && update_jointly(self))) {
        update_sensor(self, i);
    }
    self->updates++;
}

/* Descend until nothing moves or `limit` updates were made in this step.  @return what is
 * pending. */
static blw_real_t descend(blw_guard_t *self, unsigned limit, bool *converged)
{
    const blw_real_t k       = self->model->k;
    descent_t        descent = {.gross = false};

    for (;;) {
        survey(self, &descent);
        *converged = descent.largest <= (TOLERANCE * k);
        if (*converged && descent.gross && !descent.renewed) {
            blw_guard_multipliers(self->model, self->eta, self->l);
            descent.renewed = true;
            continue;
        }
        if (*converged || (self->updates >= limit)) {
            return descent.pending;
        }
        descent.gross = descent.gross || (descent.largest > (GROSS * k));
        update(self, &descent);
    }
}

/* The p units with the largest |h_i| above the threshold, as sensors. */
static blw_mask_t choose_excluded(const blw_guard_t *self)
{
    const blw_guard_model_t *const model  = self->model;
    const size_t                   m      = model->head.plant->m;
    blw_mask_t                     chosen = 0U;

    for (size_t taken = 0U; taken < model->head.plant->p; taken++) {
        blw_real_t largest = model->exclude;
        size_t     sensor  = m;

        for (size_t i = 0U; i < m; i++) {
            if (!guard_has(chosen, i) && (self->h[i] > largest)) {
                largest = self->h[i];
                sensor  = i;
            }
        }
        for (size_t i = 0U; (sensor < m) && (i < m); i++) {
            chosen |= (model->unit[i] == model->unit[sensor]) ? guard_bit(i) : 0U;
        }
    }
    return chosen;
}

/* Updates that may have been made after the first and after the second descent of a step, the rest
 * being for what follows; one is kept back for l_I = 0, without which (8) would not hold. */
static unsigned limit_of(const blw_guard_model_t *model, unsigned stage)
{
    const unsigned most = model->max_updates;

    if (model->search != 0U) {
        return (stage * most) / 4U;
    }
    return (most > (3U - stage)) ? (most - (3U - stage)) : 0U;
}

static blw_real_t descend_without(blw_guard_t *self, blw_mask_t set, unsigned limit,
                                  bool *converged)
{
    self->excluded = set;
    return descend(self, limit, converged);
}

/* Search all sets, and solve again from the start without the best one. */
static blw_real_t descend_after_search(blw_guard_t *self, bool *converged)
{
    const size_t   N     = (size_t)self->model->head.plant->m * self->model->r;
    const unsigned limit = (unsigned)self->model->max_updates - 1U;

    blw_la_copy(N, self->e, self->eta);
    blw_guard_multipliers(self->model, self->eta, self->l);
    self->attacked = 0U;
    return descend_without(self, blw_guard_search(self), limit, converged);
}

/* Make sure of l_I = 0 where the descent has been cut off. */
static void finish(blw_guard_t *self)
{
    if ((self->excluded == 0U) || (self->updates >= self->model->max_updates)) {
        return;
    }
    (void)blw_guard_newton(self, self->excluded);
    self->updates++;
}

/* (9); BLW_REAL_MAX if there is none. */
static blw_real_t bound_of(const blw_guard_t *self)
{
    const blw_guard_model_t *const model   = self->model;
    const size_t                   r       = model->r;
    const size_t                   m       = model->head.plant->m;
    blw_real_t                     t       = BLW_R(1.0);
    blw_real_t                     penalty = BLW_R(0.0);
    blw_real_t                     l_nu    = BLW_R(0.0);
    blw_real_t                     energy  = blw_la_dot(m * r, self->l, self->eta);

    for (size_t i = 0U; i < m; i++) {
        if (guard_has(self->excluded, i)) {
            continue;
        }
        blw_real_t nu = BLW_R(0.0);
        for (size_t a = i * r; a < ((i + 1U) * r); a++) {
            const blw_real_t nu_a = self->e[a] - self->eta[a];
            nu += nu_a * nu_a;
            l_nu += self->l[a] * nu_a;
        }
        penalty += model->k * blw_la_sqrt(nu);
        const blw_real_t l = blw_la_norm(r, &self->l[i * r]);
        t                  = ((t * l) > model->k) ? (model->k / l) : t;
    }
    energy                = BLW_R(0.5) * blw_la_max(BLW_R(0.0), energy);
    const blw_real_t rest = ((BLW_R(1.0) - t) * (BLW_R(1.0) - t) * energy) + (penalty - (t * l_nu));
    const blw_real_t root = blw_la_sqrt(BLW_R(2.0) * blw_la_max(BLW_R(0.0), rest));
    const blw_real_t size = (BLW_R(2.0) * (energy + penalty)) / model->k;
    const blw_real_t most = (model->kappa * (size + (model->omega * root))) + (model->sigma * root);
    const bool       none = (model->n_u > 0U) && !(model->kappa > BLW_R(0.0));
    return (!none && (most <= BLW_REAL_MAX)) ? most : BLW_REAL_MAX;
}

blw_real_t blw_guard_solve(blw_guard_t *self, bool *converged)
{
    const blw_guard_model_t *const model   = self->model;
    const size_t                   N       = (size_t)model->head.plant->m * model->r;
    blw_real_t                     pending = BLW_R(0.0);

    blw_la_copy(N, self->e, self->eta);
    pending              = descend(self, limit_of(model, 1U), converged);
    const blw_mask_t set = (self->warm_up > 0U) ? 0U : choose_excluded(self);
    if (set != 0U) {
        pending = descend_without(self, set, limit_of(model, 2U), converged);
    }
    const bool unexplained = (self->attacked & ~self->excluded) != 0U;
    if ((set != 0U) && unexplained && (model->search != 0U)) {
        pending = descend_after_search(self, converged);
    }
    if (*converged) {
        return pending;
    }
    finish(self);
    return bound_of(self);
}
