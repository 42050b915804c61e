/* SPDX-License-Identifier: MIT */
/* ADMM engine for (2) in blw_l1.h, scaled form, over-relaxed, warm-started, bounded:
 *     nu = M (S zeta + rho (t - u)),  M = (S + rho I)^-1,  S = Z Z'                          (1)
 *     v  = alpha nu + (1 - alpha) t + u                                                      (2)
 *     t_g = (1 - (c_g / rho) / |v_g|)_+ v_g,   u = v - t                                     (3)
 * Boyd et al. 2011, (3.5)-(3.7) and section 3.4.3.  Between passes tau = zeta - t, dir = u,
 * l = S zeta, and nu uses the memory of A and L, which are adjacent and free meanwhile.  Once the
 * residuals are small the support of t goes to the active set, which verifies or corrects it; so
 * what is returned as converged is exact, whatever the engine. */
#include "blw_l1_internal.h"

#define ALPHA BLW_R(1.6)

/* Residuals relative to c_g below which the support of t is worth verifying. */
#define RESIDUAL_TRY BLW_R(1e-2)

/* Passes kept back for the active set, per row. */
#define RESERVE 2U

/* t of the last solve on its support, 0 elsewhere; u = l / rho, l cut to the thresholds: that is
 * where u ends when t is right. */
static void start(blw_l1_t *self, const blw_real_t *zeta)
{
    const blw_l1_model_t *const m = self->model;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const blw_real_t norm = blw_l1_norm(m, g, self->l);
        const blw_real_t cut  = (norm > m->c[g]) ? (m->c[g] / norm) : BLW_R(1.0);
        const bool       warm = blw_l1_in_support(self, g);
        for (size_t i = m->first[g]; i < m->first[g + 1U]; i++) {
            self->dir[i] = (cut / m->rho) * self->l[i];
            self->tau[i] = warm ? self->tau[i] : zeta[i];
        }
    }
}

/* (3) for group g, v of (2) in v[].  @return largest change of t. */
static blw_real_t shrink_group(blw_l1_t *self, const blw_real_t *zeta, size_t g,
                               const blw_real_t *v)
{
    const blw_l1_model_t *const m     = self->model;
    const size_t                i     = m->first[g];
    const size_t                size  = blw_l1_size(m, g);
    const blw_real_t            norm  = (size == 1U) ? blw_la_abs(v[0]) : blw_la_norm(2U, v);
    const blw_real_t            kappa = m->c[g] / m->rho;
    const blw_real_t            keep  = (norm > kappa) ? (BLW_R(1.0) - (kappa / norm)) : BLW_R(0.0);
    blw_real_t                  change = BLW_R(0.0);

    for (size_t j = 0U; j < size; j++) {
        const blw_real_t t   = keep * v[j];
        const blw_real_t tau = zeta[i + j] - t;
        change               = blw_la_max(change, blw_la_abs(tau - self->tau[i + j]));
        self->dir[i + j]     = v[j] - t;
        self->tau[i + j]     = tau;
    }
    return change;
}

/* One pass of (1) to (3).  @return the larger of primal and dual residual, relative to c_g. */
static blw_real_t admm_pass(blw_l1_t *self, const blw_real_t *zeta)
{
    const blw_l1_model_t *const m     = self->model;
    blw_real_t *const           nu    = self->A;
    blw_real_t                  worst = BLW_R(0.0);

    for (size_t i = 0U; i < m->N; i++) {
        self->step[i] = self->l[i] + (m->rho * ((zeta[i] - self->tau[i]) - self->dir[i]));
    }
    blw_la_symv(m->N, m->M, self->step, nu);
    for (size_t g = 0U; g < m->n_groups; g++) {
        const size_t i      = m->first[g];
        const size_t size   = blw_l1_size(m, g);
        blw_real_t   v[2]   = {BLW_R(0.0), BLW_R(0.0)};
        blw_real_t   primal = BLW_R(0.0);
        for (size_t j = 0U; j < size; j++) {
            const blw_real_t t = zeta[i + j] - self->tau[i + j];
            v[j] = (ALPHA * nu[i + j]) + ((BLW_R(1.0) - ALPHA) * t) + self->dir[i + j];
        }
        const blw_real_t dual = m->rho * shrink_group(self, zeta, g, v);
        for (size_t j = 0U; j < size; j++) {
            const blw_real_t t = zeta[i + j] - self->tau[i + j];
            primal             = blw_la_max(primal, blw_la_abs(nu[i + j] - t));
        }
        worst = blw_la_max(worst, blw_la_max(primal, dual) / m->c[g]);
    }
    return worst;
}

/* A = support of t, as many groups as L can hold. */
static void take_support(blw_l1_t *self, const blw_real_t *zeta)
{
    const blw_l1_model_t *const m    = self->model;
    const size_t                most = BLW_L1_ROWS(m->N, m->d, m->n_groups);

    self->n_A  = 0U;
    self->rows = 0U;
    for (size_t g = 0U; g < m->n_groups; g++) {
        if (((self->rows + blw_l1_size(m, g)) < most) && (blw_l1_aim(self, zeta, g) > BLW_R(0.0))) {
            blw_l1_support_add(self, g);
        }
    }
    for (size_t g = 0U; g < m->n_groups; g++) {
        for (size_t i = m->first[g]; (i < m->first[g + 1U]) && !blw_l1_in_support(self, g); i++) {
            self->tau[i] = zeta[i];
        }
    }
    blw_l1_project(m, self->tau, self->z);
}

static void solve(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x, blw_l1_info_t *info)
{
    const blw_l1_model_t *const m       = self->model;
    const size_t                reserve = (size_t)RESERVE * m->N;
    blw_real_t                  worst   = BLW_REAL_MAX;

    start(self, zeta);
    while ((worst > RESIDUAL_TRY) && ((info->iterations + reserve) < m->max_iterations)) {
        worst = admm_pass(self, zeta);
        info->iterations++;
    }
    take_support(self, zeta);
    blw_l1_multipliers(self);
    blw_l1_active_set(self, zeta, info);
    blw_la_gemv(m->n, m->N, m->F, self->tau, x);
}

static bool fits(const blw_l1_model_t *m)
{
    return (m->Z != NULL) && (m->M != NULL) && (m->rho > BLW_R(0.0));
}

const blw_l1_ops_t blw_l1_admm_ops = {
    .fits     = fits,
    .lay_out  = blw_l1_lay_out_Z,
    .multiply = blw_l1_multiply_Z,
    .solve    = solve,
};
