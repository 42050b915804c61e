/* SPDX-License-Identifier: MIT */
#include "blw/blw_kalman.h"
#include "blw_cold.h"
#include "blw_la.h"
#include "blw_step.h"

static BLW_COLD blw_status_t check_model(const blw_kalman_model_t *model)
{
    blw_table_check_t  check;
    const blw_status_t status = blw_model_begin(&model->head, BLW_METHOD_KALMAN, &check);

    if (status != BLW_OK) {
        return status;
    }
    const blw_plant_t *const plant = model->head.plant;
    blw_table_add(&check, model->K, (size_t)plant->n * plant->m);
    if (model->Acl != NULL) {
        blw_table_add(&check, model->Acl, (size_t)plant->n * plant->n);
        blw_table_add(&check, model->Bcl, (size_t)plant->n * plant->l);
    }
    return blw_model_end(&model->head, &check);
}

BLW_COLD blw_status_t blw_kalman_init(blw_kalman_t *self, const blw_kalman_model_t *model,
                                      blw_real_t *mem, size_t mem_len)
{
    if ((self == NULL) || (model == NULL) || (mem == NULL)) {
        return BLW_ERR_ARG;
    }
    const blw_status_t status = check_model(model);
    if (status != BLW_OK) {
        return status;
    }
    const blw_plant_t *const plant = model->head.plant;
    if (mem_len < BLW_KALMAN_MEM(plant->n, plant->m)) {
        return BLW_ERR_MEM;
    }
    self->base.ops  = &blw_kalman_ops;
    self->model     = model;
    self->x_hat     = blw_la_take(&mem, plant->n);
    self->x_bar     = blw_la_take(&mem, plant->n);
    self->suspicion = blw_la_take(&mem, plant->m);
    self->all       = BLW_MASK_ALL(plant->m);
    self->calm      = false;
    return blw_kalman_reset(self, NULL);
}

BLW_COLD blw_status_t blw_kalman_reset(blw_kalman_t *self, const blw_real_t *x0)
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
    return BLW_OK;
}

/* The usual step: every sample is there and nothing is near a bound. */
static bool quick_step(blw_kalman_t *self, const blw_real_t *u, const blw_real_t *y,
                       blw_mask_t valid)
{
    const blw_kalman_kernel_t kernel  = self->model->step;
    const bool                input   = (u != NULL) || (self->model->head.plant->l == 0U);
    const bool                regular = input && (y != NULL) && (valid == self->all);

    if ((kernel == NULL) || !regular || !kernel(u, y, self->x_hat)) {
        return false;
    }
    if (!self->calm) {
        blw_la_zero(self->model->head.plant->m, self->suspicion);
        self->calm = true;
    }
    return true;
}

/* x = x + K_i r */
static void take_in(const blw_kalman_model_t *model, size_t i, blw_real_t r, blw_real_t *x)
{
    const size_t n = model->head.plant->n;
    const size_t m = model->head.plant->m;

    for (size_t j = 0U; j < n; j++) {
        x[j] += model->K[(j * m) + i] * r;
    }
}

/* (3) if the model has it.  Returns false with x_hat untouched if not, or if it would overflow. */
static bool closed_step(blw_kalman_t *self, const blw_real_t *u, const blw_real_t *y)
{
    const blw_kalman_model_t *const model = self->model;
    const blw_plant_t *const        plant = model->head.plant;

    if (model->Acl == NULL) {
        return false;
    }
    blw_la_gemv(plant->n, plant->n, model->Acl, self->x_hat, self->x_bar);
    if (u != NULL) {
        blw_la_gemv_add(plant->n, plant->l, model->Bcl, u, self->x_bar);
    }
    for (size_t i = 0U; i < plant->m; i++) {
        take_in(model, i, y[i] - plant->offset[i], self->x_bar);
    }
    if (!blw_la_bounded(plant->n, self->x_bar)) {
        return false;
    }
    blw_la_copy(plant->n, self->x_bar, self->x_hat);
    blw_la_zero(plant->m, self->suspicion);
    self->calm = true;
    return true;
}

/* (2) with the samples in used only; the suspicion of the others is 1. */
static void correct(blw_kalman_t *self, const blw_real_t *y, blw_mask_t used)
{
    const blw_plant_t *const plant = self->model->head.plant;
    const size_t             n     = plant->n;
    const size_t             m     = plant->m;

    blw_la_copy(n, self->x_bar, self->x_hat);
    blw_la_fill(m, BLW_R(1.0), self->suspicion);
    self->calm = (used == self->all);
    for (size_t i = 0U; i < m; i++) {
        if (((used >> i) & 1U) == 0U) {
            continue;
        }
        const blw_real_t y_bar = blw_la_dot(n, &plant->C[i * n], self->x_bar);

        take_in(self->model, i, (y[i] - plant->offset[i]) - y_bar, self->x_hat);
        self->suspicion[i] = BLW_R(0.0);
    }
}

/* Step by the loops, with the samples in used or, if they would overflow the state, without any.
 * Returns those that were taken in. */
static blw_mask_t loop_step(blw_kalman_t *self, const blw_real_t *u, const blw_real_t *y,
                            blw_mask_t used)
{
    const blw_plant_t *const plant = self->model->head.plant;

    if ((used == self->all) && closed_step(self, u, y)) {
        return used;
    }
    blw_plant_predict(plant, self->x_hat, u, self->x_bar);
    correct(self, y, used);
    if (blw_la_bounded(plant->n, self->x_hat)) {
        return used;
    }
    correct(self, y, 0U);
    return 0U;
}

/* Member by member: a compound literal would be cleared by memset first. */
static inline void report(const blw_kalman_t *self, blw_mask_t used, uint8_t flags,
                          blw_estimator_out_t *out)
{
    out->x_hat      = self->x_hat;
    out->suspicion  = self->suspicion;
    out->statistic  = BLW_R(0.0);
    out->threshold  = BLW_R(0.0);
    out->bound      = BLW_R(0.0);
    out->excluded   = 0U;
    out->used       = used;
    out->iterations = 0U;
    out->outcome    = (uint8_t)BLW_OUTCOME_KALMAN;
    out->flags      = flags;
}

/* Everything but the usual step; apart, so that this one saves few registers. */
static BLW_APART blw_status_t checked_step(blw_kalman_t *self, const blw_real_t *u,
                                           const blw_real_t *y, blw_mask_t valid,
                                           blw_estimator_out_t *out)
{
    const blw_plant_t *const plant  = self->model->head.plant;
    const blw_status_t       status = blw_step_check(plant, u, y, valid);

    if (status != BLW_OK) {
        return status;
    }
    const blw_mask_t used = loop_step(self, u, y, blw_plant_screen(plant, y, valid));
    report(self, used, blw_step_flags(plant, used, 0U), out);
    return BLW_OK;
}

blw_status_t blw_kalman_step(blw_kalman_t *self, const blw_real_t *u, const blw_real_t *y,
                             blw_mask_t valid, blw_estimator_out_t *out)
{
    if ((self == NULL) || (out == NULL)) {
        return BLW_ERR_ARG;
    }
    if (!quick_step(self, u, y, valid)) {
        return checked_step(self, u, y, valid, out);
    }
    report(self, valid, 0U, out);
    return BLW_OK;
}

/* The four adapters rely on the base, and the head, being the first member (deviation D-1). */
static BLW_COLD size_t ops_mem_len(const blw_model_t *model)
{
    if ((model == NULL) || (model->method != (uint8_t)BLW_METHOD_KALMAN)
        || (model->plant == NULL)) {
        return 0U;
    }
    return BLW_KALMAN_MEM(model->plant->n, model->plant->m);
}

static BLW_COLD blw_status_t ops_init(blw_estimator_t *self, const blw_model_t *model,
                                      blw_real_t *mem, size_t mem_len)
{
    return blw_kalman_init((blw_kalman_t *)(void *)self,
                           (const blw_kalman_model_t *)(const void *)model, mem, mem_len);
}

static BLW_COLD blw_status_t ops_reset(blw_estimator_t *self, const blw_real_t *x0)
{
    return blw_kalman_reset((blw_kalman_t *)(void *)self, x0);
}

static BLW_COLD blw_status_t ops_step(blw_estimator_t *self, const blw_real_t *u,
                                      const blw_real_t *y, blw_mask_t valid,
                                      blw_estimator_out_t *out)
{
    return blw_kalman_step((blw_kalman_t *)(void *)self, u, y, valid, out);
}

const blw_estimator_ops_t blw_kalman_ops = {
    .method     = BLW_METHOD_KALMAN,
    .state_size = sizeof(blw_kalman_t),
    .mem_len    = ops_mem_len,
    .init       = ops_init,
    .reset      = ops_reset,
    .step       = ops_step,
};
