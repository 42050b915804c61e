/* SPDX-License-Identifier: MIT */
/* Where the Newton steps of blw_l1_newton.c start.  With the smoothing of (1) there, kappa = rho of
 * the model, and every group inside, the minimum is linear in zeta,
 *     l = M zeta,   nu = D l,   D = rho width_g / c_g,
 *     M = K - K G (G' K G)^-1 G' K,   K = (W + D)^-1,                                          (1)
 * and so alternating directions [Boyd et al., "Distributed Optimization and Statistical Learning
 * via ADMM", section 3.1.1] in the metric of D need one product with M per pass, with t for nu and
 * the scaled dual u, both from their sum q = t + u:
 *     u = q clipped to |u_g| <= rho width_g,   l = M (zeta - t + u),   nu = t - u + D l,
 *     q += alpha (nu - t).                                                                     (2)
 * Some passes, each a fourth of a step with a new factor, find most sides.  Noise is fresh in every
 * sample: only what a gross attack has clipped is taken over from the last solve. */
#include "blw_l1_newton.h"

/* Most passes; what a pass may still change of nu, relative to width_g, to be the last but one. */
#define PASSES     32U
#define ENOUGH     BLW_R(0.02)
#define RELAXATION BLW_R(1.8)

/* First kappa, at least. */
#define KAPPA_FIRST BLW_R(0.006)
#define KAPPA_GAP   BLW_R(1.0) /* relative to |nu_g - t_g| / width_g: what the passes left open */

/* |nu_g| / width_g from which a group is taken to be under the same attack in the next solve. */
#define GROSS BLW_R(10.0)

/* t = nu of the groups that were under a gross attack, or 0 where that is no better, or no more. */
static void take_over(const blw_l1_newton_t *at, blw_real_t *t)
{
    blw_l1_t *const             self = at->l1;
    const blw_l1_model_t *const m    = self->model;
    blw_real_t                  cost = BLW_R(0.0); /* sum_g c_g |t_g| */

    blw_la_fill(m->N, BLW_R(0.0), t);
    if (self->n_A == 0U) {
        return;
    }
    for (size_t g = 0U; g < m->n_groups; g++) {
        const size_t i = m->first[g];
        blw_la_axpy(blw_l1_size(m, g), self->A[g], &self->dir[i], &t[i]);
        cost += m->c[g] * self->A[g];
    }
    const blw_real_t kalman = blw_la_dot(m->N, at->zeta, self->l);
    blw_la_copy(m->N, at->zeta, self->tau);
    blw_la_axpy(m->N, BLW_R(-1.0), t, self->tau);
    blw_la_symv(m->N, m->S, self->tau, self->step);
    if (!((blw_la_dot(m->N, self->tau, self->step) + (BLW_R(2.0) * cost)) < kalman)) {
        blw_la_fill(m->N, BLW_R(0.0), t);
    }
}

/* Widths of all groups; q = t + D l, l = c dir where t is not 0. */
static void measure(const blw_l1_newton_t *at, blw_real_t *q)
{
    blw_l1_t *const             self = at->l1;
    const blw_l1_model_t *const m    = self->model;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const size_t     i    = m->first[g];
        const blw_real_t norm = blw_l1_norm(m, g, q);
        self->A[g]            = blw_la_sqrt(m->W[blw_la_packed_row(i) + i]);
        for (size_t j = i; (norm > BLW_R(0.0)) && (j < m->first[g + 1U]); j++) {
            q[j] += (m->rho * self->A[g] * q[j]) / norm;
        }
    }
}

/* (2) for group g: its step with the l of the last pass, relaxed by alpha; then u and what l is to
 * be made of.  A group inside needs no square root.
 * @return the square of the step before it was relaxed, nu - t, relative to width_g. */
static blw_real_t pass_group(const blw_l1_newton_t *at, size_t g, blw_real_t alpha, blw_real_t *q,
                             blw_real_t *u)
{
    const blw_l1_t *const self    = at->l1;
    const size_t          i       = self->model->first[g];
    const size_t          last    = self->model->first[g + 1U] - 1U; /* i if there is one row */
    const blw_real_t      width   = self->A[g];
    const blw_real_t      limit   = self->model->rho * width;
    const blw_real_t      D       = limit / self->model->c[g];
    const blw_real_t      v       = (D * self->l[i]) - u[i];
    const blw_real_t      w       = (D * self->l[last]) - u[last];
    const blw_real_t      p       = q[i] + (alpha * v);
    const blw_real_t      r       = q[last] + (alpha * w);
    const blw_real_t      squares = (last == i) ? (p * p) : ((p * p) + (r * r));
    blw_real_t            part    = BLW_R(1.0);

    if (squares > (limit * limit)) {
        part = limit / blw_la_sqrt(squares);
    }
    q[i]             = p;
    u[i]             = part * p;
    self->step[i]    = (at->zeta[i] - p) + (BLW_R(2.0) * u[i]);
    q[last]          = r;
    u[last]          = part * r;
    self->step[last] = (at->zeta[last] - r) + (BLW_R(2.0) * u[last]);
    return ((v * v) + (w * w)) / (width * width);
}

/* t, tau = zeta - nu after the last pass; kappa no less than it has left open, |nu - t|. */
static void finish_passes(blw_l1_newton_t *at, const blw_real_t *u, blw_real_t *q)
{
    blw_l1_t *const             self = at->l1;
    const blw_l1_model_t *const m    = self->model;

    at->kappa = KAPPA_FIRST;
    for (size_t g = 0U; g < m->n_groups; g++) {
        const blw_real_t D = (m->rho * self->A[g]) / m->c[g];
        for (size_t j = m->first[g]; j < m->first[g + 1U]; j++) {
            self->tau[j]  = self->step[j] - (D * self->l[j]);
            self->step[j] = (D * self->l[j]) - u[j];
            q[j] -= u[j];
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
    blw_l1_t *const             self  = at->l1;
    const blw_l1_model_t *const m     = self->model;
    blw_real_t *const           q     = self->dz;
    blw_real_t *const           u     = self->z;
    blw_real_t                  alpha = BLW_R(0.0);
    blw_real_t                  gap   = BLW_REAL_MAX;

    take_over(at, q);
    measure(at, q);
    blw_la_zero(m->N, u);
    for (size_t k = 0U; (k < PASSES) && (gap > (ENOUGH * ENOUGH)); k++) {
        gap = BLW_R(0.0);
        for (size_t g = 0U; g < m->n_groups; g++) {
            gap = blw_la_max(gap, pass_group(at, g, alpha, q, u));
        }
        alpha = RELAXATION;
        blw_la_symv(m->N, m->M, self->step, self->l);
    }
    finish_passes(at, u, q);
    take_sides(at, q);
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
