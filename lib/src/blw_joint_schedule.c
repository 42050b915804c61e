/* SPDX-License-Identifier: MIT */
/* Precomputed gains and weights. */
#include "blw_cold.h"
#include "blw_joint_internal.h"
#include "blw_la.h"

BLW_COLD void blw_joint_schedule_reset(blw_joint_t *self)
{
    blw_la_copy(self->model->r, self->model->schedule->sd_gap, self->sd);
}

/* (2), (3) of one estimator; all innovations are taken before the state changes. */
static void correct_local(blw_joint_t *self, size_t i, const blw_real_t *K, blw_mask_t heard)
{
    const size_t          n     = self->plant.n;
    const size_t          m_i   = blw_joint_sensors(self->model, i);
    blw_real_t *const     x     = &self->delta[i * n];
    const uint16_t *const list  = &self->model->sensor[self->model->first[i]];
    blw_real_t *const     move  = self->scratch;
    blw_real_t            theta = BLW_R(0.0);
    blw_real_t            phi   = BLW_R(0.0);

    blw_la_zero(n, move);
    for (size_t j = 0U; j < m_i; j++) {
        if (!blw_joint_in(heard, list[j])) {
            continue;
        }
        const blw_real_t e = blw_joint_innovation(self, i, j);
        for (size_t a = 0U; a < n; a++) {
            move[a] += K[(a * m_i) + j] * e;
        }
        theta += K[(n * m_i) + j] * e;
        phi += K[((n + 1U) * m_i) + j] * e;
    }
    blw_la_axpy(n, BLW_R(1.0), move, x);
    self->theta[i] += theta;
    self->phi[i] += phi;
}

/* dx of (4) */
static void fuse(blw_joint_t *self, const blw_real_t *G)
{
    const size_t n = self->plant.n;

    blw_la_copy(n, self->delta, self->dx);
    for (size_t i = 1U; i < self->model->r; i++) {
        blw_la_copy(n, &self->delta[i * n], self->scratch);
        blw_la_axpy(n, BLW_R(-1.0), self->delta, self->scratch);
        blw_la_gemv_add(n, n, &G[(i - 1U) * n * n], self->scratch, self->dx);
    }
}

void blw_joint_schedule_correct(blw_joint_t *self, blw_mask_t heard)
{
    const blw_joint_model_t *const    model = self->model;
    const blw_joint_schedule_t *const gains = model->schedule;
    const size_t                      n     = self->plant.n;
    const size_t                      r     = model->r;
    const size_t entry = (size_t)((self->k < gains->steps) ? self->k : gains->steps) - 1U;

    const blw_real_t *K = &gains->K[entry * (n + 2U) * model->first[r]];
    for (size_t i = 0U; i < r; i++) {
        correct_local(self, i, K, heard);
        K += (n + 2U) * blw_joint_sensors(model, i);
        self->sd[i] = blw_joint_in(heard, blw_joint_weak(model, i)) ? gains->sd[(entry * r) + i]
                                                                    : gains->sd_gap[i];
    }
    fuse(self, (r > 1U) ? &gains->G[entry * (r - 1U) * n * n] : NULL);
}
