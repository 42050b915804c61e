/* SPDX-License-Identifier: MIT */
/* Where the Newton steps of blw_l1_newton.c start.  With the smoothing of (1) there, kappa = rho of
 * the model, and every group inside, the minimum is linear in zeta,
 *     l = M zeta,   nu = D l,   D = rho width_g / c_g,
 *     M = K - K G (G' K G)^-1 G' K,   K = (W + D)^-1,                                          (1)
 * and so alternating directions [Boyd et al., "Distributed Optimization and Statistical Learning
 * via ADMM", section 3.1.1] in the metric of D need one product with M per pass, with t for nu and
 * the scaled dual u:
 *     l = M (zeta - t + u),   nu = t - u + D l,
 *     t = shrink(q, rho width_g),   q = alpha nu + (1 - alpha) t + u,   u = q - t.             (2)
 * A few passes, each a sixth of a Newton step, find most sides.  Noise is fresh in every sample:
 * only what a gross attack has clipped is taken over from the last solve. */
#include "blw_l1_newton.h"

#define PASSES     20U
#define RELAXATION BLW_R(1.8)

/* First kappa, at least. */
#define KAPPA_FIRST BLW_R(0.006)
#define KAPPA_GAP   BLW_R(1.0) /* relative to |nu_g - t_g| / width_g: what the passes left open */

/* |nu_g| / width_g from which a group is taken to be under the same attack in the next solve. */
#define GROSS BLW_R(10.0)

/* t = nu of the groups that were under a gross attack, or 0 where that is no better, or no more. */
static void take_over(const blw_l1_newton_t *at, blw_real_t *t)
{
    blw_l1_t *const             self   = at->l1;
    const blw_l1_model_t *const m      = self->model;
    const blw_real_t            kalman = blw_la_dot(m->N, at->zeta, self->l);
    blw_real_t                  cost   = BLW_R(0.0); /* sum_g c_g |t_g| */

    blw_la_fill(m->N, BLW_R(0.0), t);
    for (size_t g = 0U; (g < m->n_groups) && (self->n_A > 0U); g++) {
        const size_t i = m->first[g];
        blw_la_axpy(blw_l1_size(m, g), self->A[g], &self->dir[i], &t[i]);
        cost += m->c[g] * self->A[g];
    }
    if (self->n_A > 0U) {
        blw_la_copy(m->N, at->zeta, self->tau);
        blw_la_axpy(m->N, BLW_R(-1.0), t, self->tau);
        blw_la_symv(m->N, m->S, self->tau, self->step);
        if (!((blw_la_dot(m->N, self->tau, self->step) + (BLW_R(2.0) * cost)) < kalman)) {
            blw_la_fill(m->N, BLW_R(0.0), t);
        }
    }
}

/* Widths of all groups; u = D l where t says that l = c dir. */
static void measure(const blw_l1_newton_t *at, const blw_real_t *t, blw_real_t *u)
{
    blw_l1_t *const             self = at->l1;
    const blw_l1_model_t *const m    = self->model;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const size_t     i    = m->first[g];
        const blw_real_t norm = blw_l1_norm(m, g, t);
        self->A[g]            = blw_la_sqrt(m->W[blw_la_packed_row(i) + i]);
        for (size_t j = i; j < m->first[g + 1U]; j++) {
            u[j] = (norm > BLW_R(0.0)) ? ((m->rho * self->A[g] * t[j]) / norm) : BLW_R(0.0);
        }
    }
}

/* (2) for group g; a group inside needs no square root. */
static void pass_group(const blw_l1_newton_t *at, size_t g, blw_real_t *t, blw_real_t *u)
{
    const blw_l1_t *const       self    = at->l1;
    const blw_l1_model_t *const m       = self->model;
    const size_t                first   = m->first[g];
    const size_t                end     = m->first[g + 1U];
    const blw_real_t            limit   = m->rho * self->A[g];
    const blw_real_t            D       = limit / m->c[g];
    blw_real_t                  squares = BLW_R(0.0);
    blw_real_t                  part    = BLW_R(0.0);

    for (size_t j = first; j < end; j++) {
        const blw_real_t nu = (t[j] - u[j]) + (D * self->l[j]);
        u[j] += t[j] + (RELAXATION * (nu - t[j]));
        squares += u[j] * u[j];
    }
    if (squares > (limit * limit)) {
        part = BLW_R(1.0) - (limit / blw_la_sqrt(squares));
    }
    for (size_t j = first; j < end; j++) {
        t[j] = part * u[j];
        u[j] -= t[j];
    }
}

/* tau = zeta - nu after the last pass; kappa no less than it has left open, |nu - t|. */
static void finish_passes(blw_l1_newton_t *at, const blw_real_t *t)
{
    blw_l1_t *const             self = at->l1;
    const blw_l1_model_t *const m    = self->model;

    at->kappa = KAPPA_FIRST;
    for (size_t g = 0U; g < m->n_groups; g++) {
        const blw_real_t D = (m->rho * self->A[g]) / m->c[g];
        for (size_t j = m->first[g]; j < m->first[g + 1U]; j++) {
            self->tau[j]  = self->step[j] - (D * self->l[j]);
            self->step[j] = (at->zeta[j] - self->tau[j]) - t[j];
        }
        const blw_real_t gap = blw_l1_norm(m, g, self->step) / self->A[g];
        at->kappa            = blw_la_max(at->kappa, KAPPA_GAP * gap);
    }
}

/* Outside are the groups with t_g /= 0. */
static void take_sides(const blw_l1_newton_t *at, const blw_real_t *t)
{
    const blw_l1_t *const       self = at->l1;
    const blw_l1_model_t *const m    = self->model;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const blw_real_t norm = blw_l1_norm(m, g, t);
        for (size_t j = m->first[g]; j < m->first[g + 1U]; j++) {
            self->dir[j] = (norm > BLW_R(0.0)) ? (t[j] / norm) : BLW_R(0.0);
        }
    }
}

void blw_l1_newton_start(blw_l1_newton_t *at)
{
    blw_l1_t *const             self = at->l1;
    const blw_l1_model_t *const m    = self->model;
    blw_real_t *const           t    = self->dz;
    blw_real_t *const           u    = self->z;

    take_over(at, t);
    measure(at, t, u);
    for (size_t k = 0U; k <= PASSES; k++) {
        for (size_t i = 0U; i < m->N; i++) {
            self->step[i] = (at->zeta[i] - t[i]) + u[i];
        }
        blw_la_symv(m->N, m->M, self->step, self->l);
        for (size_t g = 0U; g < m->n_groups; g++) {
            pass_group(at, g, t, u);
        }
    }
    finish_passes(at, t);
    take_sides(at, t);
    blw_la_gemv(m->n, m->N, m->F, self->tau, at->x);
}

void blw_l1_newton_remember(const blw_l1_newton_t *at)
{
    blw_l1_t *const             self = at->l1;
    const blw_l1_model_t *const m    = self->model;

    self->n_A = 0U;
    for (size_t g = 0U; g < m->n_groups; g++) {
        blw_real_t       nu[2];
        const blw_real_t norm  = blw_l1_nu(at, g, nu);
        const bool       gross = norm > (GROSS * self->A[g]);
        self->A[g]             = gross ? norm : BLW_R(0.0);
        self->n_A              = (uint16_t)(self->n_A + (gross ? 1U : 0U));
    }
}
