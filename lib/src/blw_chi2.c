/* SPDX-License-Identifier: MIT */
#include "blw/blw_chi2.h"
#include "blw_cold.h"
#include "blw_la.h"

static bool thresholds_ok(const blw_chi2_model_t *model, size_t rate)
{
    const blw_real_t *const thr  = &model->thr[rate * model->W];
    blw_real_t              last = BLW_R(0.0);

    if (!(model->rate[rate] > BLW_R(0.0)) || !(model->rate[rate] < BLW_R(1.0))) {
        return false;
    }
    for (size_t w = 0U; w < model->W; w++) {
        if (!(thr[w] > last)) {
            return false;
        }
        last = thr[w];
    }
    return true;
}

static bool model_ok(const blw_chi2_model_t *model)
{
    blw_table_check_t check;

    if ((model->abi != BLW_MODEL_ABI) || (model->p == 0U) || (model->W == 0U)
        || (model->n_rates == 0U)) {
        return false;
    }
    blw_table_begin(&check);
    blw_table_add(&check, model->Linv, blw_la_packed_row(model->p));
    blw_table_add(&check, model->rate, model->n_rates);
    blw_table_add(&check, model->thr, (size_t)model->n_rates * model->W);
    for (size_t rate = 0U; check.ok && (rate < model->n_rates); rate++) {
        check.ok = thresholds_ok(model, rate);
    }
    return check.ok && (check.crc == model->crc);
}

BLW_COLD blw_status_t blw_chi2_init(blw_chi2_t *self, const blw_chi2_model_t *model,
                                    blw_real_t *mem, size_t mem_len)
{
    if ((self == NULL) || (model == NULL) || (mem == NULL)) {
        return BLW_ERR_ARG;
    }
    if (!model_ok(model)) {
        return BLW_ERR_MODEL;
    }
    if (mem_len < BLW_CHI2_MEM(model->W)) {
        return BLW_ERR_MEM;
    }
    self->model = model;
    self->thr   = model->thr;
    self->g     = mem;
    blw_chi2_reset(self);
    return BLW_OK;
}

blw_status_t blw_chi2_select(blw_chi2_t *self, size_t rate)
{
    if ((self == NULL) || (rate >= self->model->n_rates)) {
        return BLW_ERR_ARG;
    }
    self->thr = &self->model->thr[rate * self->model->W];
    return BLW_OK;
}

void blw_chi2_reset(blw_chi2_t *self)
{
    self->head = 0U;
    self->fill = 0U;
}

/* |L^-1 r|^2, row by row: no memory for L^-1 r. */
static blw_real_t statistic(const blw_chi2_model_t *model, const blw_real_t *r)
{
    blw_real_t g = BLW_R(0.0);

    for (size_t i = 0U; i < model->p; i++) {
        const blw_real_t w = blw_la_dot(i + 1U, &model->Linv[blw_la_packed_row(i)], r);
        g += w * w;
    }
    return g;
}

void blw_chi2_step(blw_chi2_t *self, const blw_real_t *r, blw_chi2_out_t *out)
{
    const size_t W = self->model->W;
    blw_real_t   G = BLW_R(0.0);

    out->g              = statistic(self->model, r);
    self->g[self->head] = out->g;
    self->head          = (uint8_t)((self->head + 1U) % W);
    self->fill          = (uint8_t)((self->fill < W) ? (self->fill + 1U) : W);
    for (size_t w = 0U; w < self->fill; w++) { /* fresh, since a running sum would drift */
        G += self->g[w];
    }
    out->G     = G;
    out->thr   = self->thr[self->fill - 1U];
    out->alarm = !(G <= out->thr);
}
