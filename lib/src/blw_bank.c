/* SPDX-License-Identifier: MIT */
#include "blw/blw_bank.h"
#include "blw_bank_internal.h"
#include "blw_cold.h"
#include "blw_la.h"
#include "blw_step.h"

static BLW_COLD size_t mem_len_of(const blw_bank_model_t *model)
{
    const blw_plant_t *const plant    = model->head.plant;
    const size_t             averages = (size_t)model->sets * model->per_set * model->groups;

    return BLW_BANK_MEM(plant->n, plant->m, model->sets, model->subsets, averages, model->horizon,
                        (model->max_gap > 0U) ? 1U : 0U);
}

static void bind(blw_bank_t *self, const blw_bank_model_t *model, blw_real_t *mem)
{
    const size_t n    = model->head.plant->n;
    const size_t m    = model->head.plant->m;
    const size_t h    = model->horizon;
    const size_t sets = model->sets;

    self->base.ops  = &blw_bank_ops;
    self->model     = model;
    self->x_hat     = blw_la_take(&mem, n);
    self->x_ref     = blw_la_take(&mem, n);
    self->x_bar     = blw_la_take(&mem, n);
    self->scratch   = blw_la_take(&mem, 2U * n);
    self->d         = blw_la_take(&mem, sets * n);
    self->past_d    = blw_la_take(&mem, h * sets * n);
    self->past_e    = blw_la_take(&mem, h * m);
    self->past_move = blw_la_take(&mem, h * n);
    self->block     = blw_la_take(&mem, h * m);
    self->x_fir     = blw_la_take(&mem, model->subsets * n);
    self->average   = blw_la_take(&mem, sets * model->per_set * model->groups);
    self->worst     = blw_la_take(&mem, sets);
    self->gross     = blw_la_take(&mem, sets);
    self->suspicion = blw_la_take(&mem, m);
    self->response  = blw_la_take(&mem, (model->max_gap > 0U) ? (model->subsets * n * n) : 0U);
}

BLW_COLD blw_status_t blw_bank_init(blw_bank_t *self, const blw_bank_model_t *model,
                                    blw_real_t *mem, size_t mem_len)
{
    if ((self == NULL) || (model == NULL) || (mem == NULL)) {
        return BLW_ERR_ARG;
    }
    const blw_status_t status = blw_bank_check(model);
    if (status != BLW_OK) {
        return status;
    }
    if (mem_len < mem_len_of(model)) {
        return BLW_ERR_MEM;
    }
    bind(self, model, mem);
    return blw_bank_reset(self, NULL);
}

BLW_COLD blw_status_t blw_bank_reset(blw_bank_t *self, const blw_real_t *x0)
{
    if (self == NULL) {
        return BLW_ERR_ARG;
    }
    const blw_plant_t *const plant = self->model->head.plant;
    const blw_real_t *const  start = (x0 != NULL) ? x0 : plant->x0;
    if (!blw_la_bounded(plant->n, start)) {
        return BLW_ERR_ARG;
    }
    blw_la_copy(plant->n, start, self->x_ref);
    blw_la_copy(plant->n, start, self->x_hat);
    blw_la_zero((size_t)self->model->sets * plant->n, self->d);
    for (size_t i = 0U; i < plant->m; i++) {
        self->age[i]    = 0U;
        self->silent[i] = 0U;
    }
    blw_la_fill((size_t)self->model->horizon * plant->m, BLW_BANK_NO_SAMPLE, self->past_e);
    self->k      = 0U;
    self->newest = 0U;
    self->choice = 0U;
    blw_bank_judge_reset(self);
    return BLW_OK;
}

/* How long a sensor has been complete, and silent. */
static void count_sample(blw_bank_t *self, size_t i, bool there)
{
    if (!there) {
        self->age[i] = 0U;
        if (self->silent[i] < UINT8_MAX) {
            self->silent[i]++;
        }
        return;
    }
    self->silent[i] = 0U;
    if (self->age[i] < self->model->horizon) {
        self->age[i]++;
    }
}

/* The sensors from which something can be expected: all that are not silent for good, or if every
 * sensor sends in every step those that have sent. */
static unsigned present(const blw_bank_t *self, unsigned used)
{
    unsigned found = 0U;

    if (self->model->max_gap == 0U) {
        return used;
    }
    for (size_t i = 0U; i < self->model->head.plant->m; i++) {
        found |= (self->silent[i] <= self->model->max_gap) ? (1U << i) : 0U;
    }
    return found;
}

/* The reference to step k, and its innovations. */
static void advance_reference(blw_bank_t *self, const blw_real_t *u, const blw_real_t *y,
                              unsigned used)
{
    const blw_plant_t *const plant = self->model->head.plant;
    const size_t             n     = plant->n;

    self->newest        = (uint8_t)((self->newest + 1U) % self->model->horizon);
    blw_real_t *const e = &self->past_e[(size_t)self->newest * plant->m];
    blw_plant_predict(plant, self->x_ref, u, self->x_bar);
    for (size_t i = 0U; i < plant->m; i++) {
        const bool there = blw_bank_has(used, i);

        e[i] = there ? ((y[i] - plant->offset[i]) - blw_la_dot(n, &plant->C[i * n], self->x_bar))
                     : BLW_BANK_NO_SAMPLE;
        count_sample(self, i, there);
    }
}

/* How long the gate still keeps a set out. */
static void count_gate(blw_bank_t *self, size_t set)
{
    if (self->gross[set] > BLW_R(1.0)) {
        self->wait[set] = self->model->horizon;
    } else if (self->wait[set] > 0U) {
        self->wait[set]--;
    } else {
        /* nothing gross in the last block */
    }
}

/* (1) for one set, relative to x_bar of the reference.  A filter that a sample throws out of bounds
 * starts again from the reference.  first = sensors of all sets before this one.
 * @return the same for the next set */
static size_t advance_filter(blw_bank_t *self, size_t set, size_t first, unsigned used)
{
    const blw_plant_t *const plant  = self->model->head.plant;
    const size_t             n      = plant->n;
    const uint16_t           mask   = self->model->set_mask[set];
    const size_t             size   = blw_mask_count(mask);
    const blw_real_t *const  e      = &self->past_e[(size_t)self->newest * plant->m];
    const size_t             slot   = ((size_t)self->newest * self->model->sets) + set;
    blw_real_t *const        d_bar  = self->scratch;
    blw_real_t *const        d      = &self->d[set * n];
    const blw_real_t *const  K      = &self->model->K[first * n];
    const blw_real_t *const  gate   = &self->model->gate[first];
    size_t                   column = 0U;

    blw_la_gemv(n, n, plant->A, d, d_bar);
    blw_la_copy(n, d_bar, d);
    self->gross[set] = BLW_R(0.0);
    for (size_t i = 0U; i < plant->m; i++) {
        if (!blw_bank_has(mask, i)) {
            continue;
        }
        if (blw_bank_has(used, i)) {
            const blw_real_t r = e[i] - blw_la_dot(n, &plant->C[i * n], d_bar);

            blw_bank_add_column(n, size, &K[column], r, d);
            self->gross[set] = blw_la_max(self->gross[set], (r * r) * gate[column]);
        }
        column++;
    }
    count_gate(self, set);
    if (!blw_la_bounded(n, d)) {
        blw_la_zero(n, d);
        blw_la_zero(n, d_bar);
    }
    blw_la_copy(n, (self->model->filtered != 0U) ? d : d_bar, &self->past_d[slot * n]);
    return first + size;
}

static void advance_filters(blw_bank_t *self, unsigned used)
{
    size_t first = 0U;

    for (size_t s = 0U; s < self->model->sets; s++) {
        first = advance_filter(self, s, first, used);
    }
}

/* What speaks against a set, over its threshold: the averages, and for a block's length a gross
 * innovation. */
static blw_real_t evidence(const blw_bank_t *self, size_t set)
{
    if (!self->decided) {
        return BLW_R(0.0);
    }
    const blw_real_t gross = (self->wait[set] > 0U) ? self->model->ceiling : BLW_R(0.0);

    return blw_la_max(blw_la_max(self->worst[set], self->gross[set]), gross);
}

/* If none passes the choice stays, unless the gate speaks against it: then it is the set with the
 * least averages of those that the gate lets through, if there is one. */
static void hold(blw_bank_t *self)
{
    blw_real_t least = BLW_REAL_MAX;

    if (self->wait[self->choice] == 0U) {
        return;
    }
    for (size_t s = 0U; s < self->model->sets; s++) {
        if ((self->wait[s] == 0U) && (self->worst[s] < least)) {
            least        = self->worst[s];
            self->choice = (uint8_t)s;
        }
    }
}

/* The first passing set, that is the one with the least P_opt, of those that lack fewest samples.
 * @return false if none passes */
static bool choose(blw_bank_t *self, unsigned expected)
{
    unsigned fewest = BLW_BANK_MAX_SENSORS + 1U;

    for (size_t s = 0U; s < self->model->sets; s++) {
        const unsigned lacking = blw_mask_count(self->model->set_mask[s] & ~expected);

        if ((evidence(self, s) <= BLW_R(1.0)) && (lacking < fewest)) {
            fewest       = lacking;
            self->choice = (uint8_t)s;
        }
    }
    if (fewest > BLW_BANK_MAX_SENSORS) {
        hold(self);
        return false;
    }
    return true;
}

/* The chosen set's estimate is returned and becomes the reference. */
static void move_reference(blw_bank_t *self)
{
    const size_t      n       = self->model->head.plant->n;
    const size_t      sets    = self->model->sets;
    const size_t      slot    = ((size_t)self->newest * sets) + self->choice;
    blw_real_t *const move    = &self->past_move[(size_t)self->newest * n];
    blw_real_t *const d_first = self->d;

    blw_la_sum(n, self->x_bar, &self->past_d[slot * n], self->x_hat);
    blw_la_copy(n, &d_first[(size_t)self->choice * n], move);
    blw_la_sum(n, self->x_bar, move, self->x_ref);
    for (size_t s = 0U; s < sets; s++) {
        blw_la_axpy(n, BLW_R(-1.0), move, &d_first[s * n]);
    }
}

/* A sensor is as suspicious as the best set that holds it.  @return the sensors that no passing set
 * holds, or if none passes those that the choice leaves out */
static unsigned suspect(blw_bank_t *self, unsigned used, bool passed)
{
    const unsigned chosen   = self->model->set_mask[self->choice];
    unsigned       excluded = 0U;

    for (size_t i = 0U; i < self->model->head.plant->m; i++) {
        blw_real_t best = BLW_REAL_MAX;

        for (size_t s = 0U; s < self->model->sets; s++) {
            if (blw_bank_has(self->model->set_mask[s], i) && (evidence(self, s) < best)) {
                best = evidence(self, s);
            }
        }
        self->suspicion[i] = blw_bank_has(used, i) ? blw_step_suspicion(best) : BLW_R(1.0);
        if (passed ? (best > BLW_R(1.0)) : !blw_bank_has(chosen, i)) {
            excluded |= 1U << i;
        }
    }
    return excluded;
}

static uint8_t flags_of(const blw_bank_t *self, unsigned used, unsigned excluded)
{
    unsigned flags = blw_step_flags(self->model->head.plant, used, excluded);

    if ((used & self->model->set_mask[self->choice]) == 0U) {
        flags |= BLW_FLAG_BLIND;
    }
    if (!self->decided) {
        flags |= BLW_FLAG_WARMING_UP;
    }
    return (uint8_t)flags;
}

static void report(blw_bank_t *self, unsigned used, bool passed, blw_estimator_out_t *out)
{
    const unsigned excluded = suspect(self, used, passed);
    blw_real_t     largest  = BLW_R(0.0);

    for (size_t s = 0U; s < self->model->sets; s++) {
        largest = blw_la_max(largest, evidence(self, s));
    }
    out->x_hat      = self->x_hat;
    out->suspicion  = self->suspicion;
    out->statistic  = largest;
    out->threshold  = BLW_R(1.0);
    out->bound      = BLW_R(0.0);
    out->excluded   = excluded;
    out->used       = used;
    out->iterations = 0U;
    out->outcome    = (uint8_t)(passed ? BLW_OUTCOME_CONVERGED : BLW_OUTCOME_HELD);
    out->flags      = flags_of(self, used, excluded);
}

blw_status_t blw_bank_step(blw_bank_t *self, const blw_real_t *u, const blw_real_t *y,
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
    const unsigned used = (unsigned)blw_plant_screen(plant, y, valid); /* at most 8 sensors */

    advance_reference(self, u, y, used);
    advance_filters(self, used);
    if (self->k < self->model->warm_up) {
        self->k++;
    }
    if (self->k == self->model->warm_up) {
        blw_bank_judge(self);
    }
    const bool passed = choose(self, present(self, used));
    move_reference(self);
    report(self, used, passed, out);
    return BLW_OK;
}

/* The adapters rely on the base, and the head, being the first member (deviation D-1). */
static BLW_COLD size_t ops_mem_len(const blw_model_t *model)
{
    if ((model == NULL) || (model->method != (uint8_t)BLW_METHOD_BANK) || (model->plant == NULL)) {
        return 0U;
    }
    return mem_len_of((const blw_bank_model_t *)(const void *)model);
}

static BLW_COLD blw_status_t ops_init(blw_estimator_t *self, const blw_model_t *model,
                                      blw_real_t *mem, size_t mem_len)
{
    return blw_bank_init((blw_bank_t *)(void *)self, (const blw_bank_model_t *)(const void *)model,
                         mem, mem_len);
}

static BLW_COLD blw_status_t ops_reset(blw_estimator_t *self, const blw_real_t *x0)
{
    return blw_bank_reset((blw_bank_t *)(void *)self, x0);
}

static BLW_COLD blw_status_t ops_step(blw_estimator_t *self, const blw_real_t *u,
                                      const blw_real_t *y, blw_mask_t valid,
                                      blw_estimator_out_t *out)
{
    return blw_bank_step((blw_bank_t *)(void *)self, u, y, valid, out);
}

const blw_estimator_ops_t blw_bank_ops = {
    .method     = BLW_METHOD_BANK,
    .state_size = sizeof(blw_bank_t),
    .mem_len    = ops_mem_len,
    .init       = ops_init,
    .reset      = ops_reset,
    .step       = ops_step,
};
