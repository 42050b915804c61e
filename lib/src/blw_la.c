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
    for (size_t i = 0U; i < n; i++) {
        y[i] = x[i];
    }
}

void blw_la_fill(size_t n, blw_real_t value, blw_real_t *x)
{
    for (size_t i = 0U; i < n; i++) {
        x[i] = value;
    }
}

blw_real_t blw_la_dot(size_t n, const blw_real_t *a, const blw_real_t *b)
{
    blw_real_t sum = BLW_R(0.0);

    for (size_t i = 0U; i < n; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

void blw_la_axpy(size_t n, blw_real_t alpha, const blw_real_t *x, blw_real_t *y)
{
    for (size_t i = 0U; i < n; i++) {
        y[i] += alpha * x[i];
    }
}

void blw_la_gemv(size_t rows, size_t cols, const blw_real_t *A, const blw_real_t *x, blw_real_t *y)
{
    for (size_t i = 0U; i < rows; i++) {
        y[i] = blw_la_dot(cols, &A[i * cols], x);
    }
}

void blw_la_gemv_add(size_t rows, size_t cols, const blw_real_t *A, const blw_real_t *x,
                     blw_real_t *y)
{
    for (size_t i = 0U; i < rows; i++) {
        y[i] += blw_la_dot(cols, &A[i * cols], x);
    }
}

void blw_la_symv(size_t n, const blw_real_t *S, const blw_real_t *x, blw_real_t *y)
{
    for (size_t i = 0U; i < n; i++) {
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
