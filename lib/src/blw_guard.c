/* SPDX-License-Identifier: MIT */
#include "blw/blw_guard.h"
#include "blw_cold.h"
#include "blw_guard_internal.h"
#include "blw_guard_strips.h"
#include "blw_la.h"
#include "blw_step.h"

static BLW_COLD size_t mem_len_of(const blw_guard_model_t *model)
{
    const blw_plant_t *const plant = model->head.plant;

    return BLW_GUARD_MEM(plant->n, plant->m, model->r, model->most);
}

static void bind(blw_guard_t *self, const blw_guard_model_t *model, blw_real_t *mem)
{
    const size_t n = model->head.plant->n;
    const size_t m = model->head.plant->m;
    const size_t N = m * model->r;

    self->base.ops  = &blw_guard_ops;
    self->model     = model;
    self->eta       = blw_la_take(&mem, N);
    self->e         = blw_la_take(&mem, N);
    self->l         = blw_la_take(&mem, N);
    self->average   = blw_la_take(&mem, N);
    self->h         = blw_la_take(&mem, m);
    self->suspicion = blw_la_take(&mem, m);
    self->x_bar     = blw_la_take(&mem, n);
    self->x_ref     = blw_la_take(&mem, n);
    self->x_hat     = blw_la_take(&mem, n);
    self->d         = blw_la_take(&mem, n);
    self->step      = blw_la_take(&mem, (size_t)model->most * model->r);
    self->turned    = blw_la_take(&mem, 4U * (size_t)model->r);
    self->L         = mem;
    self->all       = BLW_MASK_ALL(m);
}

BLW_COLD blw_status_t blw_guard_init(blw_guard_t *self, const blw_guard_model_t *model,
                                     blw_real_t *mem, size_t mem_len)
{
    if ((self == NULL) || (model == NULL) || (mem == NULL)) {
        return BLW_ERR_ARG;
    }
    const blw_status_t status = blw_guard_check(model);
    if (status != BLW_OK) {
        return status;
    }
    if (mem_len < mem_len_of(model)) {
        return BLW_ERR_MEM;
    }
    bind(self, model, mem);
    return blw_guard_reset(self, NULL);
}

BLW_COLD blw_status_t blw_guard_reset(blw_guard_t *self, const blw_real_t *x0)
{
    if (self == NULL) {
        return BLW_ERR_ARG;
    }
    const blw_plant_t *const plant = self->model->head.plant;
    const blw_real_t *const  start = (x0 != NULL) ? x0 : plant->x0;
    const size_t             N     = (size_t)plant->m * self->model->r;
    if (!blw_la_bounded(plant->n, start)) {
        return BLW_ERR_ARG;
    }
    blw_la_copy(plant->n, start, self->x_ref);
    blw_la_copy(plant->n, start, self->x_hat);
    blw_la_zero(N, self->eta);
    blw_la_zero(N, self->average);
    self->warm_up = self->model->warm_up;
    return BLW_OK;
}

/* l = S e, h_i = |l_i| and the largest square; a NaN or an infinity in l makes that infinite or
 * NaN.  After a gross attack l = S tau instead, for the solver. */
static blw_real_t test(blw_guard_t *self)
{
    const size_t     m       = self->model->head.plant->m;
    const blw_mask_t gross   = blw_guard_gross(self);
    blw_real_t       largest = BLW_R(0.0);
    blw_real_t       all     = BLW_R(0.0);

    if (gross != 0U) {
        return blw_guard_test_without(self, gross);
    }
    self->attacked = 0U;
    blw_guard_multipliers(self->model, self->e, self->l);
    blw_guard_squares(self->model, self->l, self->h);
    for (size_t i = 0U; i < m; i++) {
        const blw_real_t square = self->h[i];

        self->h[i] = blw_la_sqrt(square);
        all += square;
        largest = blw_la_max(largest, square);
    }
    return (all <= BLW_REAL_MAX) ? largest : all;
}

/* A local filter that a sample has thrown out of bounds starts again from the reference, and the
 * sample counts as missing.  @return the samples that were taken in. */
static blw_mask_t mend(blw_guard_t *self, blw_mask_t used)
{
    const size_t r     = self->model->r;
    blw_mask_t   taken = used;

    for (size_t i = 0U; i < self->model->head.plant->m; i++) {
        if (!blw_la_bounded(r, &self->e[i * r])) {
            blw_la_zero(r, &self->e[i * r]);
            taken &= ~guard_bit(i);
        }
    }
    return taken;
}

/* x_ref of (4) and eta of (5) from tau. */
static void move_reference(blw_guard_t *self, const blw_real_t *tau)
{
    const blw_guard_model_t *const model = self->model;
    const size_t                   n     = model->head.plant->n;
    const size_t                   n_u   = model->n_u;
    const size_t                   N     = (size_t)model->head.plant->m * model->r;

    blw_la_zero(n, self->d);
    blw_guard_mul(n_u, N, 0U, N, model->Fu, tau, self->d);
    if (n_u == n) {
        blw_la_sum(n, self->x_bar, self->d, self->x_ref);
    } else {
        blw_la_copy(n, self->x_bar, self->x_ref);
        blw_la_gemv_add(n, n_u, model->Xu, self->d, self->x_ref);
    }
    for (size_t j = 0U; j < n_u; j++) {
        self->d[j] = -self->d[j];
    }
    if (n_u > 0U) {
        blw_guard_mul_t(n_u, N, 0U, N, model->Gu, self->d, self->e, self->eta);
    } else {
        blw_la_copy(N, self->e, self->eta);
    }
}

/* (4) and (5) from tau and l. */
static void fuse(blw_guard_t *self, const blw_real_t *tau)
{
    const blw_guard_model_t *const model = self->model;
    const size_t                   n     = model->head.plant->n;
    const size_t                   n_s   = n - model->n_u;
    const size_t                   N     = (size_t)model->head.plant->m * model->r;

    if (model->fuse != NULL) {
        model->fuse(tau, self->e, self->x_bar, self->x_ref, self->eta);
    } else {
        move_reference(self, tau);
    }
    blw_la_copy(n, self->x_ref, self->x_hat);
    if (n_s > 0U) {
        blw_la_zero(n_s, self->d);
        blw_guard_mul(n_s, N, 0U, N, model->Sig, self->l, self->d);
        blw_la_gemv_add(n, n_s, model->Xs, self->d, self->x_hat);
    }
}

/* Start again from the prediction; only samples at the limit of the numbers lead here. */
static void restart(blw_guard_t *self)
{
    const size_t n = self->model->head.plant->n;
    const size_t N = (size_t)self->model->head.plant->m * self->model->r;

    blw_la_copy(n, self->x_bar, self->x_ref);
    blw_la_copy(n, self->x_bar, self->x_hat);
    blw_la_zero(N, self->eta);
    blw_la_zero(N, self->average);
}

/* Advance the averages of l. */
static void average(const blw_guard_model_t *model, const blw_real_t *l, blw_real_t *mean,
                    blw_real_t *squares)
{
    const size_t     N    = (size_t)model->head.plant->m * model->r;
    const blw_real_t gain = model->gain;

    if (model->average != NULL) {
        model->average(l, mean, squares);
        return;
    }
    for (size_t a = 0U; a < N; a++) {
        mean[a] = mean[a] + (gain * (l[a] - mean[a]));
    }
    blw_guard_squares(model, mean, squares);
}

/* s / (k + s) with s = |h_i|, or what the slow average says if that is more. */
static void judge_sensors(blw_guard_t *self, blw_mask_t used)
{
    const blw_guard_model_t *const model = self->model;
    const blw_real_t *const        drift = model->drift;
    const size_t                   m     = model->head.plant->m;
    blw_real_t *const              found = self->suspicion;

    average(model, self->l, self->average, found);
    for (size_t i = 0U; i < m; i++) {
        blw_real_t s = self->h[i];

        if (!(found[i] <= (drift[i] * drift[i]))) {
            s = blw_la_max(s, (model->k * blw_la_sqrt(found[i])) / drift[i]);
        }
        found[i] = s / (s + model->k);
    }
    for (size_t i = 0U; (used != self->all) && (i < m); i++) {
        if (!guard_has(used, i)) {
            found[i] = BLW_R(1.0);
        }
    }
}

static void report(blw_guard_t *self, blw_mask_t used, blw_estimator_out_t *out)
{
    out->x_hat      = self->x_hat;
    out->suspicion  = self->suspicion;
    out->threshold  = self->model->k;
    out->excluded   = self->excluded;
    out->used       = used;
    out->iterations = self->updates;
    out->flags      = 0U;
    if ((used != self->all) || (self->excluded != 0U)) {
        out->flags = blw_step_flags(self->model->head.plant, used, self->excluded);
    }
    if (self->warm_up > 0U) {
        self->warm_up--;
        out->flags = (uint8_t)(out->flags | BLW_FLAG_WARMING_UP);
    }
}

/* (2) from an l that fails the certificate; fills outcome and bound. */
static BLW_APART void solve(blw_guard_t *self, blw_estimator_out_t *out)
{
    bool converged = true;

    out->bound = self->model->solver->solve(self, &converged);
    if (!(out->bound <= BLW_REAL_MAX)) { /* only at the limit of the numbers */
        out->bound = BLW_REAL_MAX;
        converged  = false;
    }
    out->outcome = (uint8_t)(converged ? BLW_OUTCOME_CONVERGED : BLW_OUTCOME_BOUND);
}

/* Everything between (1) and (5); fills the outcome, statistic and bound. */
static void decide(blw_guard_t *self, blw_mask_t *used, blw_estimator_out_t *out)
{
    const blw_real_t  k       = self->model->k;
    const blw_real_t *tau     = self->e;
    blw_real_t        largest = test(self);

    self->excluded = 0U;
    self->updates  = 0U;
    if (!(largest <= (BLW_SIGNAL_MAX * BLW_SIGNAL_MAX))) {
        *used   = mend(self, *used);
        largest = test(self);
    }
    out->statistic = blw_la_sqrt(largest);
    out->bound     = BLW_R(0.0);
    out->outcome   = (uint8_t)BLW_OUTCOME_KALMAN;
    if (!(largest <= (k * k)) || (self->attacked != 0U)) {
        solve(self, out);
        tau = self->eta;
    }
    fuse(self, tau);
}

/* (1) in the usual case: every sample is there and nothing is near a bound. */
static bool advance_quickly(blw_guard_t *self, const blw_real_t *u, const blw_real_t *y,
                            blw_mask_t valid)
{
    const blw_guard_model_t *const   model   = self->model;
    const blw_plant_t *const         plant   = model->head.plant;
    const blw_guard_advance_kernel_t kernel  = model->advance;
    const bool                       regular = (y != NULL) && ((u != NULL) || (plant->l == 0U));

    return (kernel != NULL) && regular && (valid == self->all)
           && kernel(u, y, self->x_ref, self->eta, self->x_bar, self->e);
}

/* (1) in general.  *used: the samples taken in. */
static blw_status_t advance_checked(blw_guard_t *self, const blw_real_t *u, const blw_real_t *y,
                                    blw_mask_t valid, blw_mask_t *used)
{
    const blw_plant_t *const plant  = self->model->head.plant;
    const blw_status_t       status = blw_step_check(plant, u, y, valid);

    if (status != BLW_OK) {
        return status;
    }
    *used = blw_plant_screen(plant, y, valid);
    blw_plant_predict(plant, self->x_ref, u, self->x_bar);
    blw_guard_advance(self, y, *used);
    return BLW_OK;
}

blw_status_t blw_guard_step(blw_guard_t *self, const blw_real_t *u, const blw_real_t *y,
                            blw_mask_t valid, blw_estimator_out_t *out)
{
    if ((self == NULL) || (out == NULL)) {
        return BLW_ERR_ARG;
    }
    blw_mask_t used = valid;
    if (!advance_quickly(self, u, y, valid)) {
        const blw_status_t status = advance_checked(self, u, y, valid, &used);
        if (status != BLW_OK) {
            return status;
        }
    }
    decide(self, &used, out);
    judge_sensors(self, used);
    if (!blw_la_bounded(self->model->head.plant->n, self->x_hat)) {
        restart(self);
        used = 0U;
    }
    report(self, used, out);
    return BLW_OK;
}

/* The four adapters rely on the base, and the head, being the first member (deviation D-1). */
static BLW_COLD size_t ops_mem_len(const blw_model_t *model)
{
    if ((model == NULL) || (model->method != (uint8_t)BLW_METHOD_GUARD) || (model->plant == NULL)) {
        return 0U;
    }
    return mem_len_of((const blw_guard_model_t *)(const void *)model);
}

static BLW_COLD blw_status_t ops_init(blw_estimator_t *self, const blw_model_t *model,
                                      blw_real_t *mem, size_t mem_len)
{
    return blw_guard_init((blw_guard_t *)(void *)self,
                          (const blw_guard_model_t *)(const void *)model, mem, mem_len);
}

static BLW_COLD blw_status_t ops_reset(blw_estimator_t *self, const blw_real_t *x0)
{
    return blw_guard_reset((blw_guard_t *)(void *)self, x0);
}

static BLW_COLD blw_status_t ops_step(blw_estimator_t *self, const blw_real_t *u,
                                      const blw_real_t *y, blw_mask_t valid,
                                      blw_estimator_out_t *out)
{
    return blw_guard_step((blw_guard_t *)(void *)self, u, y, valid, out);
}

const blw_estimator_ops_t blw_guard_ops = {
    .method     = BLW_METHOD_GUARD,
    .state_size = sizeof(blw_guard_t),
    .mem_len    = ops_mem_len,
    .init       = ops_init,
    .reset      = ops_reset,
    .step       = ops_step,
};
