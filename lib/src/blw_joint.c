/* SPDX-License-Identifier: MIT */
#include "blw/blw_joint.h"
#include "blw_cold.h"
#include "blw_joint_internal.h"
#include "blw_la.h"
#include "blw_step.h"

static BLW_COLD size_t mem_len_of(const blw_joint_model_t *model)
{
    const blw_plant_t *const plant = model->head.plant;

    return BLW_JOINT_MEM(plant->n, plant->m, model->r, (model->schedule == NULL) ? 1 : 0);
}

static void bind(blw_joint_t *self, blw_real_t *mem)
{
    const size_t n    = self->plant.n;
    const size_t m    = self->plant.m;
    const size_t r    = self->model->r;
    const size_t rows = BLW_JOINT_ROWS(n, r);
    const bool   own  = self->model->schedule == NULL;

    self->x_hat     = blw_la_take(&mem, n);
    self->x_bar     = blw_la_take(&mem, n);
    self->dx        = blw_la_take(&mem, n);
    self->scratch   = blw_la_take(&mem, n);
    self->nu        = blw_la_take(&mem, m);
    self->suspicion = blw_la_take(&mem, m);
    self->delta     = blw_la_take(&mem, r * n);
    self->theta     = blw_la_take(&mem, r);
    self->phi       = blw_la_take(&mem, r);
    self->sd        = blw_la_take(&mem, r);
    self->L         = own ? blw_la_take(&mem, blw_la_packed_row(rows)) : NULL;
    self->c         = own ? blw_la_take(&mem, rows) : NULL;
    self->X         = own ? blw_la_take(&mem, (rows + m) * BLW_JOINT_WIDTH(n, m, r)) : NULL;
    self->e         = own ? blw_la_take(&mem, m) : NULL;
}

BLW_COLD blw_status_t blw_joint_init(blw_joint_t *self, const blw_joint_model_t *model,
                                     blw_real_t *mem, size_t mem_len)
{
    if ((self == NULL) || (model == NULL) || (mem == NULL)) {
        return BLW_ERR_ARG;
    }
    const blw_status_t status = blw_joint_check(model);
    if (status != BLW_OK) {
        return status;
    }
    if (mem_len < mem_len_of(model)) {
        return BLW_ERR_MEM;
    }
    self->base.ops = &blw_joint_ops;
    self->model    = model;
    self->plant    = *model->head.plant;
    bind(self, mem);
    return blw_joint_reset(self, NULL);
}

/* All local estimators at x_hat, no attack, covariances as at the start. */
static void restart(blw_joint_t *self)
{
    const size_t r = self->model->r;

    blw_la_zero(r * self->plant.n, self->delta);
    blw_la_zero(r, self->theta);
    blw_la_zero(r, self->phi);
    self->heard = 0U;
    if (self->model->schedule != NULL) {
        blw_joint_schedule_reset(self);
    } else {
        blw_joint_recursive_reset(self);
    }
}

static blw_mask_t strong_of(const blw_joint_model_t *model)
{
    blw_mask_t strong = 0U;

    for (size_t j = 0U; j < model->head.plant->m; j++) {
        strong |= (blw_mask_t)model->strong[j] << j;
    }
    return strong;
}

BLW_COLD blw_status_t blw_joint_reset(blw_joint_t *self, const blw_real_t *x0)
{
    if (self == NULL) {
        return BLW_ERR_ARG;
    }
    const blw_plant_t *const plant = self->model->head.plant;
    const blw_real_t *const  start = (x0 != NULL) ? x0 : plant->x0;
    if (!blw_la_bounded(plant->n, start)) {
        return BLW_ERR_ARG;
    }
    self->plant  = *plant;
    self->strong = strong_of(self->model);
    self->k      = 0U;
    blw_la_copy(plant->n, start, self->x_hat);
    restart(self);
    return BLW_OK;
}

blw_real_t blw_joint_innovation(const blw_joint_t *self, size_t i, size_t j)
{
    const size_t     n      = self->plant.n;
    const size_t     sensor = self->model->sensor[self->model->first[i] + j];
    const blw_real_t e =
        self->nu[sensor] - blw_la_dot(n, &self->plant.C[sensor * n], &self->delta[i * n]);

    return (j == 0U) ? (e - self->theta[i]) : e;
}

static void innovate(blw_joint_t *self, const blw_real_t *y, blw_mask_t heard)
{
    const size_t n = self->plant.n;

    for (size_t j = 0U; j < self->plant.m; j++) {
        self->nu[j] = blw_joint_in(heard, j) ? ((y[j] - self->plant.offset[j])
                                                - blw_la_dot(n, &self->plant.C[j * n], self->x_bar))
                                             : BLW_R(0.0);
    }
}

/* Aa X + phi of all estimators */
static void predict_locals(blw_joint_t *self)
{
    const size_t n = self->plant.n;

    for (size_t i = 0U; i < self->model->r; i++) {
        blw_la_copy(n, &self->delta[i * n], self->scratch);
        blw_la_gemv(n, n, self->plant.A, self->scratch, &self->delta[i * n]);
        self->theta[i] += self->phi[i];
    }
}

static bool bounded(const blw_joint_t *self)
{
    const size_t r = self->model->r;

    return blw_la_bounded(self->plant.n, self->x_hat)
           && blw_la_bounded(r * self->plant.n, self->delta) && blw_la_bounded(r, self->theta)
           && blw_la_bounded(r, self->phi);
}

/* dx becomes part of x_hat.  If something overflows, everybody starts again from x_bar.
 * @return the samples that were taken in. */
static blw_mask_t update(blw_joint_t *self, blw_mask_t heard, bool sound)
{
    const size_t n = self->plant.n;

    blw_la_sum(n, self->x_bar, self->dx, self->x_hat);
    for (size_t i = 0U; i < self->model->r; i++) {
        blw_la_axpy(n, BLW_R(-1.0), self->dx, &self->delta[i * n]);
    }
    if (!sound || !bounded(self)) {
        blw_la_copy(n, self->x_bar, self->x_hat);
        restart(self);
        return 0U;
    }
    return heard;
}

/* Sensors that some estimator listens to, and the weak ones among them. */
static blw_mask_t listened(const blw_joint_t *self, blw_mask_t *weak)
{
    const blw_joint_model_t *const model    = self->model;
    blw_mask_t                     partners = 0U;

    *weak = 0U;
    for (size_t i = 0U; i < model->r; i++) {
        *weak |= (blw_mask_t)1U << blw_joint_weak(model, i);
        for (size_t j = 1U; j < blw_joint_sensors(model, i); j++) {
            partners |= (blw_mask_t)1U << model->sensor[model->first[i] + j];
        }
    }
    return *weak | (partners & self->strong);
}

/* Statistic and suspicion: theta in units of its threshold. */
static void judge(blw_joint_t *self, blw_mask_t used, blw_estimator_out_t *out)
{
    for (size_t j = 0U; j < self->plant.m; j++) {
        self->suspicion[j] = blw_joint_in(used, j) ? BLW_R(0.0) : BLW_R(1.0);
    }
    out->threshold = BLW_R(1.0);
    for (size_t i = 0U; i < self->model->r; i++) {
        const size_t sensor = blw_joint_weak(self->model, i);
        if (!blw_joint_in(used, sensor)) {
            continue;
        }
        const blw_real_t s      = self->theta[i] * self->model->scale[i];
        self->suspicion[sensor] = blw_step_suspicion(s * s);
        out->statistic          = blw_la_max(out->statistic, s * s);
    }
}

static void report(blw_joint_t *self, blw_mask_t used, blw_estimator_out_t *out)
{
    const blw_plant_t *const plant = &self->plant;
    blw_mask_t               weak  = 0U;
    const blw_mask_t         heard = listened(self, &weak);

    *out = (blw_estimator_out_t){
        .x_hat     = self->x_hat,
        .suspicion = self->suspicion,
        .excluded  = BLW_MASK_ALL(plant->m) & ~heard,
        .used      = used,
        .outcome   = (uint8_t)BLW_OUTCOME_CONVERGED,
    };
    out->flags = blw_step_flags(plant, used, out->excluded);
    if (self->k <= self->model->warm_up) {
        out->flags = (uint8_t)(out->flags | BLW_FLAG_WARMING_UP);
    }
    judge(self, used, out);
    self->heard = used & weak;
}

blw_status_t blw_joint_step(blw_joint_t *self, const blw_real_t *u, const blw_real_t *y,
                            blw_mask_t valid, blw_estimator_out_t *out)
{
    if ((self == NULL) || (out == NULL)) {
        return BLW_ERR_ARG;
    }
    const blw_status_t status = blw_step_check(&self->plant, u, y, valid);
    if (status != BLW_OK) {
        return status;
    }
    const blw_mask_t heard = blw_plant_screen(&self->plant, y, valid);
    bool             sound = true;

    self->k = (uint16_t)((self->k < UINT16_MAX) ? (self->k + 1U) : self->k);
    blw_plant_predict(&self->plant, self->x_hat, u, self->x_bar);
    innovate(self, y, heard);
    predict_locals(self);
    if (self->model->schedule != NULL) {
        blw_joint_schedule_correct(self, heard);
    } else {
        sound = blw_joint_recursive_correct(self, heard);
    }
    report(self, update(self, heard, sound), out);
    return BLW_OK;
}

blw_status_t blw_joint_get_attack(const blw_joint_t *self, size_t sensor,
                                  blw_joint_attack_t *attack)
{
    if ((self == NULL) || (attack == NULL)) {
        return BLW_ERR_ARG;
    }
    for (size_t i = 0U; i < self->model->r; i++) {
        if (blw_joint_weak(self->model, i) == sensor) {
            *attack = (blw_joint_attack_t){.theta = self->theta[i],
                                           .sd    = self->sd[i],
                                           .heard = blw_joint_in(self->heard, sensor)};
            return BLW_OK;
        }
    }
    return BLW_ERR_ARG;
}

blw_status_t blw_joint_set_strong(blw_joint_t *self, blw_mask_t strong)
{
    if ((self == NULL) || (self->model->recursive == NULL)
        || ((strong & ~BLW_MASK_ALL(self->plant.m)) != 0U)) {
        return BLW_ERR_ARG;
    }
    self->strong = strong;
    return BLW_OK;
}

blw_status_t blw_joint_set_plant(blw_joint_t *self, const blw_real_t *A, const blw_real_t *Bu,
                                 const blw_real_t *C)
{
    if ((self == NULL) || (self->model->recursive == NULL)) {
        return BLW_ERR_ARG;
    }
    blw_plant_t  plant = *self->model->head.plant;
    const size_t n     = plant.n;

    plant.A  = (A != NULL) ? A : plant.A;
    plant.Bu = (Bu != NULL) ? Bu : plant.Bu;
    plant.C  = (C != NULL) ? C : plant.C;
    if (!blw_la_finite(n * n, plant.A) || !blw_la_finite(n * plant.l, plant.Bu)
        || !blw_la_finite(plant.m * n, plant.C)) {
        return BLW_ERR_ARG;
    }
    self->plant = plant;
    return BLW_OK;
}

static BLW_COLD size_t ops_mem_len(const blw_model_t *model)
{
    if ((model == NULL) || (model->plant == NULL) || (model->method != (uint8_t)BLW_METHOD_JOINT)) {
        return 0U;
    }
    return mem_len_of((const blw_joint_model_t *)(const void *)model);
}

static BLW_COLD blw_status_t ops_init(blw_estimator_t *self, const blw_model_t *model,
                                      blw_real_t *mem, size_t mem_len)
{
    return blw_joint_init((blw_joint_t *)(void *)self,
                          (const blw_joint_model_t *)(const void *)model, mem, mem_len);
}

static BLW_COLD blw_status_t ops_reset(blw_estimator_t *self, const blw_real_t *x0)
{
    return blw_joint_reset((blw_joint_t *)(void *)self, x0);
}

static BLW_COLD blw_status_t ops_step(blw_estimator_t *self, const blw_real_t *u,
                                      const blw_real_t *y, blw_mask_t valid,
                                      blw_estimator_out_t *out)
{
    return blw_joint_step((blw_joint_t *)(void *)self, u, y, valid, out);
}

const blw_estimator_ops_t blw_joint_ops = {
    .method     = BLW_METHOD_JOINT,
    .state_size = sizeof(blw_joint_t),
    .mem_len    = ops_mem_len,
    .init       = ops_init,
    .reset      = ops_reset,
    .step       = ops_step,
};
