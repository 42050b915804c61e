/* SPDX-License-Identifier: MIT */
/* Active-set engine for (2) in blw_l1.h where every group has one row.  A = rows with nu /= 0, f = the
 * others.  The tableau, N x N, symmetric, packed by rows,
 *     T = S swept on A = [ -S_AA^-1          S_AA^-1 S_Af              ]                     (1)
 *                        [  S_fA S_AA^-1     S_ff - S_fA S_AA^-1 S_Af  ]
 * holds all that a change of A needs, and one sweep, N (N + 1) / 2 multiply-adds, updates it.  Every
 * solve starts from T = S, A empty: at most a few more sweeps than A has rows in the end, no worse than
 * from the last A under an attack, and rounding errors do not add up from step to step.
 * self->l holds l on f and nu on A meanwhile, so that one sum moves both.
 *     A row i with |l_i| > c_i enters: nu_i moves by t, and, l_A being held at c_A s_A,
 *     nu_A -= t T_Ai,   l_f -= t T_fi,   until |l_i| = c_i or a nu_j vanishes, which then leaves.   (2)
 * The objective never rises.  The row that enters gains most: (|l_i| - c_i)^2 / T_ii.  The end is
 * verified by the solve of blw_l1_kkt.c, which shares no number with T. */
#include "blw_l1_internal.h"

/* Least T_ii for a step that ends at |l_i| = c_i: the diagonal of S is about 1.  Below it row i depends
 * on A, and a row of A has to leave first. */
#define PIVOT_MIN (BLW_R(64.0) * BLW_REAL_EPS)

/* Most corrections by T.  Each leaves of the error what T is wrong by, so the first that is SMALL, in
 * standard deviations of x, is the last. */
#define REFINEMENTS 3U
#define SMALL       BLW_R(1e-3)

/* What rounding leaves of nu_i = zeta_i - tau_i, relative to what it is made of. */
#define NU_SLACK (BLW_R(16.0) * BLW_REAL_EPS)

static blw_real_t *row_of_T(const blw_l1_t *self, size_t i)
{
    return &self->L[blw_la_packed_row(i)];
}

/* Column k of T, whole. */
static void column(const blw_l1_t *self, size_t k, blw_real_t *col)
{
    const size_t            N  = self->model->N;
    const blw_real_t *const Tk = row_of_T(self, k);
    size_t                  at = blw_la_packed_row(k + 1U) + k;

    blw_la_copy(k + 1U, Tk, col);
    for (size_t i = k + 1U; i < N; i++) {
        col[i] = self->L[at];
        at += i + 1U;
    }
}

/* Rows i to i + 2 of T minus their share of col col' / d, up to their diagonals. */
static void reduce_rows(blw_l1_t *self, size_t i, blw_real_t inverse, const blw_real_t *col)
{
    blw_real_t *const Ti = row_of_T(self, i);
    blw_real_t *const Tj = &Ti[i + 1U];
    blw_real_t *const Tk = &Tj[i + 2U];
    const blw_real_t  a  = col[i] * inverse;
    const blw_real_t  b  = col[i + 1U] * inverse;
    const blw_real_t  c  = col[i + 2U] * inverse;

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

/* Sweep (1) on row k, into A or out of it; col = column k. */
static void sweep(blw_l1_t *self, size_t k, const blw_real_t *col)
{
    const size_t     N       = self->model->N;
    const blw_real_t d       = col[k];
    const blw_real_t inverse = BLW_R(1.0) / d;
    const blw_real_t factor  = blw_la_abs(inverse);
    size_t           i       = 0U;

    for (; (i + 3U) <= N; i += 3U) {
        reduce_rows(self, i, inverse, col);
    }
    for (; i < N; i++) {
        blw_la_axpy(i + 1U, -(col[i] * inverse), col, row_of_T(self, i));
    }
    blw_real_t *Tk = row_of_T(self, k);
    for (size_t j = 0U; j < k; j++) {
        Tk[j] = factor * col[j];
    }
    Tk[k] = -inverse;
    for (size_t j = k + 1U; j < N; j++) {
        Tk += j;
        Tk[k] = factor * col[j];
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
    if (col[i] > PIVOT_MIN) {
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

/* Let row i enter with (2), in `most` sweeps.  @return the sweeps made, 0 if rounding leaves no way. */
static unsigned enter(blw_l1_t *self, size_t i, unsigned most)
{
    const size_t     N      = self->model->N;
    const blw_real_t s      = (self->l[i] > BLW_R(0.0)) ? BLW_R(1.0) : BLW_R(-1.0);
    blw_real_t       nu     = BLW_R(0.0);
    unsigned         sweeps = 0U;
    size_t           block;

    do {
        column(self, i, self->step);
        const blw_real_t t = ratio_test(self, i, s, self->step, &block);
        if (t >= BLW_REAL_MAX) {
            return sweeps;
        }
        blw_la_axpy(N, -(s * t), self->step, self->l);
        nu += s * t;
        if (block != i) {
            self->l[block]   = self->model->c[block] * self->dir[block];
            self->dir[block] = BLW_R(0.0);
            column(self, block, self->step);
        } else {
            self->l[i]   = nu;
            self->dir[i] = s;
        }
        sweep(self, block, self->step);
        sweeps++;
    } while ((block != i) && (sweeps < most));
    return sweeps;
}

/* The row outside A whose entry gains most, or N. */
static size_t best_entry(const blw_l1_t *self)
{
    const size_t            N     = self->model->N;
    const blw_real_t *const c     = self->model->c;
    const blw_real_t       *T_ii  = self->L;
    size_t                  found = N;
    blw_real_t              best  = BLW_R(0.0);

    for (size_t i = 0U; i < N; i++) {
        const blw_real_t excess = blw_la_abs(self->l[i]) - c[i];
        if ((excess > blw_l1_slack(c[i])) && !blw_l1_clipped(self, i)) {
            const blw_real_t gain = (excess * excess) / blw_la_max(*T_ii, PIVOT_MIN);
            if (gain > best) {
                best  = gain;
                found = i;
            }
        }
        T_ii += i + 2U;
    }
    return found;
}

/* T for the present A, from S; a row that depends on those before it leaves A. */
static void rebuild(blw_l1_t *self)
{
    const blw_l1_model_t *const m = self->model;

    blw_la_copy(blw_la_packed_row(m->N), m->S, self->L);
    for (size_t i = 0U; i < m->N; i++) {
        if (blw_l1_clipped(self, i)) {
            column(self, i, self->step);
            if (self->step[i] > PIVOT_MIN) {
                sweep(self, i, self->step);
            } else {
                self->l[i]   = self->model->c[i] * self->dir[i];
                self->dir[i] = BLW_R(0.0);
            }
        }
    }
}

bool blw_l1_holds(const blw_l1_t *self, const blw_real_t *zeta)
{
    const blw_l1_model_t *const m = self->model;

    for (size_t i = 0U; i < m->N; i++) {
        if (blw_l1_clipped(self, i)) {
            const blw_real_t own   = m->W[blw_la_packed_row(i) + i] * self->l[i];
            const blw_real_t slack = blw_la_abs(zeta[i]) + blw_la_abs(own);
            if (!(((zeta[i] - self->tau[i]) * self->dir[i]) >= -(NU_SLACK * slack))) {
                return false;
            }
        } else if (!(blw_la_abs(self->l[i]) <= (m->c[i] + blw_l1_slack(m->c[i])))) {
            return false;
        }
    }
    return true;
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
    blw_la_gemv(m->n, m->N, m->F, self->tau, x);
}

/* One step of refinement with the inverse that T is a part of.  With e = zeta - tau outside A,
 * h = -G' l, w = F' h and P = F W F',
 *     [ dl_f  ]     [  e_f ]   [ w_f ]
 *     [ dnu_A ] = T [ -w_A ] + [ 0   ],     dx = F_f e_f - F_A dnu_A - P h.                     (3)
 * *bound = |dx|.  @return whether dx is a small part of the standard deviations of x. */
static bool correct(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x, blw_real_t *bound)
{
    const blw_l1_model_t *const m      = self->model;
    blw_real_t *const           h      = &self->step[m->N];
    blw_real_t *const           change = row_of_T(self, m->N); /* free: T is all of L but this */
    blw_real_t                  sum    = BLW_R(0.0);
    bool                        small  = true;

    blw_l1_imbalance(self, h);
    blw_la_fill(m->N, BLW_R(0.0), self->step);
    for (size_t j = 0U; j < m->n; j++) {
        blw_la_axpy(m->N, h[j], &m->F[j * m->N], self->step);
    }
    for (size_t i = 0U; i < m->N; i++) {
        const bool clipped = blw_l1_clipped(self, i);
        self->l[i] += clipped ? BLW_R(0.0) : self->step[i];
        self->step[i] = clipped ? -self->step[i] : (zeta[i] - self->tau[i]);
    }
    blw_la_symv(m->N, self->L, self->step, change);
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
    for (size_t j = 0U; j < m->n; j++) {
        const blw_real_t dx   = blw_la_dot(m->N, &m->F[j * m->N], self->step) - change[j];
        const blw_real_t P_jj = m->P[blw_la_packed_row(j) + j];
        x[j] += dx;
        sum += dx * dx;
        small = small && ((dx * dx) <= (SMALL * SMALL * P_jj));
    }
    *bound = blw_la_sqrt(sum);
    return small;
}

/* Refine l, nu and x with residuals formed in W, and verify the minimum; by factors of W where T is
 * too coarse for that. */
static bool refine(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x, blw_real_t *bound)
{
    const blw_l1_model_t *const m       = self->model;
    bool                        settled = false;

    split(self, zeta, x);
    for (size_t round = 0U; (round < REFINEMENTS) && !settled; round++) {
        blw_la_symv(m->N, m->W, self->l, self->tau);
        blw_la_gemv_add(m->N, m->n, m->G, x, self->tau);
        settled = correct(self, zeta, x, bound);
    }
    return settled ? blw_l1_holds(self, zeta) : blw_l1_kkt(self, zeta, x, bound);
}

/* nu = 0 on the rows of A that the verification found turned round; on the others l becomes nu.
 * @return whether there were any. */
static bool drop_turned(blw_l1_t *self, const blw_real_t *zeta)
{
    bool dropped = false;

    for (size_t j = 0U; j < self->model->N; j++) {
        if (blw_l1_clipped(self, j)) {
            const blw_real_t nu = zeta[j] - self->tau[j];
            if ((nu * self->dir[j]) > BLW_R(0.0)) {
                self->l[j] = nu;
            } else {
                self->dir[j] = BLW_R(0.0);
                self->tau[j] = zeta[j];
                dropped      = true;
            }
        }
    }
    return dropped;
}

/* Sweeps until no row violates |l_i| <= c_i, as far as T can tell. */
static void pivot(blw_l1_t *self, blw_l1_info_t *info)
{
    const blw_l1_model_t *const m = self->model;
    size_t                      i = best_entry(self);

    while ((i < m->N) && (info->iterations < m->max_iterations)) {
        const unsigned sweeps = enter(self, i, (unsigned)m->max_iterations - info->iterations);
        info->iterations      = (uint16_t)(info->iterations + sweeps);
        i                     = (sweeps > 0U) ? best_entry(self) : m->N;
    }
}

static void solve(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x, blw_l1_info_t *info)
{
    const blw_l1_model_t *const m       = self->model;
    bool                        dropped = false;

    blw_la_fill(m->N, BLW_R(0.0), self->dir);
    do {
        if (dropped) {
            info->converged = blw_l1_kkt(self, zeta, x, &info->bound);
        } else {
            rebuild(self);
            pivot(self, info);
            info->converged = refine(self, zeta, x, &info->bound);
        }
        if (!info->converged && (info->iterations < m->max_iterations)) {
            info->iterations++;
            dropped = drop_turned(self, zeta);
        }
    } while (!info->converged && (info->iterations < m->max_iterations));
    if (!info->converged) {
        blw_la_symv(m->N, m->S, self->tau, self->l);
        blw_la_gemv(m->n, m->N, m->F, self->tau, x);
    }
}

static void multiply(blw_l1_t *self, const blw_real_t *zeta)
{
    blw_la_symv(self->model->N, self->model->S, zeta, self->l);
}

static bool fits(const blw_l1_model_t *m)
{
    return !blw_l1_has_pairs(m) && (m->Z == NULL) && (m->S != NULL) && (m->W != NULL)
           && (m->G != NULL) && (m->P != NULL);
}

const blw_l1_ops_t blw_l1_tableau_ops = {
    .fits     = fits,
    .multiply = multiply,
    .solve    = solve,
};
