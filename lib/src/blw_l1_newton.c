/* SPDX-License-Identifier: MIT */
/* Newton engine for (2) in blw_l1.h, groups of one row or two.  A group is either inside, nu_g = 0,
 * or outside, l_g = c_g nu_g / |nu_g|, where only a pair can still turn.  A Newton step solves the
 * optimality conditions for the present groups inside and outside (blw_l1_newton_step.c); few rows
 * are inside in the end, often hardly more than n, so that a step is cheap.  The sides come from
 * passes of alternating directions (blw_l1_newton_start.c); mostly a few steps correct them until
 * (4) holds (blw_l1_newton_finish.c).  Where they do not, continuation [Madsen, Nielsen, "A finite
 * smoothing algorithm for linear l1 estimation", SIAM J. Optimization 3 (1993)]: |nu_g| is rounded
 * off below w = kappa width_g, width_g = the benign standard deviation of zeta_g,
 *     p(nu) = |nu|^2 / (2 w) + w / 2  if |nu| <= w,  else |nu|,                                (1)
 * which makes the objective smooth, l_g = c_g nu_g / max(|nu_g|, w), inside where that is linear; a
 * search along each step keeps the objective falling.  Once that has settled for a kappa that is
 * small, kappa = 0 is tried again; where that does not do, kappa falls by a fixed ratio. */
#include "blw_l1_newton.h"
#include "blw_cold.h"

/* Ratio of the next kappa, and the least for which it is worth while. */
#define KAPPA_RATIO BLW_R(0.2)
#define KAPPA_LAST  BLW_R(1e-6)
#define KAPPA_RISE  BLW_R(25.0) /* while none has settled */

/* Largest kappa from whose minimum kappa = 0 is tried. */
#define KAPPA_TRIED BLW_R(0.05)

/* Most steps for one kappa. */
#define STEPS 12U

/* Least share of a step that is worth another. */
#define STUCK BLW_R(1e-9)

/* Residual |l_g - c_g nu_g / max(|nu_g|, w)| / c_g that is good enough to go on. */
#define SETTLED BLW_R(0.5)

/* Search: most halvings, slope at the end of a whole step that is let pass, and of a shorter one,
 * as parts of the first slope. */
#define HALVINGS    30U
#define SLOPE_WHOLE BLW_R(0.5)
#define SLOPE_LEFT  BLW_R(0.25)
#define NOISE \
    (BLW_R(64.0) * BLW_REAL_EPS) /* of the objective: what rounding may leave of a slope */

/* Direction and side of every group for the present nu.
 * @return groups that changed sides or turned round. */
static BLW_APART size_t aim(const blw_l1_newton_t *at)
{
    blw_l1_t *const             self  = at->l1;
    const blw_l1_model_t *const m     = self->model;
    size_t                      moved = 0U;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const size_t     i      = m->first[g];
        const bool       before = blw_l1_outside(self, g, i);
        blw_real_t       nu[2];
        const blw_real_t norm    = blw_l1_nu(at, g, nu);
        const bool       outside = norm > (at->kappa * self->A[g]);
        const bool       turned  = blw_la_dot(blw_l1_size(m, g), nu, &self->dir[i]) < BLW_R(0.0);
        for (size_t j = i; j < m->first[g + 1U]; j++) {
            self->dir[j] = outside ? (nu[j - i] / norm) : BLW_R(0.0);
        }
        moved += ((outside != before) || turned) ? 1U : 0U;
    }
    return moved;
}

/* Slope of the objective along the step at alpha, given its part from |z|^2. */
static blw_real_t slope(const blw_l1_newton_t *at, blw_real_t alpha, blw_real_t quadratic)
{
    const blw_l1_t *const       self = at->l1;
    const blw_l1_model_t *const m    = self->model;
    blw_real_t                  sum  = quadratic;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const size_t            i    = m->first[g];
        const blw_real_t *const d    = &self->dz[i];
        const blw_real_t        v    = (at->zeta[i] - self->tau[i]) - (alpha * d[0]);
        blw_real_t              rate = v * d[0];
        blw_real_t              norm = blw_la_abs(v);
        if (blw_l1_size(m, g) == 2U) {
            const blw_real_t u = (at->zeta[i + 1U] - self->tau[i + 1U]) - (alpha * d[1]);
            rate += u * d[1];
            norm = blw_la_sqrt((v * v) + (u * u));
        }
        sum -= (m->c[g] * rate) / blw_la_max(norm, at->kappa * self->A[g]);
    }
    return sum;
}

/* Share of the step that does not pass the minimum along it by far. */
static BLW_APART blw_real_t search(const blw_l1_newton_t *at)
{
    const blw_l1_t *const self  = at->l1;
    const size_t          N     = self->model->N;
    const blw_real_t      first = blw_la_dot(N, self->dz, self->l);
    const blw_real_t      bend  = blw_la_dot(N, self->dz, self->z);
    const blw_real_t      noise = NOISE * blw_l1_objective(self, at->zeta);
    const blw_real_t      most  = blw_la_abs(slope(at, BLW_R(0.0), first));
    blw_real_t            low   = BLW_R(0.0);
    blw_real_t            high  = BLW_R(1.0);
    blw_real_t            alpha = BLW_R(1.0);
    blw_real_t            rise  = slope(at, alpha, first + bend);

    if (rise <= ((SLOPE_WHOLE * most) + noise)) {
        return alpha;
    }
    for (size_t h = 0U; (h < HALVINGS) && !(blw_la_abs(rise) <= ((SLOPE_LEFT * most) + noise));
         h++) {
        alpha = BLW_R(0.5) * (low + high);
        rise  = slope(at, alpha, first + (alpha * bend));
        if (rise <= BLW_R(0.0)) {
            low = alpha;
        } else {
            high = alpha;
        }
    }
    return alpha;
}

static void move(blw_l1_newton_t *at, blw_real_t alpha)
{
    blw_l1_t *const self = at->l1;
    const size_t    N    = self->model->N;

    blw_la_axpy(N, alpha, self->dz, self->tau);
    blw_la_axpy(N, alpha, self->z, self->l);
    blw_la_axpy(self->model->n, alpha - BLW_R(1.0), self->step, at->x);
}

/* Keep the point behind A, and go back to it. */
static void keep(blw_l1_newton_t *at)
{
    const blw_l1_t *const       self = at->l1;
    const blw_l1_model_t *const m    = self->model;
    blw_real_t *const           kept = &self->A[m->n_groups];

    blw_la_copy(m->N, self->tau, kept);
    blw_la_copy(m->N, self->l, &kept[m->N]);
    blw_la_copy(m->n, at->x, &kept[2U * (size_t)m->N]);
}

static void restore(blw_l1_newton_t *at)
{
    blw_l1_t *const             self = at->l1;
    const blw_l1_model_t *const m    = self->model;
    const blw_real_t *const     kept = &self->A[m->n_groups];

    blw_la_copy(m->N, kept, self->tau);
    blw_la_copy(m->N, &kept[m->N], self->l);
    blw_la_copy(m->n, &kept[2U * (size_t)m->N], at->x);
}

/* The next kappa: nu_g = D l_g on groups inside, and l and x follow. */
static BLW_APART void tighten(blw_l1_newton_t *at)
{
    blw_l1_t *const             self = at->l1;
    const blw_l1_model_t *const m    = self->model;

    at->kappa *= KAPPA_RATIO;
    for (size_t g = 0U; g < m->n_groups; g++) {
        const size_t     i       = m->first[g];
        const bool       outside = blw_l1_outside(self, g, i);
        const blw_real_t norm    = blw_la_max(blw_l1_norm(m, g, self->l), m->c[g]);
        const blw_real_t D       = (at->kappa * self->A[g]) / norm;
        for (size_t j = i; j < m->first[g + 1U]; j++) {
            const blw_real_t nu = outside ? (at->zeta[j] - self->tau[j]) : (D * self->l[j]);
            self->dz[j]         = (at->zeta[j] - nu) - self->tau[j];
        }
    }
    blw_la_symv(m->N, m->S, self->dz, self->z);
    blw_la_gemv(m->n, m->N, m->F, self->dz, self->step);
    blw_la_axpy(m->n, BLW_R(1.0), self->step, at->x);
    move(at, BLW_R(1.0));
}

/* A larger kappa, from the point that was kept. */
static void loosen(blw_l1_newton_t *at)
{
    at->kappa *= KAPPA_RISE;
    restore(at);
    (void)aim(at);
}

/* Newton steps for one kappa.  @return whether they settled. */
static BLW_APART bool descend(blw_l1_newton_t *at, blw_l1_info_t *info)
{
    bool       settled = false;
    blw_real_t alpha   = BLW_R(1.0);

    for (size_t k = 0U; (k < STEPS) && !settled && (alpha >= STUCK)
                        && (info->iterations < at->l1->model->max_iterations);
         k++) {
        blw_l1_newton_step(at);
        info->iterations++;
        alpha = search(at);
        move(at, alpha);
        const bool stayed = (aim(at) == 0U);
        settled = (stayed && (alpha >= BLW_R(1.0))) || (blw_l1_newton_residual(at) <= SETTLED);
    }
    return settled;
}

/* kappa = 0 from the point that was kept, or back to it.  @return whether that is the minimum. */
static BLW_APART bool try_to_finish(blw_l1_newton_t *at, blw_l1_info_t *info)
{
    const bool done = blw_l1_newton_finish(at, info);

    if (!done) {
        restore(at);
        (void)aim(at);
    }
    return done;
}

static void solve(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x, blw_l1_info_t *info)
{
    const blw_l1_model_t *const m   = self->model;
    blw_l1_newton_t             at  = {.l1 = self, .zeta = zeta};
    bool                        any = false; /* whether a kappa has settled */

    at.x = x;
    blw_l1_newton_start(&at);
    keep(&at);
    info->converged = try_to_finish(&at, info);
    while (!info->converged && (info->iterations < m->max_iterations) && (at.kappa >= KAPPA_LAST)) {
        const bool settled = descend(&at, info);
        const bool last    = (at.kappa * KAPPA_RATIO) < KAPPA_LAST;
        if (settled) {
            keep(&at);
            any = true;
        }
        if (last || (settled && (at.kappa <= KAPPA_TRIED))) {
            info->converged = try_to_finish(&at, info);
        }
        if (!info->converged && any) {
            tighten(&at);
        } else if (!info->converged) {
            loosen(&at);
        }
    }
    if (info->converged) {
        blw_l1_newton_remember(&at);
    } else {
        self->n_A = 0U;
        restore(&at);
    }
}

static void multiply(blw_l1_t *self, const blw_real_t *zeta)
{
    blw_la_symv(self->model->N, self->model->S, zeta, self->l);
}

static BLW_COLD void lay_out(blw_l1_t *self, blw_real_t *mem)
{
    const blw_l1_model_t *const m = self->model;

    self->step = blw_la_take(&mem, (size_t)m->N + m->n);
    self->L    = blw_la_take(&mem, blw_la_packed_row((size_t)m->N + m->n));
    self->z    = blw_la_take(&mem, m->N);
    self->dz   = blw_la_take(&mem, m->N);
    self->A    = mem;
}

static bool fits(const blw_l1_model_t *m)
{
    return blw_l1_has_pairs(m) && (m->Z == NULL) && (m->S != NULL) && (m->W != NULL)
           && (m->G != NULL) && (m->P != NULL) && (m->M != NULL) && (m->rho > BLW_R(0.0));
}

const blw_l1_ops_t blw_l1_newton_ops = {
    .fits     = fits,
    .lay_out  = lay_out,
    .multiply = multiply,
    .solve    = solve,
};
