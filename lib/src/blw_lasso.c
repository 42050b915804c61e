/* SPDX-License-Identifier: MIT */
#include "blw/blw_lasso.h"
#include "blw_cold.h"
#include "blw_la.h"
#include "blw_lasso_internal.h"
#include "blw_step.h"

/* Method and P belong together: without P the states are fused as they are. */
static bool method_ok(const blw_lasso_model_t *model)
{
    const uint8_t expected =
        (uint8_t)((model->P == NULL) ? BLW_METHOD_LASSO : BLW_METHOD_CANONICAL);

    return model->head.method == expected;
}

static bool sizes_ok(const blw_lasso_model_t *model)
{
    const blw_plant_t *const plant = model->head.plant;

    return (model->l1->n == plant->n)
           && (model->l1->N == ((size_t)model->jordan->r * model->jordan->m))
           && (model->ambiguous <= 1U);
}

BLW_COLD blw_status_t blw_lasso_check(const blw_lasso_model_t *model)
{
    blw_table_check_t check;
    blw_status_t      status = BLW_ERR_MODEL;

    if (method_ok(model) && (model->jordan != NULL) && (model->l1 != NULL)) {
        status = blw_model_begin(&model->head, (blw_method_t)model->head.method, &check);
    }
    if (status == BLW_OK) {
        status = blw_jordan_check(model->jordan, model->head.plant, &check);
    }
    if (status == BLW_OK) {
        status = blw_l1_check(model->l1, &check);
    }
    if (status != BLW_OK) {
        return status;
    }
    if (!sizes_ok(model)) {
        return BLW_ERR_MODEL;
    }
    if (model->P != NULL) {
        blw_table_add(&check, model->P, (size_t)model->l1->N * model->jordan->r);
    }
    return blw_model_end(&model->head, &check);
}

static BLW_COLD size_t mem_len_of(const blw_lasso_model_t *model)
{
    const blw_plant_t *const    plant = model->head.plant;
    const blw_l1_model_t *const l1    = model->l1;

    return BLW_LASSO_MEM(plant->n, plant->m, l1->N, l1->d, l1->n_groups,
                         (model->P != NULL) ? 1U : 0U);
}

BLW_COLD blw_status_t blw_lasso_init(blw_lasso_t *self, const blw_lasso_model_t *model,
                                     blw_real_t *mem, size_t mem_len)
{
    if ((self == NULL) || (model == NULL) || (mem == NULL)) {
        return BLW_ERR_ARG;
    }
    const blw_status_t status = blw_lasso_check(model);
    if (status != BLW_OK) {
        return status;
    }
    if (mem_len < mem_len_of(model)) {
        return BLW_ERR_MEM;
    }
    const blw_plant_t *const    plant = model->head.plant;
    const blw_l1_model_t *const l1    = model->l1;

    self->base.ops  = &blw_lasso_ops;
    self->model     = model;
    self->zeta      = blw_la_take(&mem, l1->N);
    self->xi        = (model->P != NULL) ? blw_la_take(&mem, l1->N) : self->zeta;
    self->x_hat     = blw_la_take(&mem, plant->n);
    self->x_bar     = blw_la_take(&mem, plant->n);
    self->d         = blw_la_take(&mem, plant->n);
    self->e         = blw_la_take(&mem, plant->m);
    self->suspicion = blw_la_take(&mem, plant->m);
    blw_l1_init(&self->l1, l1, mem);
    return blw_lasso_reset(self, NULL);
}

BLW_COLD blw_status_t blw_lasso_reset(blw_lasso_t *self, const blw_real_t *x0)
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
    blw_la_zero(self->model->l1->N, self->zeta);
    blw_l1_reset(&self->l1);
    return BLW_OK;
}

/* xi_i = P_i zeta_i.  @return whether both can be worked with. */
static bool transform_sensor(blw_lasso_t *self, size_t i)
{
    const size_t      r      = self->model->jordan->r;
    blw_real_t *const zeta_i = &self->zeta[i * r];
    blw_real_t *const xi_i   = &self->xi[i * r];

    if (self->model->P != NULL) {
        blw_la_gemv(r, r, &self->model->P[i * r * r], zeta_i, xi_i);
    }
    return blw_la_bounded(r, zeta_i) && ((xi_i == zeta_i) || blw_la_bounded(r, xi_i));
}

/* xi of all sensors.  A filter that a sample throws out of bounds starts again from the prediction,
 * and the sample counts as missing.
 * @return the samples that were taken in. */
static BLW_APART blw_mask_t transform_filters(blw_lasso_t *self, blw_mask_t used)
{
    const blw_jordan_model_t *const jordan = self->model->jordan;
    const size_t                    r      = jordan->r;
    blw_mask_t                      taken  = used;

    if ((self->model->P == NULL) && blw_la_bounded(self->model->l1->N, self->zeta)) {
        return used;
    }
    for (size_t i = 0U; i < jordan->m; i++) {
        if (!transform_sensor(self, i)) {
            blw_la_zero(r, &self->zeta[i * r]);
            (void)transform_sensor(self, i);
            taken &= ~((blw_mask_t)1U << i);
        }
    }
    return taken;
}

/* zeta += G d. */
static void shift_filters(blw_lasso_t *self)
{
    const blw_l1_model_t *const l1 = self->model->l1;
    const blw_real_t *const     G  = self->model->jordan->G;

    if (l1->fast != NULL) {
        l1->fast->predict(G, self->d, self->zeta);
    } else {
        blw_la_gemv_add(l1->N, l1->n, G, self->d, self->zeta);
    }
}

/* (2) and (3): the estimate, which is the reference of the next step.
 * @return false if the fusion overflowed: the estimate is then the prediction. */
static BLW_APART bool move_reference(blw_lasso_t *self)
{
    const size_t n = self->model->head.plant->n;

    for (size_t j = 0U; j < n; j++) {
        self->x_hat[j] = self->x_bar[j] + self->d[j];
    }
    if (!blw_la_bounded(n, self->x_hat)) {
        blw_la_copy(n, self->x_bar, self->x_hat);
        return false;
    }
    for (size_t j = 0U; j < n; j++) {
        self->d[j] = self->x_bar[j] - self->x_hat[j]; /* what rounding has left of -d */
    }
    shift_filters(self);
    return true;
}

static BLW_APART void judge_sensors(blw_lasso_t *self, blw_mask_t used)
{
    const size_t r = self->model->jordan->r;

    for (size_t i = 0U; i < self->model->jordan->m; i++) {
        const bool missing = ((used >> i) & 1U) == 0U;

        self->suspicion[i] =
            missing ? BLW_R(1.0) : blw_step_suspicion(blw_l1_excess(&self->l1, self->xi, i * r, r));
    }
}

static blw_outcome_t outcome_of(const blw_l1_info_t *info)
{
    if (info->kalman) {
        return BLW_OUTCOME_KALMAN;
    }
    return info->converged ? BLW_OUTCOME_CONVERGED : BLW_OUTCOME_BOUND;
}

static BLW_APART void report(const blw_lasso_t *self, const blw_l1_info_t *info, blw_mask_t used,
                             blw_estimator_out_t *out)
{
    out->x_hat      = self->x_hat;
    out->suspicion  = self->suspicion;
    out->statistic  = info->statistic;
    out->threshold  = BLW_R(1.0);
    out->bound      = info->bound;
    out->excluded   = 0U;
    out->used       = used;
    out->iterations = info->iterations;
    out->outcome    = (uint8_t)outcome_of(info);
    out->flags      = blw_step_flags(self->model->head.plant, used, 0U);
    if ((self->model->ambiguous != 0U) && !info->kalman) {
        out->flags = (uint8_t)(out->flags | BLW_FLAG_AMBIGUOUS);
    }
}

/* From the local filters at step k to the estimate. */
static void fuse(blw_lasso_t *self, blw_mask_t advanced, blw_estimator_out_t *out)
{
    blw_l1_info_t info;
    blw_mask_t    used = transform_filters(self, advanced);

    blw_l1_solve(&self->l1, self->xi, self->d, &info);
    judge_sensors(self, used);
    if (!move_reference(self)) {
        used = 0U;
        judge_sensors(self, used);
    }
    report(self, &info, used, out);
}

blw_status_t blw_lasso_step(blw_lasso_t *self, const blw_real_t *u, const blw_real_t *y,
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
    const blw_mask_t used = blw_plant_screen(plant, y, valid);

    blw_plant_predict(plant, self->x_hat, u, self->x_bar);
    blw_plant_innovate(plant, y, used, self->x_bar, self->e);
    blw_jordan_step(self->model->jordan, NULL, self->e, self->zeta);
    fuse(self, used, out);
    return BLW_OK;
}

/* The filters that were sent; one that was not goes on without a sample. */
static void take_filters(blw_lasso_t *self, const blw_real_t *zeta, blw_mask_t valid)
{
    const size_t r = self->model->jordan->r;

    for (size_t i = 0U; i < self->model->jordan->m; i++) {
        if (((valid >> i) & 1U) != 0U) {
            blw_la_copy(r, &zeta[i * r], &self->zeta[i * r]);
        } else {
            blw_jordan_step_sensor(self->model->jordan, i, NULL, BLW_R(0.0), &self->zeta[i * r]);
        }
    }
}

blw_status_t blw_lasso_fuse(blw_lasso_t *self, const blw_real_t *u, const blw_real_t *zeta,
                            blw_mask_t valid, blw_estimator_out_t *out)
{
    if ((self == NULL) || (out == NULL)) {
        return BLW_ERR_ARG;
    }
    const blw_plant_t *const plant  = self->model->head.plant;
    const blw_status_t       status = blw_step_check(plant, u, zeta, valid);
    if (status != BLW_OK) {
        return status;
    }
    blw_plant_predict(plant, self->x_hat, u, self->x_bar);
    take_filters(self, zeta, valid);
    fuse(self, valid, out);
    return BLW_OK;
}

static BLW_COLD size_t ops_mem_len(const blw_model_t *model)
{
    const blw_lasso_model_t *const lasso = (const blw_lasso_model_t *)(const void *)model;

    if ((model == NULL) || (model->plant == NULL)
        || ((model->method != (uint8_t)BLW_METHOD_LASSO)
            && (model->method != (uint8_t)BLW_METHOD_CANONICAL))) {
        return 0U;
    }
    return (lasso->l1 != NULL) ? mem_len_of(lasso) : 0U;
}

static BLW_COLD blw_status_t ops_init(blw_estimator_t *self, const blw_model_t *model,
                                      blw_real_t *mem, size_t mem_len)
{
    return blw_lasso_init((blw_lasso_t *)(void *)self,
                          (const blw_lasso_model_t *)(const void *)model, mem, mem_len);
}

static BLW_COLD blw_status_t ops_reset(blw_estimator_t *self, const blw_real_t *x0)
{
    return blw_lasso_reset((blw_lasso_t *)(void *)self, x0);
}

static BLW_COLD blw_status_t ops_step(blw_estimator_t *self, const blw_real_t *u,
                                      const blw_real_t *y, blw_mask_t valid,
                                      blw_estimator_out_t *out)
{
    return blw_lasso_step((blw_lasso_t *)(void *)self, u, y, valid, out);
}

static BLW_COLD blw_status_t ops_fuse(blw_estimator_t *self, const blw_real_t *u,
                                      const blw_real_t *zeta, blw_mask_t valid,
                                      blw_estimator_out_t *out)
{
    return blw_lasso_fuse((blw_lasso_t *)(void *)self, u, zeta, valid, out);
}

const blw_estimator_ops_t blw_lasso_ops = {
    .method     = BLW_METHOD_LASSO,
    .state_size = sizeof(blw_lasso_t),
    .mem_len    = ops_mem_len,
    .init       = ops_init,
    .reset      = ops_reset,
    .step       = ops_step,
};

static BLW_COLD blw_status_t ops_init_fusion(blw_estimator_t *self, const blw_model_t *model,
                                             blw_real_t *mem, size_t mem_len)
{
    const blw_status_t status = ops_init(self, model, mem, mem_len);

    if (status == BLW_OK) {
        self->ops = &blw_lasso_fusion_ops;
    }
    return status;
}

const blw_estimator_ops_t blw_lasso_fusion_ops = {
    .method     = BLW_METHOD_LASSO,
    .state_size = sizeof(blw_lasso_t),
    .mem_len    = ops_mem_len,
    .init       = ops_init_fusion,
    .reset      = ops_reset,
    .step       = ops_fuse,
};
