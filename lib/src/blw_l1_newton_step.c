/* SPDX-License-Identifier: MIT */
/* The linear system of blw_l1_newton.c.  Unknown are l on the groups inside, one number t per pair
 * outside, which turns it, l_g = c_g dir_g + t p_g, p_g = dir_g turned by 90 degrees, and x:
 *     [ E' W E + D   E' G ] [ l_E ]   [ E' (zeta - W l_0) ]
 *     [ G' E         -R   ] [ x   ] = [ -G' l_0           ],                                   (1)
 * l = l_0 + E l_E, tau = W l + G x.  D = kappa width_g / c_g inside, |nu_g| / c_g for a pair
 * outside; l_0 = c dir outside.  The system is solved for the change from the present point, so
 * that rounding errors do not stay.  R, a small part of the information on x, holds x where E' G
 * leaves it open; it only damps the change.  The matrix is factored by blw_l1_factor.c. */
#include "blw_cold.h"
#include "blw_l1_newton.h"

/* R relative to the information of the Kalman estimate. */
#define DAMPING BLW_R(1e-5)

/* Least square of a pivot, relative to the diagonal: below it W is singular as far as its rounded
 * numbers can tell. */
#define PIVOT2_MIN (BLW_R(16.0) * BLW_REAL_EPS)

/* The columns of E to self->dz: row i of the problem, or, below 0, the pair of rows i and i + 1
 * turned by 90 degrees as -1 - i.  Small integers, exact in blw_real_t.  @return their number. */
static size_t list_columns(blw_l1_t *self)
{
    const blw_l1_model_t *const m = self->model;
    size_t                      q = 0U;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const size_t i    = m->first[g];
        const bool   pair = (blw_l1_size(m, g) == 2U);
        if (!blw_l1_outside(self, g, i)) {
            for (size_t row = i; row < m->first[g + 1U]; row++) {
                self->dz[q] = (blw_real_t)row;
                q++;
            }
        } else if (pair) {
            self->dz[q] = BLW_R(-1.0) - (blw_real_t)i;
            q++;
        } else {
            /* one row outside: l_g is known */
        }
    }
    return q;
}

/* Whether column q is a turned pair; its first row, or the row, in *i. */
static bool turned(const blw_l1_t *self, size_t q, size_t *i)
{
    const int32_t at = (int32_t)self->dz[q];

    *i = (size_t)((at < 0) ? (-1 - at) : at);
    return at < 0;
}

void blw_l1_newton_gather(const blw_l1_t *self, size_t count, const blw_real_t *v, size_t stride,
                          blw_real_t *out)
{
    for (size_t q = 0U; q < count; q++) {
        size_t                  i;
        const bool              turn = turned(self, q, &i);
        const blw_real_t *const v_i  = &v[i * stride];
        out[q] = turn ? ((self->dir[i] * v_i[stride]) - (self->dir[i + 1U] * v_i[0])) : v_i[0];
    }
}

/* blw_l1_newton_gather() of the turned sum of the rows of W that belong to the pair at row i. */
static void gather_turned(const blw_l1_t *self, size_t count, size_t i, blw_real_t *out)
{
    const blw_real_t *const A = &self->model->W[blw_la_packed_row(i)];
    const blw_real_t *const B = &A[i + 1U];
    const blw_real_t        a = self->dir[i + 1U];
    const blw_real_t        b = self->dir[i];

    for (size_t q = 0U; q < count; q++) {
        size_t           j;
        const bool       turn = turned(self, q, &j);
        const blw_real_t v    = (b * B[j]) - (a * A[j]);
        out[q] =
            turn ? ((self->dir[j] * ((b * B[j + 1U]) - (a * A[j + 1U]))) - (self->dir[j + 1U] * v))
                 : v;
    }
}

void blw_l1_newton_spread(const blw_l1_t *self, size_t count, const blw_real_t *y, blw_real_t *v)
{
    for (size_t q = 0U; q < count; q++) {
        size_t i;
        if (turned(self, q, &i)) {
            v[i] -= self->dir[i + 1U] * y[q];
            v[i + 1U] += self->dir[i] * y[q];
        } else {
            v[i] += y[q];
        }
    }
}

/* Share of l_g in nu_g: D inside, 0 outside. */
static blw_real_t share(const blw_l1_newton_t *at, size_t g)
{
    const blw_l1_t *const self = at->l1;

    return blw_l1_outside(self, g, self->model->first[g])
               ? BLW_R(0.0)
               : ((at->kappa * self->A[g]) / self->model->c[g]);
}

/* Column q of E, the pair at row i turned: row q of the matrix. */
static void add_turned_row(const blw_l1_newton_t *at, size_t g, size_t i, size_t q)
{
    const blw_l1_t *const   self = at->l1;
    const blw_real_t *const W_i  = &self->model->W[blw_la_packed_row(i)];
    const blw_real_t *const W_j  = &W_i[i + 1U];
    const blw_real_t        a    = self->dir[i + 1U];
    const blw_real_t        b    = self->dir[i];
    blw_real_t *const       row  = blw_l1_row_of_L(self, q);
    blw_real_t              nu[2];

    gather_turned(self, q, i, row);
    row[q] = (b * ((b * W_j[i + 1U]) - (a * W_j[i]))) - (a * ((b * W_j[i]) - (a * W_i[i])));
    row[q] += blw_l1_nu(at, g, nu) / self->model->c[g];
}

/* Rows of the matrix for the columns of E of group g, from row r on.  @return their number. */
static size_t add_rows(const blw_l1_newton_t *at, size_t g, size_t r)
{
    const blw_l1_t *const       self = at->l1;
    const blw_l1_model_t *const m    = self->model;
    const size_t                i    = m->first[g];
    const size_t                size = blw_l1_size(m, g);

    if (blw_l1_outside(self, g, i)) {
        if (size == 2U) {
            add_turned_row(at, g, i, r);
        }
        return size - 1U;
    }
    for (size_t k = 0U; k < size; k++) {
        blw_real_t *const row = blw_l1_row_of_L(self, r + k);
        blw_l1_newton_gather(self, r + k + 1U, &m->W[blw_la_packed_row(i + k)], 1U, row);
        row[r + k] += share(at, g);
    }
    return size;
}

/* The matrix of (1). */
static BLW_APART void build(const blw_l1_newton_t *at)
{
    blw_l1_t *const             self = at->l1;
    const blw_l1_model_t *const m    = self->model;
    size_t                      r    = 0U;

    for (size_t g = 0U; g < m->n_groups; g++) {
        r += add_rows(at, g, r);
    }
    for (size_t k = 0U; k < m->n; k++) {
        blw_real_t *const Lr = blw_l1_row_of_L(self, at->free + k);
        blw_l1_newton_gather(self, at->free, &m->G[k], m->n, Lr);
        blw_la_fill(k + 1U, BLW_R(0.0), &Lr[at->free]);
        Lr[at->free + k] = -DAMPING / m->P[blw_la_packed_row(k) + k];
    }
}

/* v = zeta - W l - G x - D l. */
static BLW_APART void residual(const blw_l1_newton_t *at, const blw_real_t *l, blw_real_t *v)
{
    const blw_l1_model_t *const m = at->l1->model;

    blw_l1_predict(m, l, at->x, v);
    for (size_t g = 0U; g < m->n_groups; g++) {
        const blw_real_t D = share(at, g);
        for (size_t j = m->first[g]; j < m->first[g + 1U]; j++) {
            v[j] = (at->zeta[j] - v[j]) - (D * l[j]);
        }
    }
}

/* l_0 on groups outside, the present l inside. */
static void take_known(const blw_l1_t *self, blw_real_t *l)
{
    const blw_l1_model_t *const m = self->model;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const bool outside = blw_l1_outside(self, g, m->first[g]);
        for (size_t j = m->first[g]; j < m->first[g + 1U]; j++) {
            l[j] = outside ? (m->c[g] * self->dir[j]) : self->l[j];
        }
    }
}

/* Solve (1) for the right-hand side in self->step; dx to its first n numbers, l += E l_E. */
static BLW_APART void solve_system(blw_l1_newton_t *at, blw_real_t *l)
{
    blw_l1_t *const self = at->l1;

    blw_l1_solve_LJL(self, at->free, at->free + self->model->n, self->step);
    blw_l1_newton_spread(self, at->free, self->step, l);
    blw_la_copy(self->model->n, &self->step[at->free], self->step);
}

blw_real_t blw_l1_nu(const blw_l1_newton_t *at, size_t g, blw_real_t nu[2])
{
    const blw_l1_t *const self = at->l1;
    const size_t          i    = self->model->first[g];

    nu[0] = at->zeta[i] - self->tau[i];
    nu[1] = BLW_R(0.0);
    if (blw_l1_size(self->model, g) == 1U) {
        return blw_la_abs(nu[0]);
    }
    nu[1] = at->zeta[i + 1U] - self->tau[i + 1U];
    return blw_la_norm(2U, nu);
}

blw_real_t blw_l1_newton_residual(const blw_l1_newton_t *at)
{
    const blw_l1_t *const       self  = at->l1;
    const blw_l1_model_t *const m     = self->model;
    blw_real_t                  worst = BLW_R(0.0);

    for (size_t g = 0U; g < m->n_groups; g++) {
        const size_t     i = m->first[g];
        blw_real_t       nu[2];
        const blw_real_t norm = blw_l1_nu(at, g, nu);
        const blw_real_t w    = blw_la_max(norm, at->kappa * self->A[g]);
        for (size_t j = i; j < m->first[g + 1U]; j++) {
            const blw_real_t e = blw_la_abs((self->l[j] / m->c[g]) - (nu[j - i] / w));
            if (!(e <= BLW_REAL_MAX)) {
                return e; /* a NaN must not pass for 0 */
            }
            worst = blw_la_max(worst, e);
        }
    }
    return worst;
}

size_t blw_l1_newton_column(const blw_l1_newton_t *at, size_t row)
{
    size_t q = 0U;
    size_t i;

    while (turned(at->l1, q, &i) || (i != row)) {
        q++;
    }
    return q;
}

void blw_l1_newton_factor(blw_l1_newton_t *at)
{
    at->free = list_columns(at->l1);
    build(at);
    at->weak = blw_l1_factor(at->l1, at->free, at->free + at->l1->model->n, PIVOT2_MIN);
}

void blw_l1_newton_step(blw_l1_newton_t *at)
{
    blw_l1_t *const             self = at->l1;
    const blw_l1_model_t *const m    = self->model;

    blw_l1_newton_factor(at);
    take_known(self, self->z);
    residual(at, self->z, self->step);
    blw_l1_newton_gather(self, at->free, self->step, 1U, self->step);
    blw_l1_imbalance(m, self->z, &self->step[at->free]);
    solve_system(at, self->z);
    blw_la_axpy(m->n, BLW_R(1.0), self->step, at->x);
    residual(at, self->z, self->dz);
    for (size_t g = 0U; g < m->n_groups; g++) {
        const bool       outside = blw_l1_outside(self, g, m->first[g]);
        const blw_real_t D       = share(at, g);
        for (size_t j = m->first[g]; j < m->first[g + 1U]; j++) {
            const blw_real_t nu = outside ? self->dz[j] : (D * self->z[j]);
            self->dz[j]         = (at->zeta[j] - nu) - self->tau[j];
            self->z[j] -= self->l[j];
        }
    }
}
