/* SPDX-License-Identifier: MIT */
#include "blw_la.h"
#include "blw_cold.h"

static BLW_APART bool within(size_t n, const blw_real_t *x, blw_real_t limit)
{
    for (size_t i = 0U; i < n; i++) {
        if (!(blw_la_abs(x[i]) <= limit)) { /* so that NaN fails */
            return false;
        }
    }
    return true;
}

bool blw_la_finite(size_t n, const blw_real_t *x)
{
    return within(n, x, BLW_REAL_MAX);
}

bool blw_la_bounded(size_t n, const blw_real_t *x)
{
    return within(n, x, BLW_SIGNAL_MAX);
}

void blw_la_copy(size_t n, const blw_real_t *x, blw_real_t *y)
{
    size_t i = 0U;

    for (; (BLW_AT_ONCE != 0) && ((i + 4U) <= n); i += 4U) {
        const blw_real_t a = x[i];
        const blw_real_t b = x[i + 1U];
        const blw_real_t c = x[i + 2U];
        const blw_real_t d = x[i + 3U];
        y[i]               = a;
        y[i + 1U]          = b;
        y[i + 2U]          = c;
        y[i + 3U]          = d;
    }
    for (; i < n; i++) {
        y[i] = x[i];
    }
}

/* Apart: with a known value it would become a call of memset, byte by byte in small C libraries. */
BLW_APART void blw_la_fill(size_t n, blw_real_t value, blw_real_t *x)
{
    for (size_t i = 0U; i < n; i++) {
        x[i] = value;
    }
}

void blw_la_zero(size_t n, blw_real_t *x)
{
    blw_la_fill(n, BLW_R(0.0), x);
}

/* Elements that a loop takes one by one before it takes pairs, which is half of its own work. */
static inline size_t single(size_t n)
{
    return (BLW_AT_ONCE != 0) ? (n & 1U) : n;
}

blw_real_t blw_la_dot(size_t n, const blw_real_t *a, const blw_real_t *b)
{
    const size_t first = single(n);
    blw_real_t   sum   = BLW_R(0.0);

    for (size_t i = 0U; i < first; i++) {
        sum += a[i] * b[i];
    }
    for (size_t i = first; i < n; i += 2U) {
        sum += a[i] * b[i];
        sum += a[i + 1U] * b[i + 1U];
    }
    return sum;
}

void blw_la_axpy(size_t n, blw_real_t alpha, const blw_real_t *x, blw_real_t *y)
{
    const size_t first = single(n);

    for (size_t i = 0U; i < first; i++) {
        y[i] += alpha * x[i];
    }
    for (size_t i = first; i < n; i += 2U) {
        y[i] += alpha * x[i];
        y[i + 1U] += alpha * x[i + 1U];
    }
}

void blw_la_sum(size_t n, const blw_real_t *a, const blw_real_t *b, blw_real_t *y)
{
    for (size_t i = 0U; i < n; i++) {
        y[i] = a[i] + b[i];
    }
}

/* Three sums at once: every x_j is loaded once for three products. */
static void three_dots(size_t cols, const blw_real_t *A, const blw_real_t *x, blw_real_t *sum)
{
    const blw_real_t *const B = &A[cols];
    const blw_real_t *const C = &B[cols];
    blw_real_t              a = BLW_R(0.0);
    blw_real_t              b = BLW_R(0.0);
    blw_real_t              c = BLW_R(0.0);

    for (size_t j = 0U; j < cols; j++) {
        const blw_real_t x_j = x[j];
        a += A[j] * x_j;
        b += B[j] * x_j;
        c += C[j] * x_j;
    }
    sum[0] = a;
    sum[1] = b;
    sum[2] = c;
}

void blw_la_gemv(size_t rows, size_t cols, const blw_real_t *A, const blw_real_t *x, blw_real_t *y)
{
    size_t i = 0U;

    for (; (BLW_AT_ONCE != 0) && ((i + 3U) <= rows); i += 3U) {
        three_dots(cols, &A[i * cols], x, &y[i]);
    }
    for (; i < rows; i++) {
        y[i] = blw_la_dot(cols, &A[i * cols], x);
    }
}

void blw_la_gemv_add(size_t rows, size_t cols, const blw_real_t *A, const blw_real_t *x,
                     blw_real_t *y)
{
    size_t i = 0U;

    for (; (BLW_AT_ONCE != 0) && ((i + 3U) <= rows); i += 3U) {
        blw_real_t sum[3];
        three_dots(cols, &A[i * cols], x, sum);
        y[i] += sum[0];
        y[i + 1U] += sum[1];
        y[i + 2U] += sum[2];
    }
    for (; i < rows; i++) {
        y[i] += blw_la_dot(cols, &A[i * cols], x);
    }
}

/* Rows i to i + 3 of a symmetric product, columns 0 to i - 1, and what they are worth, as columns,
 * to the rows above: every S_ij is loaded once for two products.  Four rows are what the 16
 * registers of an FPU hold that a function need not save. */
static void symv_strip(size_t i, const blw_real_t *S, const blw_real_t *x, blw_real_t *y)
{
    const blw_real_t *const A  = &S[blw_la_packed_row(i)];
    const blw_real_t *const B  = &A[i + 1U];
    const blw_real_t *const C  = &B[i + 2U];
    const blw_real_t *const D  = &C[i + 3U];
    const blw_real_t        xa = x[i];
    const blw_real_t        xb = x[i + 1U];
    const blw_real_t        xc = x[i + 2U];
    const blw_real_t        xd = x[i + 3U];
    blw_real_t              a  = BLW_R(0.0);
    blw_real_t              b  = BLW_R(0.0);
    blw_real_t              c  = BLW_R(0.0);
    blw_real_t              d  = BLW_R(0.0);

    for (size_t j = 0U; j < i; j++) {
        const blw_real_t x_j = x[j];
        const blw_real_t Aj  = A[j];
        const blw_real_t Bj  = B[j];
        const blw_real_t Cj  = C[j];
        const blw_real_t Dj  = D[j];
        a += Aj * x_j;
        b += Bj * x_j;
        c += Cj * x_j;
        d += Dj * x_j;
        y[j] = (((y[j] + (Aj * xa)) + (Bj * xb)) + (Cj * xc)) + (Dj * xd);
    }
    y[i]      = a;
    y[i + 1U] = b;
    y[i + 2U] = c;
    y[i + 3U] = d;
}

/* The rest of these rows: columns i to i + 3. */
static void symv_corner(size_t i, const blw_real_t *S, const blw_real_t *x, blw_real_t *y)
{
    const blw_real_t *const A = &S[blw_la_packed_row(i) + i];
    const blw_real_t *const B = &A[i + 1U];
    const blw_real_t *const C = &B[i + 2U];
    const blw_real_t *const D = &C[i + 3U];
    const blw_real_t        a = x[i];
    const blw_real_t        b = x[i + 1U];
    const blw_real_t        c = x[i + 2U];
    const blw_real_t        d = x[i + 3U];

    y[i]      = (((y[i] + (A[0] * a)) + (B[0] * b)) + (C[0] * c)) + (D[0] * d);
    y[i + 1U] = (((y[i + 1U] + (B[0] * a)) + (B[1] * b)) + (C[1] * c)) + (D[1] * d);
    y[i + 2U] = (((y[i + 2U] + (C[0] * a)) + (C[1] * b)) + (C[2] * c)) + (D[2] * d);
    y[i + 3U] = (((y[i + 3U] + (D[0] * a)) + (D[1] * b)) + (D[2] * c)) + (D[3] * d);
}

void blw_la_symv(size_t n, const blw_real_t *S, const blw_real_t *x, blw_real_t *y)
{
    size_t i = 0U;

    for (; (BLW_AT_ONCE != 0) && ((i + 4U) <= n); i += 4U) {
        symv_strip(i, S, x, y);
        symv_corner(i, S, x, y);
    }
    for (; i < n; i++) {
        const blw_real_t *const Si = &S[blw_la_packed_row(i)];
        y[i]                       = blw_la_dot(i + 1U, Si, x);
        blw_la_axpy(i, x[i], Si, y);
    }
}

void blw_la_trapv(size_t N, size_t d, const blw_real_t *Z, const blw_real_t *x, blw_real_t *y)
{
    for (size_t i = 0U; i < N; i++) {
        y[i] = blw_la_dot((i < d) ? (i + 1U) : d, &Z[blw_la_trap_row(d, i)], x);
    }
}

void blw_la_trapv_t(size_t N, size_t d, const blw_real_t *Z, const blw_real_t *x, blw_real_t *y)
{
    blw_la_zero(d, y);
    for (size_t i = 0U; i < N; i++) {
        blw_la_axpy((i < d) ? (i + 1U) : d, x[i], &Z[blw_la_trap_row(d, i)], y);
    }
}

/* Two rows at once: every x_j is loaded once for both. */
void blw_la_solve_lower(size_t n, const blw_real_t *L, blw_real_t *x)
{
    const blw_real_t *A = L;
    size_t            i = 0U;

    for (; (BLW_AT_ONCE != 0) && ((i + 2U) <= n); i += 2U) {
        const blw_real_t *const B = &A[i + 1U];
        blw_real_t              a = BLW_R(0.0);
        blw_real_t              b = BLW_R(0.0);
        for (size_t j = 0U; j < i; j++) {
            a += A[j] * x[j];
            b += B[j] * x[j];
        }
        x[i] = (x[i] - a) / A[i];
        b += B[i] * x[i];
        x[i + 1U] = (x[i + 1U] - b) / B[i + 1U];
        A         = &B[i + 2U];
    }
    for (; i < n; i++) {
        x[i] = (x[i] - blw_la_dot(i, A, x)) / A[i];
        A    = &A[i + 1U];
    }
}

void blw_la_solve_lower_t(size_t n, const blw_real_t *L, blw_real_t *x)
{
    size_t i = n;

    for (; (BLW_AT_ONCE != 0) && (i >= 2U); i -= 2U) {
        const blw_real_t *const A = &L[blw_la_packed_row(i - 2U)];
        const blw_real_t *const B = &A[i - 1U];
        const blw_real_t        b = x[i - 1U] / B[i - 1U];
        const blw_real_t        a = (x[i - 2U] - (b * B[i - 2U])) / A[i - 2U];
        for (size_t j = 0U; j < (i - 2U); j++) {
            x[j] = (x[j] - (b * B[j])) - (a * A[j]);
        }
        x[i - 2U] = a;
        x[i - 1U] = b;
    }
    while (i > 0U) {
        i--;
        const blw_real_t *const Li = &L[blw_la_packed_row(i)];
        x[i] /= Li[i];
        blw_la_axpy(i, -x[i], Li, x);
    }
}

blw_real_t blw_la_norm(size_t n, const blw_real_t *x)
{
    return blw_la_sqrt(blw_la_dot(n, x, x));
}
