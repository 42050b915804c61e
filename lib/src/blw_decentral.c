/* SPDX-License-Identifier: MIT */
#include "blw/blw_decentral.h"
#include "blw_cold.h"
#include "blw_decentral_internal.h"
#include "blw_la.h"
#include "blw_step.h"

/* An innovation is cut to so many times its own threshold: squares of what follows stay finite. */
#define INNOVATION_MAX BLW_R(3e8)

/* Steps in a row without suspicion after which excluded sensors seem to tell the truth. */
#define CALM_STEPS 4U

/* Times the threshold: what the plant does that its model does not know stays below. */
#define FAR_OFF BLW_R(4.0)

static BLW_COLD size_t mem_len_of(const blw_decentral_model_t *model)
{
    const blw_plant_t *const plant = model->head.plant;

    return BLW_DECENTRAL_MEM(plant->n, plant->m, model->mu, model->rows,
                             (model->steady == NULL) ? 1 : 0);
}

static void bind(blw_decentral_t *self, blw_real_t *mem)
{
    const blw_decentral_model_t *const model  = self->model;
    const size_t                       n      = model->head.plant->n;
    const size_t                       m      = model->head.plant->m;
    const size_t                       mu     = model->mu;
    const bool                         steady = model->steady != NULL;

    self->x_hat     = blw_la_take(&mem, n);
    self->x_bar     = blw_la_take(&mem, n);
    self->dx        = blw_la_take(&mem, n);
    self->nu        = blw_la_take(&mem, m);
    self->gap       = blw_la_take(&mem, m);
    self->suspicion = blw_la_take(&mem, m);
    self->delta     = blw_la_take(&mem, mu);
    self->z         = blw_la_take(&mem, mu);
    self->w         = blw_la_take(&mem, steady ? (mu - n) : (mu + n + m));
    self->t         = steady ? mem : NULL;
    self->L         = steady ? NULL : blw_la_take(&mem, blw_la_packed_row(mu));
    self->X         = steady ? NULL : mem;
}

BLW_COLD blw_status_t blw_decentral_init(blw_decentral_t *self, const blw_decentral_model_t *model,
                                         blw_real_t *mem, size_t mem_len)
{
    if ((self == NULL) || (model == NULL) || (mem == NULL)) {
        return BLW_ERR_ARG;
    }
    const blw_status_t status = blw_decentral_check(model);
    if (status != BLW_OK) {
        return status;
    }
    if (mem_len < mem_len_of(model)) {
        return BLW_ERR_MEM;
    }
    self->base.ops = &blw_decentral_ops;
    self->model    = model;
    bind(self, mem);
    return blw_decentral_reset(self, NULL);
}

BLW_COLD blw_status_t blw_decentral_reset(blw_decentral_t *self, const blw_real_t *x0)
{
    if (self == NULL) {
        return BLW_ERR_ARG;
    }
    const blw_plant_t *const plant = self->model->head.plant;
    const blw_real_t *const  start = (x0 != NULL) ? x0 : plant->x0;
    if (!blw_la_bounded(plant->n, start)) {
        return BLW_ERR_ARG;
    }
    blw_la_copy(plant->n, start, self->x_hat);
    blw_la_zero(self->model->mu, self->delta);
    blw_la_zero(plant->m, self->gap);
    self->k      = 0U;
    self->set    = 0U;
    self->passes = 0U;
    self->calm   = 0U;
    self->usable = true;
    if (self->model->gains->reset != NULL) {
        self->model->gains->reset(self);
    }
    return BLW_OK;
}

/* The sample of a sensor is there. */
static void hear(blw_decentral_t *self, size_t i, blw_real_t y_i)
{
    const blw_plant_t *const plant = self->model->head.plant;
    const blw_real_t         y_bar = blw_la_dot(plant->n, &plant->C[i * plant->n], self->x_bar);
    const blw_real_t         nu    = (y_i - plant->offset[i]) - y_bar;
    const blw_real_t         e     = blw_la_abs(nu) * self->model->scale[i];

    self->nu[i]        = (e > INNOVATION_MAX) ? (nu * (INNOVATION_MAX / e)) : nu;
    self->suspicion[i] = blw_step_suspicion(e * e);
    self->gap[i]       = BLW_R(0.0);
}

/* nu_i, suspicion and gap of every sensor; nu_i = 0 where the sample is missing.
 * @return the sensors that have been missing for longer than a filter should coast */
static blw_mask_t innovate(blw_decentral_t *self, const blw_real_t *y, blw_mask_t used)
{
    const blw_real_t max_gap = (blw_real_t)self->model->max_gap;
    blw_mask_t       silent  = 0U;
    blw_mask_t       bit     = 1U;

    for (size_t i = 0U; i < self->model->head.plant->m; i++) {
        if ((used & bit) != 0U) {
            hear(self, i, y[i]);
        } else {
            self->nu[i]        = BLW_R(0.0);
            self->suspicion[i] = BLW_R(1.0);
            if (self->gap[i] < max_gap) {
                self->gap[i] += BLW_R(1.0);
            } else {
                silent |= bit;
            }
        }
        bit <<= 1;
    }
    return silent;
}

static void exclude(blw_decentral_t *self, size_t set)
{
    self->set    = (uint16_t)set;
    self->passes = 0U;
    self->calm   = 0U;
}

/* Passes of all sensors in a row; a sensor that is not heard cannot earn its return. */
static void count_passes(blw_decentral_t *self, bool pass, blw_mask_t used)
{
    const blw_mask_t out = blw_decentral_members(self->model->sets, self->set);

    if (!pass) {
        self->passes = 0U;
    } else if (((out & ~used) == 0U) && (self->passes < self->model->readmit)) {
        self->passes++;
    }
}

/* Steps in a row in which no excluded sensor contradicts the prediction. */
static void count_calm(blw_decentral_t *self)
{
    const blw_decentral_sets_t *const sets = self->model->sets;
    bool                              calm = self->set != 0U;

    for (size_t rest = self->set; rest != 0U; rest = sets->parent[rest]) {
        calm = calm && (self->suspicion[sets->sensor[rest]] <= BLW_R(0.5));
    }
    if (!calm) {
        self->calm = 0U;
    } else if (self->calm < CALM_STEPS) {
        self->calm++;
    }
}

/* Leave out sensors that fell silent, unless an attacked one is: silence is no lie. */
static BLW_COLD void leave_out_silent(blw_decentral_t *self, blw_mask_t silent)
{
    const blw_decentral_sets_t *const sets = self->model->sets;
    const bool                        free = (self->set == 0U) || (self->calm >= CALM_STEPS);

    if (free && self->usable && ((silent & ~blw_decentral_members(sets, self->set)) != 0U)) {
        exclude(self, blw_decentral_cover(sets, silent));
    }
}

/* Silent sensors that a new set has to contain: all of them while that leaves one to spare for an
 * attack, else those that are left out already. */
static BLW_COLD blw_mask_t needed_of(const blw_decentral_t *self, blw_mask_t silent)
{
    const bool spare = blw_mask_count(silent) < self->model->head.plant->p;

    return spare ? silent : (silent & blw_decentral_members(self->model->sets, self->set));
}

/* The estimate without the sensors that are left out.  @return their g_J */
static blw_real_t fuse(blw_decentral_t *self)
{
    const blw_real_t g = self->model->gains->statistic(self, self->set);

    self->model->gains->estimate(self, self->set);
    return g;
}

static bool fits(blw_decentral_t *self, size_t set, blw_real_t slack)
{
    const blw_real_t g = self->model->gains->statistic(self, set);

    return g <= (slack * blw_decentral_threshold(self->model, set));
}

/* Where every set with the silent sensors is far off, what these told last may say who lies. */
static BLW_COLD size_t best_set(blw_decentral_t *self, blw_mask_t needed, uint16_t *compared)
{
    const size_t best = blw_decentral_search(self, needed, compared);

    if ((needed == 0U) || fits(self, best, FAR_OFF)) {
        return best;
    }
    uint16_t     others = 0U;
    const size_t other  = blw_decentral_search(self, 0U, &others);

    *compared = (uint16_t)(*compared + others);
    return fits(self, other, BLW_R(1.0)) ? other : best;
}

static blw_outcome_t search(blw_decentral_t *self, blw_mask_t needed, uint16_t *compared)
{
    const size_t best = best_set(self, needed, compared);

    if (best != self->set) {
        exclude(self, best);
    }
    return (fuse(self) <= blw_decentral_threshold(self->model, best)) ? BLW_OUTCOME_CONVERGED
                                                                      : BLW_OUTCOME_HELD;
}

/* Fusion, test and choice of the set; fills in what *out says about them. */
static blw_outcome_t decide(blw_decentral_t *self, blw_mask_t used, blw_mask_t silent,
                            blw_estimator_out_t *out)
{
    const blw_decentral_model_t *const model = self->model;

    out->threshold = blw_decentral_threshold(model, 0U);
    leave_out_silent(self, silent);
    const blw_real_t g = fuse(self);
    out->statistic     = (self->set == 0U) ? g : self->model->gains->all_statistic(self, self->set);
    const bool pass    = out->statistic <= out->threshold;
    count_passes(self, pass, used);
    if ((self->k <= model->warm_up) || !self->usable) {
        out->flags = BLW_FLAG_WARMING_UP;
        return BLW_OUTCOME_KALMAN;
    }
    if ((self->set != 0U) && (model->readmit > 0U) && (self->passes >= model->readmit)) {
        exclude(self, 0U);
        (void)fuse(self);
        return BLW_OUTCOME_KALMAN;
    }
    const blw_mask_t needed  = needed_of(self, silent);
    const bool       covered = (needed & ~blw_decentral_members(model->sets, self->set)) == 0U;
    if (covered && (g <= blw_decentral_threshold(model, self->set))) {
        return (self->set == 0U) ? BLW_OUTCOME_KALMAN : BLW_OUTCOME_CONVERGED;
    }
    if (used == 0U) { /* nothing new is known, and what the filters do by themselves is no reason */
        return BLW_OUTCOME_HELD;
    }
    return search(self, needed, &out->iterations);
}

/* (2), or the prediction if the fusion overflows. */
static blw_mask_t update(blw_decentral_t *self, blw_mask_t used)
{
    const size_t n  = self->model->head.plant->n;
    const size_t mu = self->model->mu;

    blw_la_sum(n, self->x_bar, self->dx, self->x_hat);
    if (!blw_la_bounded(n, self->x_hat)) {
        blw_la_copy(n, self->x_bar, self->x_hat);
        blw_la_zero(mu, self->delta);
        return 0U;
    }
    for (size_t j = 0U; j < n; j++) { /* delta -= Phi dx; the next fusion forms dx anew */
        self->dx[j] = -self->dx[j];
    }
    blw_la_gemv_add(mu, n, self->model->Phi, self->dx, self->delta);
    return used;
}

static void report(const blw_decentral_t *self, blw_outcome_t outcome, blw_mask_t used,
                   blw_estimator_out_t *out)
{
    out->x_hat     = self->x_hat;
    out->suspicion = self->suspicion;
    out->excluded  = blw_decentral_members(self->model->sets, self->set);
    out->used      = used;
    out->outcome   = (uint8_t)outcome;
    out->flags |= blw_step_flags(self->model->head.plant, used, out->excluded);
}

blw_status_t blw_decentral_step(blw_decentral_t *self, const blw_real_t *u, const blw_real_t *y,
                                blw_mask_t valid, blw_estimator_out_t *out)
{
    if ((self == NULL) || (out == NULL)) {
        return BLW_ERR_ARG;
    }
    const blw_plant_t *const plant  = self->model->head.plant;
    const blw_status_t       status = blw_step_check(plant, u, y, valid);
    if (status != BLW_OK) {
        return status;
    }
    blw_mask_t used = blw_plant_screen(plant, y, valid);

    out->bound      = BLW_R(0.0);
    out->iterations = 0U;
    out->flags      = 0U;
    self->k += (self->k <= self->model->warm_up) ? 1U : 0U;
    blw_plant_predict(plant, self->x_hat, u, self->x_bar);
    const blw_mask_t silent = innovate(self, y, used);
    self->model->gains->advance(self);
    const blw_outcome_t outcome = decide(self, used, silent, out);
    count_calm(self);
    if ((self->model->reseed != 0U) && (self->calm >= CALM_STEPS)
        && !(out->statistic <= out->threshold)) {
        self->model->gains->reseed(self, self->set);
        self->calm = 0U;
    }
    used = update(self, used);
    report(self, outcome, used, out);
    return BLW_OK;
}

static BLW_COLD size_t ops_mem_len(const blw_model_t *model)
{
    if ((model == NULL) || (model->plant == NULL)
        || (model->method != (uint8_t)BLW_METHOD_DECENTRAL)) {
        return 0U;
    }
    return mem_len_of((const blw_decentral_model_t *)(const void *)model);
}

static BLW_COLD blw_status_t ops_init(blw_estimator_t *self, const blw_model_t *model,
                                      blw_real_t *mem, size_t mem_len)
{
    return blw_decentral_init((blw_decentral_t *)(void *)self,
                              (const blw_decentral_model_t *)(const void *)model, mem, mem_len);
}

static BLW_COLD blw_status_t ops_reset(blw_estimator_t *self, const blw_real_t *x0)
{
    return blw_decentral_reset((blw_decentral_t *)(void *)self, x0);
}

static BLW_COLD blw_status_t ops_step(blw_estimator_t *self, const blw_real_t *u,
                                      const blw_real_t *y, blw_mask_t valid,
                                      blw_estimator_out_t *out)
{
    return blw_decentral_step((blw_decentral_t *)(void *)self, u, y, valid, out);
}

const blw_estimator_ops_t blw_decentral_ops = {
    .method     = BLW_METHOD_DECENTRAL,
    .state_size = sizeof(blw_decentral_t),
    .mem_len    = ops_mem_len,
    .init       = ops_init,
    .reset      = ops_reset,
    .step       = ops_step,
};
