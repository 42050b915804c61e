/* SPDX-License-Identifier: MIT */
/* Active-set engine for (2) in blw_l1.h where every group has one row.  A = rows with nu /= 0, f =
 * the others.  The tableau, N x N, symmetric, packed by rows,
 *     T = S swept on A = [ -S_AA^-1          S_AA^-1 S_Af              ]                     (1)
 *                        [  S_fA S_AA^-1     S_ff - S_fA S_AA^-1 S_Af  ]
 * holds all that a change of A needs, and one sweep, N (N + 1) / 2 multiply-adds, updates it.
 * Every solve starts from T = S, A empty: at most a few more sweeps than A has rows in the end, no
 * worse than from the last A under an attack, and rounding errors do not add up from step to step.
 * self->l holds l on f and nu on A meanwhile, so that one sum moves both.
 *     A row i with |l_i| > c_i enters: nu_i moves by t, and, l_A being held at c_A s_A,
 *     nu_A -= t T_Ai,   l_f -= t T_fi,   until |l_i| = c_i.                                  (2)
 * A nu_j that turns round on the way leaves next, by (2) with t = nu_j / T_jj.  That takes no more
 * sweeps than to stop where nu_j vanishes, and less work, but nothing says that it ends: after N
 * sweeps, or where T_ii = 0, (2) stops there and j leaves first; the objective then never rises.
 * The row that enters gains most: (|l_i| - c_i)^2 / T_ii.  The end is refined and verified in W and
 * G (blw_l1_refine.c), or solved there anew where T is too coarse. */
#include "blw/blw_l1_survey.h"
#include "blw_cold.h"
#include "blw_l1_internal.h"

/* Column k of T, whole. */
static void column(const blw_l1_t *self, size_t k, blw_real_t *col)
{
    if (self->model->fast != NULL) {
        self->model->fast->column(k, self->T, col);
        return;
    }
    const size_t N  = self->model->N;
    size_t       at = blw_la_packed_row(k + 1U) + k;

    blw_la_copy(k + 1U, &self->T[blw_la_packed_row(k)], col);
    for (size_t i = k + 1U; i < N; i++) {
        col[i] = self->T[at];
        at += i + 1U;
    }
}

/* Rows i to i + 2 of T minus their part of share col col', up to their diagonals. */
static void reduce_rows(blw_l1_t *self, size_t i, blw_real_t share, const blw_real_t *col)
{
    blw_real_t *const Ti = blw_l1_row_of_L(self, i);
    blw_real_t *const Tj = &Ti[i + 1U];
    blw_real_t *const Tk = &Tj[i + 2U];
    const blw_real_t  a  = col[i] * share;
    const blw_real_t  b  = col[i + 1U] * share;
    const blw_real_t  c  = col[i + 2U] * share;

    for (size_t j = 0U; j <= i; j++) {
        const blw_real_t x = col[j];
        Ti[j] -= a * x;
        Tj[j] -= b * x;
        Tk[j] -= c * x;
    }
    Tj[i + 1U] -= b * col[i + 1U];
    Tk[i + 1U] -= c * col[i + 1U];
    Tk[i + 2U] -= c * col[i + 2U];
}

/* T -= share col col'. */
static void reduce(blw_l1_t *self, blw_real_t share, const blw_real_t *col)
{
    const size_t N = self->model->N;
    size_t       i = 0U;

    for (; (i + 3U) <= N; i += 3U) {
        reduce_rows(self, i, share, col);
    }
    for (; i < N; i++) {
        blw_la_axpy(i + 1U, -(col[i] * share), col, blw_l1_row_of_L(self, i));
    }
}

/* What comes next.  tau and z hold the ranges of l on f and of nu on A meanwhile. */
static BLW_APART void survey(const blw_l1_t *self, blw_l1_survey_t *seen)
{
    const blw_real_t *T_jj = self->T;

    *seen = (blw_l1_survey_t){self->model->N, BLW_R(0.0), BLW_R(1.0)};
    for (size_t j = 0U; j < self->model->N; j++) {
        blw_l1_look(seen, j, self->l[j], self->tau[j], self->z[j], *T_jj);
        T_jj += j + 2U;
    }
}

/* T goes from S to self->L, where it can change. */
static void settle(blw_l1_t *self)
{
    if (self->T != self->L) {
        blw_la_copy(blw_la_packed_row(self->model->N), self->T, self->L);
        self->T = self->L;
    }
}

/* sweep() for any N. */
static BLW_APART void sweep_rows(blw_l1_t *self, size_t k, blw_real_t share, blw_real_t t)
{
    const size_t            N      = self->model->N;
    const blw_real_t        factor = blw_la_abs(share);
    const blw_real_t *const col    = self->step;

    settle(self);
    reduce(self, share, col);
    blw_real_t *Tk = blw_l1_row_of_L(self, k);
    for (size_t j = 0U; j < k; j++) {
        Tk[j] = factor * col[j];
    }
    Tk[k] = -share;
    for (size_t j = k + 1U; j < N; j++) {
        Tk += j;
        Tk[k] = factor * col[j];
    }
    blw_la_axpy(N, -t, col, self->l);
}

/* Sweep (1) on row k, into A or out of it, its column in self->step, and (2); *seen: what comes
 * next. */
static void sweep(blw_l1_t *self, size_t k, blw_real_t share, blw_real_t t, blw_l1_survey_t *seen)
{
    if (self->model->fast != NULL) {
        self->model->fast->sweep(self, k, share, t, seen);
        self->T = self->L;
    } else {
        sweep_rows(self, k, share, t);
        survey(self, seen);
    }
}

/* How far nu_i can move by (2), col = column i: *block = the row of A that leaves, or i.
 * @return the step, >= 0, or BLW_REAL_MAX if nothing ends it. */
static blw_real_t ratio_test(const blw_l1_t *self, size_t i, blw_real_t s, const blw_real_t *col,
                             size_t *block)
{
    const blw_l1_model_t *const m = self->model;
    blw_real_t                  t = BLW_REAL_MAX;

    *block = i;
    if (col[i] > BLW_L1_PIVOT_MIN) {
        t = blw_la_max((s * self->l[i]) - m->c[i], BLW_R(0.0)) / col[i];
    }
    for (size_t j = 0U; j < m->N; j++) {
        const blw_real_t loss = s * col[j] * self->dir[j]; /* of |nu_j|; 0 outside A */
        if ((loss > BLW_R(0.0)) && ((t * loss) > (self->l[j] * self->dir[j]))) {
            t      = blw_la_max(self->l[j] * self->dir[j], BLW_R(0.0)) / loss;
            *block = j;
        }
    }
    return t;
}

/* Row i enters A with sign s, or leaves it with s = 0. */
static void assign(blw_l1_t *self, size_t i, blw_real_t s)
{
    const blw_real_t c       = self->model->c[i];
    const blw_real_t most    = c + blw_l1_slack(c);
    const bool       clipped = blw_la_abs(s) > BLW_R(0.5);

    self->dir[i] = s;
    self->tau[i] = clipped ? ((s > BLW_R(0.0)) ? BLW_R(0.0) : -BLW_REAL_MAX) : -most;
    self->z[i]   = clipped ? ((s > BLW_R(0.0)) ? BLW_REAL_MAX : BLW_R(0.0)) : most;
}

/* Rows of A leave as their nu vanish, until row i can enter with sign s.  @return the sweeps made:
 * none if rounding leaves no way, at most `most`. */
static BLW_APART unsigned exchange(blw_l1_t *self, size_t i, blw_real_t s, unsigned most,
                                   blw_l1_survey_t *seen)
{
    blw_real_t nu     = BLW_R(0.0);
    unsigned   sweeps = 0U;
    size_t     block;

    do {
        column(self, i, self->step);
        const blw_real_t t = ratio_test(self, i, s, self->step, &block);
        if (t >= BLW_REAL_MAX) {
            return sweeps;
        }
        blw_la_axpy(self->model->N, -(s * t), self->step, self->l);
        nu += s * t;
        if (block != i) {
            self->l[block] = self->model->c[block] * self->dir[block];
            assign(self, block, BLW_R(0.0));
            column(self, block, self->step);
        } else {
            self->l[i] = nu;
            assign(self, i, s);
        }
        sweep(self, block, BLW_R(1.0) / self->step[block], BLW_R(0.0), seen);
        sweeps++;
    } while ((block != i) && (sweeps < most));
    return sweeps;
}

/* Row i enters, its column in self->step. */
static void enter(blw_l1_t *self, size_t i, blw_real_t s, blw_l1_survey_t *seen)
{
    const blw_real_t share = BLW_R(1.0) / self->step[i];
    const blw_real_t t     = (self->l[i] - (s * self->model->c[i])) * share;

    assign(self, i, s);
    sweep(self, i, share, t, seen);
    self->l[i] = t;
}

/* Row i, whose nu has turned round, leaves; its column in self->step. */
static void leave(blw_l1_t *self, size_t i, blw_l1_survey_t *seen)
{
    const blw_real_t share = BLW_R(1.0) / self->step[i];
    const blw_real_t t     = self->l[i] * share;
    const blw_real_t held  = self->model->c[i] * self->dir[i];

    assign(self, i, BLW_R(0.0));
    sweep(self, i, share, t, seen);
    self->l[i] = held - t;
}

/* Sweeps until no row violates |l_i| <= c_i, as far as T can tell. */
static BLW_APART void pivot(blw_l1_t *self, blw_l1_info_t *info)
{
    const blw_l1_model_t *const m = self->model;
    blw_l1_survey_t             seen;

    survey(self, &seen);
    while ((seen.best < m->N) && (info->iterations < m->max_iterations)) {
        const size_t     i      = seen.best;
        const blw_real_t s      = (self->l[i] > BLW_R(0.0)) ? BLW_R(1.0) : BLW_R(-1.0);
        unsigned         sweeps = 1U;
        column(self, i, self->step);
        if (blw_l1_clipped(self, i)) {
            leave(self, i, &seen);
        } else if ((self->step[i] > BLW_L1_PIVOT_MIN) && (info->iterations < m->N)) {
            enter(self, i, s, &seen);
        } else {
            sweeps    = exchange(self, i, s, (unsigned)m->max_iterations - info->iterations, &seen);
            seen.best = (sweeps > 0U) ? seen.best : m->N;
        }
        info->iterations = (uint16_t)(info->iterations + sweeps);
    }
}

/* T for the present A, from S; a row that depends on those before it leaves A. */
static BLW_APART void rebuild(blw_l1_t *self)
{
    const blw_l1_model_t *const m = self->model;
    blw_l1_survey_t             seen;

    self->T = m->S;
    for (size_t i = 0U; i < m->N; i++) {
        if (blw_l1_clipped(self, i)) {
            column(self, i, self->step);
            if (self->step[i] > BLW_L1_PIVOT_MIN) {
                sweep(self, i, BLW_R(1.0) / self->step[i], BLW_R(0.0), &seen);
            } else {
                self->l[i] = self->model->c[i] * self->dir[i];
                assign(self, i, BLW_R(0.0));
            }
        }
    }
}

/* nu = 0 on the rows of A that the verification found turned round; on the others l becomes nu.
 * @return whether there were any. */
static BLW_APART bool drop_turned(blw_l1_t *self, const blw_real_t *zeta)
{
    bool dropped = false;

    for (size_t j = 0U; j < self->model->N; j++) {
        const bool       clipped = blw_l1_clipped(self, j);
        const blw_real_t nu      = zeta[j] - self->tau[j];
        const bool       keep    = clipped && ((nu * self->dir[j]) > BLW_R(0.0));
        dropped                  = dropped || (clipped && !keep);
        self->l[j]               = keep ? nu : self->l[j];
        assign(self, j, keep ? self->dir[j] : BLW_R(0.0));
    }
    return dropped;
}

static void solve(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x, blw_l1_info_t *info)
{
    const blw_l1_model_t *const m       = self->model;
    bool                        dropped = false;
    bool                        intact  = true; /* T is that of the present A */

    self->T = m->S;
    for (size_t i = 0U; i < m->N; i++) {
        assign(self, i, BLW_R(0.0));
    }
    do {
        if (dropped) {
            intact          = false;
            info->converged = blw_l1_kkt(self, zeta, x, &info->bound);
        } else {
            if (!intact) {
                rebuild(self);
            }
            pivot(self, info);
            info->converged = blw_l1_refine(self, zeta, x, &info->bound, &intact);
        }
        if (!info->converged && (info->iterations < m->max_iterations)) {
            info->iterations++;
            dropped = drop_turned(self, zeta);
        }
    } while (!info->converged && (info->iterations < m->max_iterations));
}

static void multiply(blw_l1_t *self, const blw_real_t *zeta)
{
    blw_l1_symv(self->model, self->model->S, zeta, self->l);
}

/* z lies in what else only the factors of blw_l1_kkt.c need, which end it. */
static BLW_COLD void lay_out(blw_l1_t *self, blw_real_t *mem)
{
    const blw_l1_model_t *const m = self->model;

    self->step = blw_la_take(&mem, (size_t)m->N + m->n);
    self->L    = blw_la_take(&mem, blw_la_packed_row(m->N));
    self->z    = mem;
}

static bool fits(const blw_l1_model_t *m)
{
    return !blw_l1_has_pairs(m) && (m->Z == NULL) && (m->S != NULL) && (m->W != NULL)
           && (m->G != NULL) && (m->P != NULL);
}

const blw_l1_ops_t blw_l1_tableau_ops = {
    .fits     = fits,
    .lay_out  = lay_out,
    .multiply = multiply,
    .solve    = solve,
};
