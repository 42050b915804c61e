/* SPDX-License-Identifier: MIT */
/* The linear system of blw_l1_newton.c.  Unknown are l on the groups inside, one number t per pair
 * outside, which turns it, l_g = c_g dir_g + t p_g, p_g = dir_g turned by 90 degrees, and x:
 *     [ E' W E + D   E' G ] [ l_E ]   [ E' (zeta - W l_0) ]
 *     [ G' E         -R   ] [ x   ] = [ -G' l_0           ],  l = l_0 + E l_E,  tau = W l + G x. (1)
 * D = kappa width_g / c_g inside, |nu_g| / c_g for a pair outside; l_0 = c dir outside.  The system
 * is solved for the change from the present point, so that rounding errors do not stay.  R, a small
 * part of the information on x, holds x where E' G leaves it open; it only damps the change.
 * The matrix is factored by blw_l1_factor.c. */
#include "blw_l1_newton.h"

/* R relative to the information of the Kalman estimate. */
#define DAMPING BLW_R(1e-5)

/* Least square of a pivot, relative to the diagonal: below it W is singular as far as its rounded
 * numbers can tell. */
#define PIVOT2_MIN (BLW_R(16.0) * BLW_REAL_EPS)

/* E' v down to group `last`, for v with its rows `stride` apart.  @return columns of E so far. */
static size_t gather(const blw_l1_t *self, size_t last, const blw_real_t *v, size_t stride,
                     blw_real_t *out)
{
    const blw_l1_model_t *const m = self->model;
    size_t                      q = 0U;

    for (size_t g = 0U; g <= last; g++) {
        const size_t            i       = m->first[g];
        const blw_real_t *const v_i     = &v[i * stride];
        const bool              pair    = (blw_l1_size(m, g) == 2U);
        const bool              outside = blw_l1_outside(self, g, i);
        if (pair && outside) {
            out[q] = (self->dir[i] * v_i[stride]) - (self->dir[i + 1U] * v_i[0]);
            q++;
        } else if (!outside) {
            out[q]                    = v_i[0];
            out[q + (pair ? 1U : 0U)] = v_i[pair ? stride : 0U];
            q += pair ? 2U : 1U;
        } else {
            /* one row outside: l_g is known */
        }
    }
    return q;
}

/* l or another v [N] from its columns: v = E y on the rows of E, unchanged plus turned on pairs. */
static void spread(const blw_l1_t *self, const blw_real_t *y, blw_real_t *v)
{
    const blw_l1_model_t *const m = self->model;
    size_t                      q = 0U;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const size_t i    = m->first[g];
        const bool   pair = (blw_l1_size(m, g) == 2U);
        if (!blw_l1_outside(self, g, i)) {
            v[i] += y[q];
            v[i + (pair ? 1U : 0U)] += pair ? y[q + 1U] : BLW_R(0.0);
            q += pair ? 2U : 1U;
        } else if (pair) {
            v[i] -= self->dir[i + 1U] * y[q];
            v[i + 1U] += self->dir[i] * y[q];
            q++;
        } else {
            /* one row outside: l_g is known */
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

/* Rows of the matrix for the columns of E of group g, from row r on.  @return their number. */
static size_t add_rows(blw_l1_newton_t *at, size_t g, size_t r)
{
    const blw_l1_t *const       self = at->l1;
    const blw_l1_model_t *const m    = self->model;
    const size_t                i    = m->first[g];
    const size_t                size = blw_l1_size(m, g);
    const blw_real_t *const     W_i  = &m->W[blw_la_packed_row(i)];
    const blw_real_t *const     W_j  = &W_i[i + 1U]; /* row i + 1 */

    if (!blw_l1_outside(self, g, i)) {
        for (size_t k = 0U; k < size; k++) {
            blw_real_t *const Lr = blw_l1_row_of_L(self, r + k);
            (void)gather(self, g, (k == 0U) ? W_i : W_j, 1U, Lr);
            Lr[r + k] += share(at, g);
        }
        return size;
    }
    if (size == 2U) {
        blw_real_t        nu[2];
        blw_real_t *const row = self->step;
        for (size_t j = 0U; j <= i; j++) {
            row[j] = (self->dir[i] * W_j[j]) - (self->dir[i + 1U] * W_i[j]);
        }
        row[i + 1U]          = (self->dir[i] * W_j[i + 1U]) - (self->dir[i + 1U] * W_j[i]);
        blw_real_t *const Lr = blw_l1_row_of_L(self, r);
        (void)gather(self, g, row, 1U, Lr);
        Lr[r] += blw_l1_nu(at, g, nu) / m->c[g];
    }
    return size - 1U;
}

static void factorise(blw_l1_newton_t *at)
{
    blw_l1_t *const             self = at->l1;
    const blw_l1_model_t *const m    = self->model;

    at->free = 0U;
    for (size_t g = 0U; g < m->n_groups; g++) {
        at->free += add_rows(at, g, at->free);
    }
    for (size_t k = 0U; k < m->n; k++) {
        blw_real_t *const Lr = blw_l1_row_of_L(self, at->free + k);
        (void)gather(self, m->n_groups - 1U, &m->G[k], m->n, Lr);
        blw_la_fill(k + 1U, BLW_R(0.0), &Lr[at->free]);
        Lr[at->free + k] = -DAMPING / m->P[blw_la_packed_row(k) + k];
    }
    at->weak = blw_l1_factor(self, at->free, at->free + m->n, PIVOT2_MIN);
}

/* v = zeta - W l - G x - D l. */
static void residual(const blw_l1_newton_t *at, const blw_real_t *l, blw_real_t *v)
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
static void solve_system(blw_l1_newton_t *at, blw_real_t *l)
{
    blw_l1_t *const self = at->l1;

    blw_l1_solve_LJL(self, at->free, at->free + self->model->n);
    spread(self, self->step, l);
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

void blw_l1_newton_step(blw_l1_newton_t *at)
{
    blw_l1_t *const             self = at->l1;
    const blw_l1_model_t *const m    = self->model;

    factorise(at);
    take_known(self, self->z);
    residual(at, self->z, self->dz);
    (void)gather(self, m->n_groups - 1U, self->dz, 1U, self->step);
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
