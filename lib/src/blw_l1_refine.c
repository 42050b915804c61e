/* SPDX-License-Identifier: MIT */
/* The end of a solve on the tableau (blw_l1_tableau.c): l, nu and x from the sweeps are corrected
 * by residuals formed in W and G, and held against (4) of blw_l1.h. */
#include "blw_cold.h"
#include "blw_l1_internal.h"

/* Most corrections by T.  Each leaves of the error what T is wrong by, so the first that is SMALL,
 * in standard deviations of x, is the last. */
#define REFINEMENTS 3U
#define SMALL       BLW_R(1e-2)

/* What rounding leaves of nu_i = zeta_i - tau_i, relative to what it is made of. */
#define NU_SLACK (BLW_R(16.0) * BLW_REAL_EPS)

/* |l_i| <= c_i outside A, nu_i of the sign of l_i on A; what rounding may leave is asked last. */
static bool row_holds(const blw_l1_t *self, const blw_real_t *zeta, size_t i)
{
    const blw_real_t c    = self->model->c[i];
    const blw_real_t size = blw_la_abs(self->l[i]);

    if (!blw_l1_clipped(self, i)) {
        return (size <= c) || (size <= (c + blw_l1_slack(c)));
    }
    const blw_real_t nu   = (zeta[i] - self->tau[i]) * self->dir[i];
    const blw_real_t W_ii = self->model->W[blw_la_packed_row(i) + i];
    return (nu >= BLW_R(0.0)) || (nu >= -(NU_SLACK * (blw_la_abs(zeta[i]) + (W_ii * size))));
}

bool blw_l1_holds(const blw_l1_t *self, const blw_real_t *zeta)
{
    bool ok = true;

    for (size_t i = 0U; ok && (i < self->model->N); i++) {
        ok = row_holds(self, zeta, i);
    }
    return ok;
}

/* out = F v. */
static void fuse(const blw_l1_model_t *m, const blw_real_t *v, blw_real_t *out)
{
    if (m->fast != NULL) {
        m->fast->fuse(m->F, v, out);
    } else {
        blw_la_gemv(m->n, m->N, m->F, v, out);
    }
}

/* out = F' h. */
static void spread(const blw_l1_model_t *m, const blw_real_t *h, blw_real_t *out)
{
    if (m->fast != NULL) {
        m->fast->spread(m->F, h, out);
        return;
    }
    blw_la_zero(m->N, out);
    for (size_t j = 0U; j < m->n; j++) {
        blw_la_axpy(m->N, h[j], &m->F[j * m->N], out);
    }
}

/* From what the sweeps left: l_A = c_A s_A, tau = zeta - nu, x = F tau. */
static void split(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x)
{
    const blw_l1_model_t *const m = self->model;

    for (size_t i = 0U; i < m->N; i++) {
        self->tau[i] = zeta[i];
        if (blw_l1_clipped(self, i)) {
            self->tau[i] -= self->l[i];
            self->l[i] = m->c[i] * self->dir[i];
        }
    }
    fuse(m, self->tau, x);
}

/* One step of refinement with the inverse that T is a part of.  With e = zeta - tau outside A,
 * h = -G' l, w = F' h and P = F W F',
 *     [ dl_f  ]     [  e_f ]   [ w_f ]
 *     [ dnu_A ] = T [ -w_A ] + [ 0   ],     dx = F_f e_f - F_A dnu_A - P h.                     (3)
 * *bound = |dx|.  @return whether dx is a small part of the standard deviations of x. */
static BLW_APART bool correct(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x,
                              blw_real_t *bound)
{
    const blw_l1_model_t *const m      = self->model;
    blw_real_t *const           h      = &self->step[m->N];
    blw_real_t *const           change = self->z;
    blw_real_t                  sum    = BLW_R(0.0);
    bool                        small  = true;

    blw_l1_imbalance(m, self->l, h);
    spread(m, h, self->step);
    for (size_t i = 0U; i < m->N; i++) {
        const bool clipped = blw_l1_clipped(self, i);
        self->l[i] += clipped ? BLW_R(0.0) : self->step[i];
        self->step[i] = clipped ? -self->step[i] : (zeta[i] - self->tau[i]);
    }
    blw_l1_symv(m, self->T, self->step, change);
    for (size_t i = 0U; i < m->N; i++) {
        if (blw_l1_clipped(self, i)) {
            self->tau[i] -= change[i];
            self->step[i] = -change[i];
        } else {
            self->tau[i] = zeta[i];
            self->l[i] += change[i];
        }
    }
    blw_la_symv(m->n, m->P, h, change);
    fuse(m, self->step, h);
    for (size_t j = 0U; j < m->n; j++) {
        const blw_real_t dx   = h[j] - change[j];
        const blw_real_t P_jj = m->P[blw_la_packed_row(j) + j];
        x[j] += dx;
        sum += dx * dx;
        small = small && ((dx * dx) <= (SMALL * SMALL * P_jj));
    }
    *bound = blw_la_sqrt(sum);
    return small;
}

bool blw_l1_refine(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x, blw_real_t *bound,
                   bool *intact)
{
    bool settled = false;

    split(self, zeta, x);
    for (size_t round = 0U; (round < REFINEMENTS) && !settled; round++) {
        blw_l1_predict(self->model, self->l, x, self->tau);
        settled = correct(self, zeta, x, bound);
    }
    *intact = settled; /* the factors take the place of T */
    return settled ? blw_l1_holds(self, zeta) : blw_l1_kkt(self, zeta, x, bound);
}
