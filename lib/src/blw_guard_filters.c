/* SPDX-License-Identifier: MIT */
/* The local filters (1) of blw_guard.h. */
#include "blw_guard_internal.h"
#include "blw_la.h"

/* Innovation of sensor i about the reference; a missing sample counts as its prediction from the
 * last estimate, y_bar = C_i A (x_hat - x_ref) above the reference's. */
static blw_real_t innovation(const blw_guard_t *self, size_t i, const blw_real_t *y, bool used)
{
    const blw_plant_t *const plant = self->model->head.plant;
    const size_t             n     = plant->n;
    const blw_real_t *const  C     = &plant->C[i * n];
    blw_real_t               y_bar = BLW_R(0.0);

    if (used) {
        return (y[i] - plant->offset[i]) - blw_la_dot(n, C, self->x_bar);
    }
    if (self->model->n_u == plant->n) { /* x_hat = x_ref */
        return BLW_R(0.0);
    }
    for (size_t j = 0U; j < n; j++) {
        for (size_t k = 0U; k < n; k++) {
            y_bar += C[j] * plant->A[(j * n) + k] * (self->x_hat[k] - self->x_ref[k]);
        }
    }
    return y_bar;
}

/* e_i = Lam_i eta_i + b_i nu; Lam_i by rows. */
static void filter(const blw_guard_model_t *model, const blw_real_t *Lam, const blw_real_t *b,
                   blw_real_t nu, const blw_real_t *eta, blw_real_t *e)
{
    const size_t r     = model->r;
    const size_t reach = model->reach;

    for (size_t a = 0U; a < r; a++) {
        blw_real_t sum = BLW_R(0.0);

        if (a < reach) {
            sum = b[a] * nu;
        }
        for (size_t c = (a > reach) ? (a - reach) : 0U; c < r; c++) {
            sum += *Lam * eta[c];
            Lam++;
        }
        e[a] = sum;
    }
}

void blw_guard_advance(blw_guard_t *self, const blw_real_t *y, blw_mask_t used)
{
    const blw_guard_model_t *const model = self->model;
    const size_t                   r     = model->r;
    const size_t                   m     = model->head.plant->m;
    const size_t                   size  = blw_guard_filter_len(model);
    blw_mask_t                     rest  = used;

    for (size_t i = 0U; i < m; i++) {
        const blw_real_t nu = innovation(self, i, y, (rest & 1U) != 0U);

        filter(model, &model->Lam[i * size], &model->b[i * model->reach], nu, &self->eta[i * r],
               &self->e[i * r]);
        rest >>= 1;
    }
}
