/* SPDX-License-Identifier: MIT */
/* The steps of blw_l1_newton.c with kappa = 0, from sides that are nearly right.  l stays within
 * its bounds inside and on them outside, so that with nu = zeta - W l - G x there is left to reach
 *     nu_g = 0 inside,   nu_g = |nu_g| dir_g outside, dir_g = l_g / c_g,   G' l = 0,            (1)
 * the minimum of the dual of (2) in blw_l1.h, 1/2 l' W l - zeta' l.  Every step takes one product
 * with W, for nu, and a solve with the system of blw_l1_newton_step.c, whose factor serves as long
 * as the steps become shorter fast enough:
 *   - Where l_g would leave its bound, the step pauses, g goes outside, and the rest of the step is
 *     made with the change of l_g along a_g = dir_g held at 0: y of the system K becomes
 *         y - v_g (a_g' y) / (a_g' v_g),   v_g = K^-1 a_g,                                     (2)
 *     where K^-1 holds what was held before; so do the later steps.
 *   - Where nu_g has come to point against dir_g, g goes inside, and the system is factored anew.
 * Once a step changes no sides and x but little, the next nu decides whether (1) is reached. */
#include "blw_cold.h"
#include "blw_l1_newton.h"

#define STEPS 12U

/* Most groups that may change sides in one step. */
#define WRONG 12U

/* |l_g| / c_g that rounding may leave inside. */
#define SLACK (BLW_R(1.0) + (BLW_R(64.0) * BLW_REAL_EPS))

/* A new factor takes as long as some steps.  It is asked for unless the steps become shorter by
 * this ratio, and so fast that of so many more the last is small enough. */
#define SHRINK BLW_R(0.7)
#define AHEAD  3U

/* Last change of x in standard deviations: the most; the most that may be left if the steps go on
 * becoming shorter as the last one has; what is enough in any case. */
#ifdef BLW_REAL_DOUBLE
#define SMALL BLW_R(1e-10)
#define REST  BLW_R(1e-12)
#define TINY  BLW_R(1e-12)
#else
#define SMALL BLW_R(5e-5)
#define REST  BLW_R(1e-5)
#define TINY  BLW_R(1e-5)
#endif

/* What rounding of zeta leaves open, in units of its last place, and the most that passes for it. */
#define ROUNDING BLW_R(0.25)
#define OPEN     BLW_R(1e-3)

/* What stands behind the numbers of v in (2): the column of a_g, its two numbers and a_g' v. */
#define COLUMN 0U
#define FIRST  1U
#define SECOND 2U
#define SPREAD 3U
#define BEHIND 4U

typedef struct finish {
    blw_l1_newton_t *at;
    size_t           held;  /* groups that went outside since the system was factored */
    bool             stale; /* it is to be factored again */
} finish_t;

static size_t order(const finish_t *f)
{
    return f->at->free + f->at->l1->model->n;
}

/* The k-th v of (2), behind the factor; NULL if there is no room. */
static blw_real_t *vector(const finish_t *f, size_t k)
{
    const blw_l1_model_t *const m    = f->at->l1->model;
    const size_t                each = order(f) + BEHIND;
    const size_t                from = blw_la_packed_row(order(f)) + (k * each);
    const size_t                room = blw_la_packed_row((size_t)m->N + m->n);

    return ((from + each) <= room) ? &f->at->l1->L[from] : NULL;
}

/* a_g' y for what stands behind v. */
static blw_real_t along(const blw_real_t *behind, const blw_real_t *y)
{
    const size_t q = (size_t)(int32_t)behind[COLUMN];

    return (behind[FIRST] * y[q]) + (behind[SECOND] * y[q + 1U]);
}

/* y becomes K^-1 y with all that is held at 0. */
static void solve(const finish_t *f, blw_real_t *y)
{
    blw_l1_solve_LJL(f->at->l1, f->at->free, order(f), y);
    for (size_t k = 0U; k < f->held; k++) {
        const blw_real_t *const v      = vector(f, k);
        const blw_real_t *const behind = &v[order(f)];
        blw_la_axpy(order(f), -along(behind, y) / behind[SPREAD], v, y);
    }
}

/* Share of the step in self->z at which l_g reaches its bound, 1 if it does not. */
static blw_real_t reach(const blw_l1_t *self, size_t g)
{
    const size_t            rows = blw_l1_size(self->model, g);
    const blw_real_t *const l    = &self->l[self->model->first[g]];
    const blw_real_t *const d    = &self->z[self->model->first[g]];
    const blw_real_t        c    = self->model->c[g];
    const blw_real_t        ll   = blw_l1_dot(rows, l, l);
    const blw_real_t        ld   = blw_l1_dot(rows, l, d);
    const blw_real_t        dd   = blw_l1_dot(rows, d, d);

    if ((ll + ld + ld + dd) <= (SLACK * SLACK * c * c)) {
        return BLW_R(1.0);
    }
    const blw_real_t room = blw_la_max((c * c) - ll, BLW_R(0.0));
    return (blw_la_sqrt((ld * ld) + (dd * room)) - ld) / dd;
}

/* Share of the step that no group inside forbids, and the group that forbids more, or n_groups. */
static BLW_APART size_t first_to_reach(const blw_l1_t *self, blw_real_t *share)
{
    const blw_l1_model_t *const m     = self->model;
    size_t                      found = m->n_groups;

    *share = BLW_R(1.0);
    for (size_t g = 0U; g < m->n_groups; g++) {
        if (!blw_l1_outside(self, g, m->first[g])) {
            const blw_real_t at_g = reach(self, g);
            if (at_g < *share) {
                *share = at_g;
                found  = g;
            }
        }
    }
    return found;
}

/* Group g goes outside, and the rest of the step y does without it, (2).
 * @return false if there is no room or, within rounding, no such step. */
static BLW_APART bool hold(finish_t *f, size_t g, blw_real_t *y)
{
    blw_l1_t *const   self = f->at->l1;
    const size_t      i    = self->model->first[g];
    const size_t      rows = blw_l1_size(self->model, g);
    const size_t      q    = blw_l1_newton_column(f->at, i);
    const blw_real_t  norm = blw_l1_norm(self->model, g, self->l);
    blw_real_t *const v    = vector(f, f->held);

    for (size_t j = i; j < (i + rows); j++) {
        self->dir[j] = self->l[j] / norm;
    }
    if (v == NULL) {
        return false;
    }
    blw_real_t *const behind = &v[order(f)];
    blw_la_zero(order(f), v);
    blw_la_copy(rows, &self->dir[i], &v[q]);
    behind[COLUMN] = (blw_real_t)q;
    behind[FIRST]  = self->dir[i];
    behind[SECOND] = (rows == 2U) ? self->dir[i + 1U] : BLW_R(0.0);
    solve(f, v);
    behind[SPREAD] = along(behind, v);
    if (!(behind[SPREAD] > BLW_R(0.0))) {
        return false;
    }
    f->held++;
    blw_la_axpy(order(f), -along(behind, y) / behind[SPREAD], v, y);
    return true;
}

/* l and x move by the step y, from bound to bound.  @return the groups that went outside. */
static size_t advance(finish_t *f, blw_real_t *y)
{
    blw_l1_newton_t *const at    = f->at;
    blw_l1_t *const        self  = at->l1;
    const size_t           N     = self->model->N;
    size_t                 count = 0U;
    size_t                 g;

    do {
        blw_real_t share;
        blw_la_zero(N, self->z);
        blw_l1_newton_spread(self, at->free, y, self->z);
        g = first_to_reach(self, &share);
        blw_la_axpy(N, share, self->z, self->l);
        blw_la_axpy(self->model->n, share, &y[at->free], at->x);
        if (g < self->model->n_groups) {
            count++;
            blw_la_axpy(order(f), -share, y, y);
            f->stale = !hold(f, g, y);
        }
    } while ((g < self->model->n_groups) && !f->stale);
    return count;
}

/* l within its bounds inside, on them outside; dir follows it. */
static BLW_APART void confine(const blw_l1_t *self)
{
    const blw_l1_model_t *const m = self->model;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const size_t     i       = m->first[g];
        const size_t     rows    = blw_l1_size(m, g);
        const blw_real_t c       = m->c[g];
        const bool       outside = blw_l1_outside(self, g, i);
        const blw_real_t squares = blw_l1_dot(rows, &self->l[i], &self->l[i]);
        if (outside || (squares > (c * c))) {
            const blw_real_t norm = blw_la_sqrt(squares);
            for (size_t j = i; j < (i + rows); j++) {
                const blw_real_t dir = self->l[j] / norm; /* one row: 1 or -1 exactly */
                self->l[j]           = c * dir;
                self->dir[j]         = outside ? dir : self->dir[j];
            }
        }
    }
}

/* Groups whose nu points against l by more than slack widths go inside: less is rounding, which
 * would move a group on the verge to and fro for ever.  @return their number. */
static BLW_APART size_t take_back(const blw_l1_newton_t *at, blw_real_t slack)
{
    const blw_l1_t *const       self  = at->l1;
    const blw_l1_model_t *const m     = self->model;
    size_t                      moved = 0U;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const size_t i  = m->first[g];
        blw_real_t   nu = (at->zeta[i] - self->tau[i]) * self->dir[i]; /* along dir */
        if (blw_l1_size(m, g) == 2U) {
            nu += (at->zeta[i + 1U] - self->tau[i + 1U]) * self->dir[i + 1U];
        }
        if (!(nu >= (-slack * self->A[g]))) {
            blw_la_zero(blw_l1_size(m, g), &self->dir[i]);
            moved++;
        }
    }
    return moved;
}

/* What is left of (1) to self->z: nu inside, its part across dir outside. */
static BLW_APART void leftover(const blw_l1_newton_t *at)
{
    blw_l1_t *const             self = at->l1;
    const blw_l1_model_t *const m    = self->model;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const size_t     i    = m->first[g];
        const size_t     last = m->first[g + 1U] - 1U; /* i if there is one row */
        const blw_real_t v    = at->zeta[i] - self->tau[i];
        const blw_real_t w    = at->zeta[last] - self->tau[last];
        const blw_real_t both = (last == i) ? BLW_R(0.0) : (w * self->dir[last]);
        const blw_real_t nu   = (v * self->dir[i]) + both; /* along dir */
        self->z[i]            = v - (nu * self->dir[i]);
        self->z[last]         = w - (nu * self->dir[last]);
    }
}

/* Largest |dx_j| in standard deviations. */
static BLW_APART blw_real_t change(const blw_l1_newton_t *at, const blw_real_t *dx)
{
    const blw_l1_model_t *const m    = at->l1->model;
    blw_real_t                  most = BLW_R(0.0); /* squared */

    for (size_t j = 0U; j < m->n; j++) {
        most = blw_la_max(most, (dx[j] * dx[j]) / m->P[blw_la_packed_row(j) + j]);
    }
    return blw_la_sqrt(most);
}

/* One step from the present nu, of which `wrong` groups were taken back.
 * @return the groups that changed sides. */
static size_t step(finish_t *f, size_t wrong)
{
    blw_l1_newton_t *const at   = f->at;
    blw_l1_t *const        self = at->l1;

    if (f->stale || (wrong != 0U)) {
        blw_l1_newton_factor(at);
        f->held = 0U;
    }
    leftover(at);
    blw_l1_newton_gather(self, at->free, self->z, 1U, self->step);
    blw_l1_imbalance(self->model, self->l, &self->step[at->free]);
    solve(f, self->step);
    f->stale           = false;
    const size_t moved = wrong + advance(f, self->step);
    confine(self);
    return moved;
}

/* l for the present sides. */
static void begin(blw_l1_t *self)
{
    const blw_l1_model_t *const m = self->model;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const size_t i = m->first[g];
        if (blw_l1_outside(self, g, i)) {
            blw_la_copy(blw_l1_size(m, g), &self->dir[i], &self->l[i]);
        }
    }
    confine(self);
}

/* tau with nu_g = 0 inside and along dir_g outside: within what rounding leaves, (1). */
static void close_nu(const blw_l1_newton_t *at)
{
    blw_l1_t *const self = at->l1;

    leftover(at);
    blw_la_axpy(self->model->N, BLW_R(1.0), self->z, self->tau);
}

/* What the rounding of a large zeta, or of a large x itself, leaves open of x, in standard
 * deviations, about. */
static BLW_APART blw_real_t rounding(const blw_l1_newton_t *at)
{
    const blw_l1_t *const       self = at->l1;
    const blw_l1_model_t *const m    = self->model;
    blw_real_t                  most = BLW_R(0.0);

    for (size_t g = 0U; g < m->n_groups; g++) {
        most = blw_la_max(most, blw_l1_norm(m, g, at->zeta) / self->A[g]);
    }
    const blw_real_t open = BLW_REAL_EPS * blw_la_max(ROUNDING * most, change(at, at->x));
    return (open < OPEN) ? open : OPEN;
}

/* Whether a step that changes x by `by`, after one by `before`, need not be followed by another. */
static bool enough(blw_real_t by, blw_real_t before, blw_real_t open)
{
    return (by <= blw_la_max(TINY, open))
           || ((by <= blw_la_max(SMALL, open)) && ((by * by) <= (before * blw_la_max(REST, open))));
}

/* Whether steps with the present factor are likely to come to an end soon. */
static bool soon(blw_real_t by, blw_real_t before)
{
    if (!(before > BLW_R(0.0))) {
        return false;
    }
    const blw_real_t ratio = by / before;
    blw_real_t       next  = by;

    for (size_t k = 0U; k < AHEAD; k++) {
        next *= ratio;
    }
    return (ratio <= SHRINK) && (next <= REST);
}

/* Steps until nothing is left to do.  @return whether that is so. */
static bool settle(finish_t *f, blw_l1_info_t *info)
{
    blw_l1_newton_t *const at      = f->at;
    blw_l1_t *const        self    = at->l1;
    const blw_real_t       open    = rounding(at);
    const blw_real_t       tiny    = blw_la_max(TINY, open);
    blw_real_t             before  = BLW_REAL_MAX; /* change by the last step */
    bool                   settled = false;
    size_t                 wrong   = 0U;

    for (size_t k = 0U; (k < STEPS) && (wrong <= WRONG); k++) {
        blw_l1_predict(self->model, self->l, at->x, self->tau);
        wrong = (k == 0U) ? 0U : take_back(at, tiny);
        if (settled && (wrong == 0U)) {
            return true;
        }
        if (info->iterations >= self->model->max_iterations) {
            return false;
        }
        wrong               = step(f, wrong);
        const blw_real_t by = change(at, &self->step[at->free]);
        info->iterations++;
        info->bound = blw_la_norm(self->model->n, &self->step[at->free]);
        f->stale    = f->stale || !soon(by, before);
        settled     = (wrong == 0U) && !at->weak && enough(by, before, open);
        before      = by;
    }
    return false;
}

bool blw_l1_newton_finish(blw_l1_newton_t *at, blw_l1_info_t *info)
{
    const blw_real_t kappa = at->kappa;
    finish_t         f     = {.at = at, .stale = true};

    at->kappa = BLW_R(0.0);
    begin(at->l1);
    const bool done = settle(&f, info);
    at->kappa       = kappa;
    if (done) {
        close_nu(at);
    }
    return done;
}
