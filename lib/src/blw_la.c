/* SPDX-License-Identifier: MIT */
#include "blw_la.h"

static bool within(size_t n, const blw_real_t *x, blw_real_t limit)
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

    for (; (i + 4U) <= n; i += 4U) {
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

void blw_la_fill(size_t n, blw_real_t value, blw_real_t *x)
{
    for (size_t i = 0U; i < n; i++) {
        x[i] = value;
    }
}

/* An odd element first, then pairs: half of the loop's own work. */
blw_real_t blw_la_dot(size_t n, const blw_real_t *a, const blw_real_t *b)
{
    blw_real_t sum = BLW_R(0.0);
    size_t     i   = n & 1U;

    if (i != 0U) {
        sum += a[0] * b[0];
    }
    for (; i < n; i += 2U) {
        sum += a[i] * b[i];
        sum += a[i + 1U] * b[i + 1U];
    }
    return sum;
}

void blw_la_axpy(size_t n, blw_real_t alpha, const blw_real_t *x, blw_real_t *y)
{
    size_t i = n & 1U;

    if (i != 0U) {
        y[0] += alpha * x[0];
    }
    for (; i < n; i += 2U) {
        y[i] += alpha * x[i];
        y[i + 1U] += alpha * x[i + 1U];
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

    for (; (i + 3U) <= rows; i += 3U) {
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

    for (; (i + 3U) <= rows; i += 3U) {
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

/* Rows i to i + 2 of a symmetric product and what they are worth, as columns, to the rows above:
 * every S_ij is loaded once for two products. */
static void symv_rows(size_t i, const blw_real_t *S, const blw_real_t *x, blw_real_t *y)
{
    const blw_real_t *const A  = &S[blw_la_packed_row(i)];
    const blw_real_t *const B  = &A[i + 1U];
    const blw_real_t *const C  = &B[i + 2U];
    const blw_real_t        xa = x[i];
    const blw_real_t        xb = x[i + 1U];
    const blw_real_t        xc = x[i + 2U];
    blw_real_t              a  = BLW_R(0.0);
    blw_real_t              b  = BLW_R(0.0);
    blw_real_t              c  = BLW_R(0.0);

    for (size_t j = 0U; j < i; j++) {
        const blw_real_t x_j = x[j];
        const blw_real_t Aj  = A[j];
        const blw_real_t Bj  = B[j];
        const blw_real_t Cj  = C[j];
        a += Aj * x_j;
        b += Bj * x_j;
        c += Cj * x_j;
        y[j] = ((y[j] + (Aj * xa)) + (Bj * xb)) + (Cj * xc);
    }
    y[i]      = ((a + (A[i] * xa)) + (B[i] * xb)) + (C[i] * xc);
    y[i + 1U] = ((b + (B[i] * xa)) + (B[i + 1U] * xb)) + (C[i + 1U] * xc);
    y[i + 2U] = ((c + (C[i] * xa)) + (C[i + 1U] * xb)) + (C[i + 2U] * xc);
}

void blw_la_symv(size_t n, const blw_real_t *S, const blw_real_t *x, blw_real_t *y)
{
    size_t i = 0U;

    for (; (i + 3U) <= n; i += 3U) {
        symv_rows(i, S, x, y);
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
    blw_la_fill(d, BLW_R(0.0), y);
    for (size_t i = 0U; i < N; i++) {
        blw_la_axpy((i < d) ? (i + 1U) : d, x[i], &Z[blw_la_trap_row(d, i)], y);
    }
}

void blw_la_solve_lower(size_t n, const blw_real_t *L, blw_real_t *x)
{
    for (size_t i = 0U; i < n; i++) {
        const blw_real_t *const Li = &L[blw_la_packed_row(i)];
        x[i]                       = (x[i] - blw_la_dot(i, Li, x)) / Li[i];
    }
}

void blw_la_solve_lower_t(size_t n, const blw_real_t *L, blw_real_t *x)
{
    for (size_t i = n; i-- > 0U;) {
        const blw_real_t *const Li = &L[blw_la_packed_row(i)];
        x[i] /= Li[i];
        blw_la_axpy(i, -x[i], Li, x);
    }
}

blw_real_t blw_la_norm(size_t n, const blw_real_t *x)
{
    return blw_la_sqrt(blw_la_dot(n, x, x));
}
