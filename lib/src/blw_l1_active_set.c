/* SPDX-License-Identifier: MIT */
/* Active-set engine for (2) in blw_l1.h.  Every pass takes a Newton step on the support A, exact if
 * all groups have one row, and then changes A by one group: the first whose nu vanishes on the way
 * leaves, or, once the residual on A is small, the one that violates |l_g| <= c_g most enters.  The
 * objective never rises; the end is verified with z and l formed anew from tau. */
#include "blw_cold.h"
#include "blw_l1_internal.h"

/* Residual on A, relative to c_g + |z|: low enough for a group to enter; low enough for the end;
 * and low enough for either if full passes do not lower it any more, because tau is rounded. */
#define RESIDUAL_ENTER   BLW_R(1e-4)
#define RESIDUAL_FINAL   (BLW_R(256.0) * BLW_REAL_EPS)
#define RESIDUAL_STALLED (BLW_R(8192.0) * BLW_REAL_EPS)

/* Search along a step, pairs only: most halvings, the share of the first slope that counts as its
 * end, and the share of |nu_g| below which a pair that stopped the step is taken to vanish. */
#define BISECTIONS 40U
#define SLOPE_LEFT BLW_R(0.25)
#define NOISE      (BLW_R(16.0) * BLW_REAL_EPS) /* of the objective, relative: no rise */
#define VANISHED   BLW_R(1e-3)

/* What a pass did. */
typedef struct pass {
    blw_real_t alpha;   /* fraction of the Newton step taken */
    size_t     blocked; /* member of A whose nu vanished, or n_A */
} pass_t;

/* Largest alpha <= 1 that keeps the sign of nu on every group of one row. */
static pass_t first_crossing(const blw_l1_t *self, const blw_real_t *zeta)
{
    const blw_l1_model_t *const m    = self->model;
    pass_t                      pass = {BLW_R(1.0), self->n_A};
    size_t                      r    = 0U;

    for (size_t k = 0U; k < self->n_A; k++) {
        const size_t     g    = blw_l1_member(self, k);
        const size_t     i    = m->first[g];
        const blw_real_t nu   = (zeta[i] - self->tau[i]) * self->dir[i];
        const blw_real_t loss = self->step[r] * self->dir[i];
        if ((blw_l1_size(m, g) == 1U) && ((pass.alpha * loss) > nu)) {
            pass.alpha   = blw_la_max(nu, BLW_R(0.0)) / loss;
            pass.blocked = k;
        }
        r += blw_l1_size(m, g);
    }
    return pass;
}

/* nu of member k after alpha steps, two rows (the second 0 for one); r = its first row in step. */
static void nu_after(const blw_l1_t *self, const blw_real_t *zeta, size_t k, size_t r,
                     blw_real_t alpha, blw_real_t nu[2])
{
    const size_t g = blw_l1_member(self, k);
    const size_t i = self->model->first[g];

    nu[0] = (zeta[i] - self->tau[i]) - (alpha * self->step[r]);
    nu[1] = BLW_R(0.0);
    if (blw_l1_size(self->model, g) == 2U) {
        nu[1] = (zeta[i + 1U] - self->tau[i + 1U]) - (alpha * self->step[r + 1U]);
    }
}

/* Slope of the objective along the step at alpha. */
static blw_real_t slope(const blw_l1_t *self, const blw_real_t *zeta, blw_real_t alpha)
{
    const blw_l1_model_t *const m = self->model;
    size_t                      r = 0U;
    blw_real_t                  sum =
        blw_la_dot(m->d, self->z, self->dz) + (alpha * blw_la_dot(m->d, self->dz, self->dz));

    for (size_t k = 0U; k < self->n_A; k++) {
        const size_t g    = blw_l1_member(self, k);
        const size_t size = blw_l1_size(m, g);
        blw_real_t   nu[2];
        nu_after(self, zeta, k, r, alpha, nu);
        const blw_real_t norm = blw_la_norm(2U, nu);
        if (norm > BLW_R(0.0)) {
            sum -= (m->c[g] * blw_la_dot(size, nu, &self->step[r])) / norm;
        }
        r += size;
    }
    return sum;
}

/* The pair that shrinks most over alpha steps, if below the share VANISHED; else n_A. */
static size_t vanished_pair(const blw_l1_t *self, const blw_real_t *zeta, blw_real_t alpha)
{
    blw_real_t least = VANISHED;
    size_t     found = self->n_A;
    size_t     r     = 0U;

    for (size_t k = 0U; k < self->n_A; k++) {
        const size_t g    = blw_l1_member(self, k);
        const size_t size = blw_l1_size(self->model, g);
        blw_real_t   nu[2];
        nu_after(self, zeta, k, r, alpha, nu);
        const blw_real_t before = blw_l1_nu_norm(self, zeta, g);
        const blw_real_t after  = blw_la_norm(2U, nu);
        if ((size == 2U) && (after < (least * before))) {
            least = after / before;
            found = k;
        }
        r += size;
    }
    return found;
}

/* Whether a slope `at` after alpha steps is too steep upwards.  The objective is convex: over the
 * step it rises by at most alpha times this slope.  What is not a number is too steep. */
static bool too_steep(const blw_l1_t *self, blw_real_t alpha, blw_real_t at, blw_real_t most)
{
    return !(at <= most)
           && !((alpha * at) <= (NOISE * blw_la_dot(self->model->d, self->z, self->z)));
}

/* Shorten a step that overshoots the minimum along it: pairs make the objective non-quadratic, a
 * pair that is carried past 0 turns the slope round at once, and a step along a null direction of H
 * may be of any length and sign.  The objective never rises. */
static void search(const blw_l1_t *self, const blw_real_t *zeta, pass_t *pass)
{
    const blw_real_t most = -SLOPE_LEFT * slope(self, zeta, BLW_R(0.0));
    blw_real_t       low  = BLW_R(0.0);
    blw_real_t       high = pass->alpha;
    blw_real_t       at   = slope(self, zeta, high);

    if ((high <= BLW_R(0.0)) || !too_steep(self, high, at, most)) {
        return;
    }
    for (size_t h = 0U; (h < BISECTIONS) && !(blw_la_abs(at) <= most); h++) {
        pass->alpha = BLW_R(0.5) * (low + high);
        at          = slope(self, zeta, pass->alpha);
        if (at <= BLW_R(0.0)) {
            low = pass->alpha;
        } else {
            high = pass->alpha;
        }
    }
    if (too_steep(self, pass->alpha, at, most)) {
        pass->alpha = low;
    }
    pass->blocked = vanished_pair(self, zeta, pass->alpha);
}

/* Drop every pair for which nu_g = 0 is the best with all others fixed,
 * |l_g + Z_g Z_g' nu_g| <= c_g, or that rounding has brought there. */
static BLW_APART bool drop_pairs(blw_l1_t *self, const blw_real_t *zeta)
{
    const blw_l1_model_t *const m       = self->model;
    bool                        dropped = false;
    size_t                      k       = 0U;

    while (k < self->n_A) {
        const size_t g    = blw_l1_member(self, k);
        const size_t i    = m->first[g];
        bool         drop = false;
        if (blw_l1_size(m, g) == 2U) {
            size_t                  len[2];
            const blw_real_t *const row[2] = {blw_l1_row(m, i, &len[0]),
                                              blw_l1_row(m, i + 1U, &len[1])};
            const blw_real_t nu[2] = {zeta[i] - self->tau[i], zeta[i + 1U] - self->tau[i + 1U]};
            const blw_real_t S01   = blw_la_dot(len[0], row[0], row[1]);
            const blw_real_t l[2]  = {
                 self->l[i] + (blw_la_dot(len[0], row[0], row[0]) * nu[0]) + (S01 * nu[1]),
                 self->l[i + 1U] + (S01 * nu[0]) + (blw_la_dot(len[1], row[1], row[1]) * nu[1])};
            drop = (blw_la_norm(2U, l) <= m->c[g]) || (blw_la_norm(2U, nu) <= BLW_R(0.0));
        }
        if (drop) {
            blw_l1_support_drop(self, zeta, k);
            blw_l1_multipliers(self);
            dropped = true;
        } else {
            k++;
        }
    }
    return dropped;
}

/* Whether L can hold another group: A never has more rows than one beyond the rank of Z in exact
 * arithmetic, where the step along the null direction takes one out again.  A pivot that is nothing
 * but rounding may pass for a true one; then g has to wait until a group has left. */
static bool has_room(const blw_l1_t *self, size_t g)
{
    const blw_l1_model_t *const m = self->model;

    return (self->rows + blw_l1_size(m, g)) <= BLW_L1_ROWS(m->N, m->d, m->n_groups);
}

/* Put g into A with a first nu_g: 0+ for one row, a safe step along l_g for a pair. */
static void enter(blw_l1_t *self, size_t g)
{
    const blw_l1_model_t *const m    = self->model;
    const size_t                i    = m->first[g];
    const size_t                size = blw_l1_size(m, g);
    const blw_real_t            norm = blw_l1_norm(m, g, self->l);

    for (size_t j = i; j < (i + size); j++) {
        self->dir[j] = self->l[j] / norm;
        if (size == 2U) {
            /* curvature along l_g is at most the trace of Z_g Z_g', 2 by the scaling of Z */
            const blw_real_t        nu = BLW_R(0.5) * (norm - m->c[g]) * self->dir[j];
            size_t                  len;
            const blw_real_t *const row = blw_l1_row(m, j, &len);
            self->tau[j] -= nu;
            blw_la_axpy(len, -nu, row, self->z);
        }
    }
    blw_l1_support_add(self, g);
}

/* One Newton step on A as far as it descends, and the group that it takes out. */
static pass_t descend(blw_l1_t *self, const blw_real_t *zeta)
{
    const bool pairs = blw_l1_has_pairs(self->model);

    if (pairs) {
        for (size_t k = 0U; k < self->n_A; k++) {
            const size_t g = blw_l1_member(self, k);
            if (blw_l1_size(self->model, g) == 2U) {
                (void)blw_l1_aim(self, zeta, g);
            }
        }
        blw_l1_multipliers(self);
        blw_l1_support_factor(self, zeta);
    }
    blw_l1_support_newton(self);
    pass_t pass = first_crossing(self, zeta);
    if (pairs) {
        search(self, zeta, &pass);
    }
    blw_l1_support_move(self, pass.alpha);
    return pass;
}

/* (4) with z and l formed anew from tau, after one last correction.  What the next one would change
 * in x_hat becomes the error bound. */
static bool verify(blw_l1_t *self, const blw_real_t *zeta, blw_real_t widen, blw_real_t *bound)
{
    blw_l1_project(self->model, self->tau, self->z);
    blw_l1_multipliers(self);
    const pass_t pass = descend(self, zeta);
    blw_l1_multipliers(self);
    blw_l1_support_newton(self);
    *bound = blw_l1_support_effect(self);
    return (pass.blocked == self->n_A) && (blw_l1_support_residual(self) <= RESIDUAL_STALLED)
           && (blw_l1_worst(self, widen) == self->model->n_groups);
}

/* Whether the residual is below a limit, or stalled: no longer halved by a full pass on the same
 * A. */
static bool low(blw_real_t residual, blw_real_t before, blw_real_t limit)
{
    return (residual <= limit)
           || ((residual <= RESIDUAL_STALLED) && ((residual * BLW_R(2.0)) > before));
}

void blw_l1_active_set(blw_l1_t *self, const blw_real_t *zeta, blw_l1_info_t *info)
{
    const size_t none   = self->model->n_groups;
    blw_real_t   before = BLW_REAL_MAX; /* residual before the last pass, if that was a full one */
    blw_real_t   enough = RESIDUAL_ENTER; /* residual below which a group may enter */

    blw_l1_multipliers(self);
    while (!info->converged && (info->iterations < self->model->max_iterations)) {
        const blw_real_t residual = blw_l1_support_residual(self);
        const bool       late     = info->iterations > (self->model->max_iterations / 2U);
        const blw_real_t widen    = late ? BLW_L1_LOOSE : BLW_R(1.0);
        const size_t     worst    = blw_l1_worst(self, widen);
        const size_t     n_A      = self->n_A;
        info->iterations++;
        if ((worst == none) && low(residual, before, RESIDUAL_FINAL)) {
            info->converged = verify(self, zeta, widen, &info->bound);
            before          = BLW_REAL_MAX;
            continue;
        }
        if ((worst != none) && low(residual, before, enough) && has_room(self, worst)) {
            enter(self, worst);
        }
        const pass_t pass = descend(self, zeta);
        if (pass.blocked < self->n_A) {
            blw_l1_support_drop(self, zeta, pass.blocked);
        }
        /* a group that cannot move was let in too early: next time the rest has to settle first */
        enough = (pass.alpha > BLW_R(0.0)) ? RESIDUAL_ENTER : RESIDUAL_FINAL;
        blw_l1_multipliers(self);
        const bool dropped = blw_l1_has_pairs(self->model) && drop_pairs(self, zeta);
        const bool full    = !dropped && (n_A == self->n_A) && (pass.alpha >= BLW_R(1.0));
        before             = full ? residual : BLW_REAL_MAX;
    }
}

/* Take tau on A from the last solve: nu then absorbs what changed, and a group whose nu has turned
 * round or vanished is no candidate any more.  A solve that was cut short has left nothing worth
 * taking: then from nu = 0. */
static void start(blw_l1_t *self, const blw_real_t *zeta)
{
    const blw_l1_model_t *const m = self->model;
    size_t                      k = 0U;

    if (!self->solved) {
        blw_l1_support_clear(self, zeta);
        return;
    }
    for (size_t g = 0U; g < m->n_groups; g++) {
        for (size_t i = m->first[g]; (i < m->first[g + 1U]) && !blw_l1_in_support(self, g); i++) {
            self->tau[i] = zeta[i];
        }
    }
    while (k < self->n_A) {
        const size_t     g    = blw_l1_member(self, k);
        const size_t     i    = m->first[g];
        const blw_real_t nu   = zeta[i] - self->tau[i];
        const bool       pair = (blw_l1_size(m, g) == 2U);
        if ((pair && (blw_l1_aim(self, zeta, g) > BLW_R(0.0)))
            || (!pair && ((nu * self->dir[i]) > BLW_R(0.0)))) {
            k++;
        } else {
            blw_l1_support_drop(self, zeta, k);
        }
    }
    blw_l1_project(m, self->tau, self->z);
}

static void solve(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x, blw_l1_info_t *info)
{
    const blw_l1_model_t *const m = self->model;

    start(self, zeta);
    blw_l1_active_set(self, zeta, info);
    blw_la_gemv(m->n, m->N, m->F, self->tau, x);
}

static bool fits(const blw_l1_model_t *m)
{
    return m->Z != NULL;
}

const blw_l1_ops_t blw_l1_active_set_ops = {
    .fits     = fits,
    .lay_out  = blw_l1_lay_out_Z,
    .multiply = blw_l1_multiply_Z,
    .solve    = solve,
};
