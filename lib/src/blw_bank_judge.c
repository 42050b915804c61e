/* SPDX-License-Identifier: MIT */
#include "blw_bank_internal.h"
#include "blw_cold.h"
#include "blw_la.h"

BLW_COLD void blw_bank_judge_reset(blw_bank_t *self)
{
    const blw_bank_model_t *const model = self->model;
    const size_t                  pairs = (size_t)model->sets * model->per_set;

    if (model->window == 0U) {
        blw_la_copy(pairs, model->start, self->average);
    } else {
        blw_la_zero(pairs * model->groups, self->average);
    }
    blw_la_zero(model->sets, self->worst);
    blw_la_zero(model->sets, self->gross);
    for (size_t s = 0U; s < model->sets; s++) {
        self->wait[s] = 0U;
    }
    self->blocks  = 0U;
    self->decided = false;
}

/* Where there was no sample, the block has nothing to say. */
static void blank(size_t m, const blw_real_t *e, blw_real_t *samples)
{
    for (size_t i = 0U; i < m; i++) {
        samples[i] = (e[i] >= BLW_BANK_NO_SAMPLE) ? BLW_R(0.0) : samples[i];
    }
}

/* Samples of the block less C x_ref(t), C A x_ref(t), ...: the innovations were taken against a
 * reference that moved, and z is how far it had moved by then. */
static void rebuild_block(blw_bank_t *self, size_t oldest)
{
    const blw_plant_t *const plant = self->model->head.plant;
    const size_t             n     = plant->n;
    const size_t             m     = plant->m;
    const size_t             h     = self->model->horizon;
    blw_real_t *const        z     = self->scratch;
    blw_real_t *const        moved = &self->scratch[n];

    blw_la_zero(n, z);
    for (size_t j = 0U; j < h; j++) {
        const size_t slot = (oldest + j) % h;

        blw_la_copy(m, &self->past_e[slot * m], &self->block[j * m]);
        blw_la_gemv_add(m, n, plant->C, z, &self->block[j * m]);
        blank(m, &self->past_e[slot * m], &self->block[j * m]);
        blw_la_sum(n, z, &self->past_move[slot * n], moved);
        blw_la_gemv(n, n, plant->A, moved, z);
    }
}

/* @return how many sensors a mask has; list: which ones, in ascending order */
static size_t list_members(uint16_t mask, size_t m, uint8_t *list)
{
    size_t size = 0U;

    for (size_t i = 0U; i < m; i++) {
        if (blw_bank_has(mask, i)) {
            list[size] = (uint8_t)i;
            size++;
        }
    }
    return size;
}

/* (2) for one subset.  @return the next subset's Z */
static const blw_real_t *estimate_subset(blw_bank_t *self, size_t i, const blw_real_t *Z)
{
    uint8_t           list[BLW_BANK_MAX_SENSORS];
    const size_t      n       = self->model->head.plant->n;
    const size_t      m       = self->model->head.plant->m;
    const size_t      size    = list_members(self->model->subset_mask[i], m, list);
    const size_t      columns = (size_t)self->model->horizon * size;
    blw_real_t *const x       = &self->x_fir[i * n];
    const blw_real_t *samples = self->block;

    blw_la_zero(n, x);
    for (size_t column = 0U; column < columns; column += size) {
        for (size_t s = 0U; s < size; s++) {
            blw_bank_add_column(n, columns, &Z[column + s], samples[list[s]], x);
        }
        samples = &samples[m];
    }
    return &Z[n * columns];
}

/* M A in the place of M. */
static void multiply(const blw_plant_t *plant, blw_real_t *M, blw_real_t *row)
{
    const size_t n = plant->n;

    for (size_t r = 0U; r < n; r++) {
        blw_la_zero(n, row);
        for (size_t j = 0U; j < n; j++) {
            blw_la_axpy(n, M[(r * n) + j], &plant->A[j * n], row);
        }
        blw_la_copy(n, row, &M[r * n]);
    }
}

/* M of (6) for one subset by Horner's rule, from the last samples of the block to the first. */
static void respond(blw_bank_t *self, size_t subset, const blw_real_t *Z, size_t oldest)
{
    const blw_plant_t *const plant   = self->model->head.plant;
    const uint16_t           mask    = self->model->subset_mask[subset];
    const size_t             n       = plant->n;
    const size_t             m       = plant->m;
    const size_t             h       = self->model->horizon;
    const size_t             columns = h * blw_mask_count(mask);
    blw_real_t *const        M       = &self->response[subset * n * n];
    size_t                   column  = columns;

    blw_la_zero(n * n, M);
    for (size_t j = h; j > 0U; j--) {
        const blw_real_t *const e = &self->past_e[((oldest + (j - 1U)) % h) * m];

        multiply(plant, M, self->scratch);
        for (size_t i = m; i > 0U; i--) {
            if (!blw_bank_has(mask, i - 1U)) {
                continue;
            }
            column--;
            for (size_t r = 0U; (r < n) && !(e[i - 1U] >= BLW_BANK_NO_SAMPLE); r++) {
                blw_la_axpy(n, Z[(r * columns) + column], &plant->C[(i - 1U) * n], &M[r * n]);
            }
        }
    }
}

/* The sensors that lack a sample of the block which needs to be there. */
static unsigned lacking(const blw_bank_t *self)
{
    unsigned found = 0U;

    if (self->model->max_gap > 0U) {
        return found;
    }
    for (size_t i = 0U; i < self->model->head.plant->m; i++) {
        found |= (self->age[i] < self->model->horizon) ? (1U << i) : 0U;
    }
    return found;
}

/* (3) over its threshold; NaN or infinite if the block overflowed. */
static blw_real_t ratio_of(const blw_bank_t *self, size_t pair, size_t oldest)
{
    const blw_bank_model_t *const model = self->model;
    const size_t                  n     = model->head.plant->n;
    const size_t                  set   = pair / model->per_set;
    const size_t                  i     = model->pair[pair];
    const blw_real_t *const       x_i   = &self->x_fir[i * n];
    const blw_real_t *const       x_s   = &self->past_d[((oldest * model->sets) + set) * n];
    blw_real_t                    q     = BLW_R(0.0);

    for (size_t j = 0U; j < n; j++) {
        const blw_real_t seen =
            (model->max_gap > 0U) ? blw_la_dot(n, &self->response[((i * n) + j) * n], x_s) : x_s[j];

        q += (x_i[j] - seen) * (x_i[j] - seen);
    }
    return q * model->scale[pair];
}

/* At most ceiling; a NaN counts as ceiling. */
static blw_real_t limited(blw_real_t average, blw_real_t ceiling)
{
    return (average <= ceiling) ? average : ceiling;
}

static void average_pair(blw_bank_t *self, size_t pair, size_t oldest, unsigned without)
{
    const blw_bank_model_t *const model = self->model;
    const bool                    known = (model->subset_mask[model->pair[pair]] & without) == 0U;
    const size_t group   = (pair * model->groups) + ((size_t)self->blocks % model->groups);
    blw_real_t  *average = &self->average[group];

    if (model->window != 0U) {
        const blw_real_t ratio = known ? ratio_of(self, pair, oldest) : model->start[pair];

        *average = limited(*average + (model->gain * ratio), model->ceiling); /* (5) */
    } else if (known) {
        const blw_real_t change = ratio_of(self, pair, oldest) - *average;

        *average = limited(*average + (model->gain * change), model->ceiling); /* (4) */
    } else {
        /* (4) waits for the next complete block */
    }
}

static void decide(blw_bank_t *self)
{
    const blw_bank_model_t *const model = self->model;
    const size_t                  tests = (size_t)model->per_set * model->groups;

    for (size_t s = 0U; s < model->sets; s++) {
        blw_real_t worst = BLW_R(0.0);

        for (size_t i = 0U; i < tests; i++) {
            worst = blw_la_max(worst, self->average[(s * tests) + i]);
        }
        self->worst[s] = worst;
    }
    self->decided = true;
}

void blw_bank_judge(blw_bank_t *self)
{
    const blw_bank_model_t *const model   = self->model;
    const size_t                  pairs   = (size_t)model->sets * model->per_set;
    const size_t                  oldest  = ((size_t)self->newest + 1U) % model->horizon;
    const unsigned                without = lacking(self);
    const blw_real_t             *Z       = model->Z;

    rebuild_block(self, oldest);
    for (size_t i = 0U; i < model->subsets; i++) {
        if (model->max_gap > 0U) {
            respond(self, i, Z, oldest);
        }
        Z = estimate_subset(self, i, Z);
    }
    for (size_t i = 0U; i < pairs; i++) {
        average_pair(self, i, oldest, without);
    }
    if (model->window == 0U) {
        decide(self);
        return;
    }
    self->blocks++;
    if (self->blocks == model->window) {
        decide(self);
        blw_la_zero(pairs * model->groups, self->average);
        self->blocks = 0U;
    }
}
