/* SPDX-License-Identifier: MIT */
#include "blw/blw_local.h"
#include "blw_cold.h"
#include "blw_la.h"
#include "blw_lasso_internal.h"

BLW_COLD blw_status_t blw_local_init(blw_local_t *self, const blw_lasso_model_t *model,
                                     uint8_t sensor, blw_real_t *mem, size_t mem_len)
{
    if ((self == NULL) || (model == NULL) || (mem == NULL)) {
        return BLW_ERR_ARG;
    }
    const blw_status_t status = blw_lasso_check(model);
    if (status != BLW_OK) {
        return status;
    }
    const size_t n = model->head.plant->n;
    const size_t r = model->jordan->r;
    if (sensor >= model->head.plant->m) {
        return BLW_ERR_ARG;
    }
    if (mem_len < BLW_LOCAL_MEM(n, r)) {
        return BLW_ERR_MEM;
    }
    self->model  = model;
    self->sensor = sensor;
    self->zeta   = blw_la_take(&mem, r);
    self->xi     = blw_la_take(&mem, r);
    self->x_hat  = blw_la_take(&mem, n);
    self->x_bar  = blw_la_take(&mem, n);
    return blw_local_reset(self, NULL);
}

BLW_COLD blw_status_t blw_local_reset(blw_local_t *self, const blw_real_t *x_hat)
{
    const blw_plant_t *const plant = self->model->head.plant;
    const blw_real_t *const  start = (x_hat != NULL) ? x_hat : plant->x0;

    if (!blw_la_bounded(plant->n, start)) {
        return BLW_ERR_ARG;
    }
    blw_la_copy(plant->n, start, self->x_hat);
    blw_la_copy(plant->n, start, self->x_bar);
    blw_la_zero(self->model->jordan->r, self->zeta);
    return BLW_OK;
}

/* As the fusion node will find it. */
static bool in_bounds(blw_local_t *self)
{
    const size_t      r = self->model->jordan->r;
    const blw_real_t *P = self->model->P;

    if (P == NULL) {
        return blw_la_bounded(r, self->zeta);
    }
    blw_la_gemv(r, r, &P[(size_t)self->sensor * r * r], self->zeta, self->xi);
    return blw_la_bounded(r, self->zeta) && blw_la_bounded(r, self->xi);
}

bool blw_local_step(blw_local_t *self, const blw_real_t *u, blw_real_t y, bool valid)
{
    const blw_plant_t *const plant = self->model->head.plant;
    const size_t             i     = self->sensor;
    const size_t             n     = plant->n;
    const bool               in_range =
        (y >= plant->y_min[i]) && (y <= plant->y_max[i]) && (blw_la_abs(y) <= BLW_SIGNAL_MAX);
    const bool used = valid && in_range;
    blw_real_t e    = BLW_R(0.0);

    blw_plant_predict(plant, self->x_hat, u, self->x_bar);
    if (used) {
        e = (y - plant->offset[i]) - blw_la_dot(n, &plant->C[i * n], self->x_bar);
    }
    blw_jordan_step_sensor(self->model->jordan, i, NULL, e, self->zeta);
    if (!in_bounds(self)) {
        blw_la_zero(self->model->jordan->r, self->zeta);
        return false;
    }
    return used;
}

blw_status_t blw_local_correct(blw_local_t *self, const blw_real_t *x_hat)
{
    const size_t            n = self->model->head.plant->n;
    const size_t            r = self->model->jordan->r;
    const blw_real_t *const G = &self->model->jordan->G[(size_t)self->sensor * r * n];

    if (!blw_la_bounded(n, x_hat)) {
        return BLW_ERR_ARG;
    }
    blw_la_copy(n, x_hat, self->x_hat);
    for (size_t j = 0U; j < n; j++) {
        self->x_bar[j] = x_hat[j] - self->x_bar[j]; /* d; the prediction is not needed any more */
    }
    for (size_t row = 0U; row < r; row++) {
        self->zeta[row] -= blw_la_dot(n, &G[row * n], self->x_bar);
    }
    return BLW_OK;
}
