/* SPDX-License-Identifier: MIT */
/* Factor of the systems of blw_l1_kkt.c and blw_l1_newton_step.c: a symmetric matrix, packed lower,
 * becomes L J L' in place, J = diag(I, -I) with the first I of order f.  Two rows and two columns
 * at a time, so that every number is loaded for two products; all sums run in index order. */
#include "blw_l1_internal.h"

/* Least pivot of L: rows of W have about unit variance or more. */
#define PIVOT_MIN BLW_REAL_EPS

/* Products of rows A and B with rows P and Q. */
typedef struct products {
    blw_real_t AP;
    blw_real_t BP;
    blw_real_t AQ;
    blw_real_t BQ;
} products_t;

/* The first n columns, n even. */
static products_t multiply(size_t n, const blw_real_t *A, const blw_real_t *B, const blw_real_t *P,
                           const blw_real_t *Q)
{
    products_t s = {BLW_R(0.0), BLW_R(0.0), BLW_R(0.0), BLW_R(0.0)};

    for (size_t j = 0U; j < n; j += 2U) {
        s.AP += A[j] * P[j];
        s.BP += B[j] * P[j];
        s.AQ += A[j] * Q[j];
        s.BQ += B[j] * Q[j];
        s.AP += A[j + 1U] * P[j + 1U];
        s.BP += B[j + 1U] * P[j + 1U];
        s.AQ += A[j + 1U] * Q[j + 1U];
        s.BQ += B[j + 1U] * Q[j + 1U];
    }
    return s;
}

/* The first `count` columns, where J is 1, of two rows of the matrix become those of L. */
static void reduce_two_rows(size_t count, const blw_real_t *L, blw_real_t *A, blw_real_t *B)
{
    const blw_real_t *P = L;
    size_t            q = 0U;

    for (; (q + 2U) <= count; q += 2U) {
        const blw_real_t *const Q = &P[q + 1U];
        const products_t        s = multiply(q, A, B, P, Q);

        A[q]      = (A[q] - s.AP) / P[q];
        B[q]      = (B[q] - s.BP) / P[q];
        A[q + 1U] = (A[q + 1U] - (s.AQ + (A[q] * Q[q]))) / Q[q + 1U];
        B[q + 1U] = (B[q + 1U] - (s.BQ + (B[q] * Q[q]))) / Q[q + 1U];
        P         = &Q[q + 2U];
    }
    if (q < count) {
        A[q] = (A[q] - blw_la_dot(q, A, P)) / P[q];
        B[q] = (B[q] - blw_la_dot(q, B, P)) / P[q];
    }
}

/* Pivot of row r, the columns before it done.  @return whether it is below a share of its
 * diagonal. */
static bool finish_row(size_t r, blw_real_t share, blw_real_t *Lr)
{
    const blw_real_t least  = blw_la_max(share * Lr[r], PIVOT_MIN * PIVOT_MIN);
    const blw_real_t pivot2 = Lr[r] - blw_la_dot(r, Lr, Lr);

    Lr[r] = blw_la_sqrt(blw_la_max(pivot2, least));
    return !(pivot2 > least);
}

/* Row r where J is -1: columns from f on, those before them done. */
static void finish_row_of_G(size_t f, size_t r, const blw_real_t *L, blw_real_t *Lr)
{
    const blw_real_t *Lq = &L[blw_la_packed_row(f)];

    for (size_t q = f; q <= r; q++) {
        const blw_real_t rest = blw_la_dot(f, Lr, Lq) - Lr[q] - blw_la_dot(q - f, &Lr[f], &Lq[f]);

        Lr[q] = (q < r) ? (rest / Lq[q]) : blw_la_sqrt(blw_la_max(rest, PIVOT_MIN * PIVOT_MIN));
        Lq += q + 1U;
    }
}

/* The first f rows, where J is 1.  @return whether a pivot is below a share of its diagonal. */
static bool factor_rows(size_t f, blw_real_t share, blw_real_t *L)
{
    bool   weak = false;
    size_t r    = 0U;

    for (; (r + 2U) <= f; r += 2U) {
        blw_real_t *const A = &L[blw_la_packed_row(r)];
        blw_real_t *const B = &A[r + 1U];

        reduce_two_rows(r, L, A, B);
        weak = finish_row(r, share, A) || weak;
        B[r] = (B[r] - blw_la_dot(r, A, B)) / A[r];
        weak = finish_row(r + 1U, share, B) || weak;
    }
    if (r < f) {
        blw_real_t *const A = &L[blw_la_packed_row(r)];

        blw_la_solve_lower(r, L, A);
        weak = finish_row(r, share, A) || weak;
    }
    return weak;
}

bool blw_l1_factor(blw_l1_t *self, size_t f, size_t size, blw_real_t share)
{
    blw_real_t *const L    = self->L;
    const bool        weak = factor_rows(f, share, L);
    size_t            r    = f;

    for (; (r + 2U) <= size; r += 2U) {
        blw_real_t *const A = &L[blw_la_packed_row(r)];
        blw_real_t *const B = &A[r + 1U];

        reduce_two_rows(f, L, A, B);
        finish_row_of_G(f, r, L, A);
        finish_row_of_G(f, r + 1U, L, B);
    }
    if (r < size) {
        blw_real_t *const A = &L[blw_la_packed_row(r)];

        blw_la_solve_lower(f, L, A);
        finish_row_of_G(f, r, L, A);
    }
    return weak;
}

void blw_l1_solve_LJL(const blw_l1_t *self, size_t f, size_t size, blw_real_t *v)
{
    blw_la_solve_lower(size, self->L, v);
    for (size_t k = f; k < size; k++) {
        v[k] = -v[k];
    }
    blw_la_solve_lower_t(size, self->L, v);
}
