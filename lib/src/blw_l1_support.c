/* SPDX-License-Identifier: MIT */
/* The support A of nu and the factor L of its normal matrix.
 *     H = Z_A Z_A' + K,   K = blockdiag((c_g / |nu_g|) (I - dir dir')) on pairs, 0 elsewhere (1)
 * is the Hessian of (2) in blw_l1.h on A.  Without pairs H changes by one row at a time, and L with
 * it.  The residual c dir - l of a Newton step is always formed from Z, never from H, so an error
 * in L slows convergence and does no other harm. */
#include "blw_cold.h"
#include "blw_l1_internal.h"

/* Least pivot: a row of Z has unit norm, so below it the row depends on those before it.  The step
 * then runs along the null direction, far beyond where a group of A vanishes. */
#define PIVOT_MIN (BLW_R(16.0) * BLW_REAL_EPS)

/* Least square of a pivot that is formed as a difference of numbers near 1, and so is rounding
 * below it. */
#define PIVOT2_MIN (BLW_R(4.0) * BLW_REAL_EPS)

/* Walks through the rows of A in the order of L. */
typedef struct cursor {
    size_t k; /* member of A */
    size_t j; /* row within the group */
} cursor_t;

/* Row index of the cursor; the cursor moves on. */
static size_t next_row(const blw_l1_t *self, cursor_t *at)
{
    const size_t g = blw_l1_member(self, at->k);
    const size_t i = (size_t)self->model->first[g] + at->j;

    at->j++;
    if (at->j == blw_l1_size(self->model, g)) {
        at->j = 0U;
        at->k++;
    }
    return i;
}

/* out += sum over the first k rows of A of weight y times the row of Z. */
static void add_rows(const blw_l1_t *self, size_t k, const blw_real_t *y, blw_real_t sign,
                     blw_real_t *out)
{
    cursor_t at = {0U, 0U};

    for (size_t r = 0U; r < k; r++) {
        size_t                  len;
        const blw_real_t *const row = blw_l1_row(self->model, next_row(self, &at), &len);
        blw_la_axpy(len, sign * y[r], row, out);
    }
}

/* New last row of L for row i of Z: L h = Z_A v, pivot = |v - Z_A' (L L')^-1 Z_A v|.  The residual
 * is formed, not |v|^2 - |h|^2, which would lose half of the digits. */
static void extend(blw_l1_t *self, size_t i)
{
    const size_t      k = self->rows;
    size_t            len;
    const blw_real_t *v  = blw_l1_row(self->model, i, &len);
    blw_real_t *const h  = blw_l1_row_of_L(self, k);
    cursor_t          at = {0U, 0U};

    for (size_t r = 0U; r < k; r++) {
        size_t                  len_r;
        const blw_real_t *const row = blw_l1_row(self->model, next_row(self, &at), &len_r);
        h[r]                        = blw_la_dot((len_r < len) ? len_r : len, row, v);
    }
    blw_la_solve_lower(k, self->L, h);
    blw_la_copy(k, h, self->step);
    blw_la_solve_lower_t(k, self->L, self->step);
    blw_la_zero(self->model->d, self->dz);
    blw_la_copy(len, v, self->dz);
    add_rows(self, k, self->step, BLW_R(-1.0), self->dz);
    h[k] = blw_la_max(blw_la_norm(self->model->d, self->dz), PIVOT_MIN);
}

/* Delete row r of L and make the rest lower triangular again by plane rotations of its columns. */
static void shrink(blw_l1_t *self, size_t r)
{
    const size_t k = self->rows;

    for (size_t i = r + 1U; i < k; i++) {
        /* row i (columns 0..i) moves up; columns i-1 and i are rotated to clear its last entry */
        const blw_real_t *const Li  = blw_l1_row_of_L(self, i);
        const blw_real_t        a   = Li[i - 1U];
        const blw_real_t        b   = Li[i];
        const blw_real_t        rho = blw_la_sqrt((a * a) + (b * b));
        for (size_t j = i; j < k; j++) {
            blw_real_t *const Lj = blw_l1_row_of_L(self, j);
            const blw_real_t  s  = Lj[i - 1U];
            const blw_real_t  t  = Lj[i];
            Lj[i - 1U]           = ((a * s) + (b * t)) / rho;
            Lj[i]                = ((a * t) - (b * s)) / rho;
        }
        blw_la_copy(i, Li, blw_l1_row_of_L(self, i - 1U));
    }
}

void blw_l1_support_clear(blw_l1_t *self, const blw_real_t *zeta)
{
    self->n_A  = 0U;
    self->rows = 0U;
    blw_la_copy(self->model->N, zeta, self->tau);
}

void blw_l1_support_add(blw_l1_t *self, size_t g)
{
    if (!blw_l1_has_pairs(self->model)) {
        extend(self, self->model->first[g]);
    }
    self->A[self->n_A] = (blw_real_t)g;
    self->n_A++;
    self->rows = (uint16_t)(self->rows + blw_l1_size(self->model, g));
}

void blw_l1_support_drop(blw_l1_t *self, const blw_real_t *zeta, size_t k)
{
    const blw_l1_model_t *const m = self->model;
    const size_t                g = blw_l1_member(self, k);

    for (size_t i = m->first[g]; i < m->first[g + 1U]; i++) {
        size_t                  len;
        const blw_real_t *const row = blw_l1_row(m, i, &len);
        blw_la_axpy(len, zeta[i] - self->tau[i], row, self->z);
        self->tau[i] = zeta[i];
    }
    if (!blw_l1_has_pairs(m)) {
        shrink(self, k);
    }
    self->n_A--;
    self->rows = (uint16_t)(self->rows - blw_l1_size(m, g));
    for (size_t j = k; j < self->n_A; j++) {
        self->A[j] = self->A[j + 1U];
    }
}

/* Row r of H in (1) up to the diagonal: row i of Z, of group g. */
static BLW_APART void hessian_row(const blw_l1_t *self, size_t r, size_t i, blw_real_t *H)
{
    cursor_t                at = {0U, 0U};
    size_t                  len;
    const blw_real_t *const v = blw_l1_row(self->model, i, &len);

    for (size_t s = 0U; s <= r; s++) {
        size_t                  len_s;
        const blw_real_t *const row = blw_l1_row(self->model, next_row(self, &at), &len_s);
        H[s]                        = blw_la_dot((len_s < len) ? len_s : len, row, v);
    }
}

void blw_l1_support_factor(blw_l1_t *self, const blw_real_t *zeta)
{
    const blw_l1_model_t *const m  = self->model;
    cursor_t                    at = {0U, 0U};

    for (size_t r = 0U; r < self->rows; r++) {
        const size_t      g = blw_l1_member(self, at.k);
        const size_t      j = at.j;
        const size_t      i = next_row(self, &at);
        blw_real_t *const H = blw_l1_row_of_L(self, r);
        hessian_row(self, r, i, H);
        if (blw_l1_size(m, g) == 2U) {
            const blw_real_t least     = BLW_REAL_EPS * m->c[g];
            const blw_real_t curvature = m->c[g] / blw_la_max(blw_l1_nu_norm(self, zeta, g), least);
            H[r] += curvature * (BLW_R(1.0) - (self->dir[i] * self->dir[i]));
            if (j == 1U) {
                H[r - 1U] -= curvature * self->dir[i - 1U] * self->dir[i];
            }
        }
        const blw_real_t diagonal = H[r];
        blw_la_solve_lower(r, self->L, H);
        const blw_real_t pivot2 = diagonal - blw_la_dot(r, H, H);
        H[r]                    = blw_la_sqrt(blw_la_max(pivot2, PIVOT2_MIN));
    }
}

void blw_l1_support_newton(blw_l1_t *self)
{
    const blw_l1_model_t *const m  = self->model;
    cursor_t                    at = {0U, 0U};

    for (size_t r = 0U; r < self->rows; r++) {
        const size_t g = blw_l1_member(self, at.k);
        const size_t i = next_row(self, &at);
        self->step[r]  = (m->c[g] * self->dir[i]) - self->l[i];
    }
    blw_la_solve_lower(self->rows, self->L, self->step);
    blw_la_solve_lower_t(self->rows, self->L, self->step);
    blw_la_zero(m->d, self->dz);
    add_rows(self, self->rows, self->step, BLW_R(1.0), self->dz);
}

void blw_l1_support_move(blw_l1_t *self, blw_real_t alpha)
{
    cursor_t at = {0U, 0U};

    for (size_t r = 0U; r < self->rows; r++) {
        self->tau[next_row(self, &at)] += alpha * self->step[r];
    }
    blw_la_axpy(self->model->d, alpha, self->dz, self->z);
}

blw_real_t blw_l1_support_effect(const blw_l1_t *self)
{
    const blw_l1_model_t *const m   = self->model;
    blw_real_t                  sum = BLW_R(0.0);

    for (size_t j = 0U; j < m->n; j++) {
        cursor_t   at = {0U, 0U};
        blw_real_t e  = BLW_R(0.0);
        for (size_t r = 0U; r < self->rows; r++) {
            e += m->F[(j * m->N) + next_row(self, &at)] * self->step[r];
        }
        sum += e * e;
    }
    return blw_la_sqrt(sum);
}

blw_real_t blw_l1_support_residual(const blw_l1_t *self)
{
    const blw_l1_model_t *const m   = self->model;
    const blw_real_t            z   = blw_la_norm(m->d, self->z);
    cursor_t                    at  = {0U, 0U};
    blw_real_t                  max = BLW_R(0.0);

    for (size_t r = 0U; r < self->rows; r++) {
        const size_t     g = blw_l1_member(self, at.k);
        const size_t     i = next_row(self, &at);
        const blw_real_t e = blw_la_abs(self->l[i] - (m->c[g] * self->dir[i]));
        max                = blw_la_max(max, e / (m->c[g] + z));
    }
    return max;
}
