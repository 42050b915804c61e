/* SPDX-License-Identifier: MIT */
/** @file blw_la.h  Private dense kernels.  All sums run in index order, so every target computes
 *  the same bits.  Dense = row-major, triangular = packed by rows, output last;
 *  no output may overlap an input unless the comment says "in place".
 */
#ifndef BLW_LA_H
#define BLW_LA_H
#include <math.h>
#include "blw/blw_real.h"

#ifdef BLW_REAL_DOUBLE
#define BLW_LA_SQRT sqrt
#else
#define BLW_LA_SQRT sqrtf
#endif

/** |a|: one instruction, not a call, on every target. */
static inline blw_real_t blw_la_abs(blw_real_t a)
{
    return BLW_REAL_ABS(a);
}

/** The larger one; a if one of them is NaN. */
static inline blw_real_t blw_la_max(blw_real_t a, blw_real_t b)
{
    return (b > a) ? b : a;
}

/** Square root of a >= 0, correctly rounded on every target. */
static inline blw_real_t blw_la_sqrt(blw_real_t a)
{
    return BLW_LA_SQRT(a);
}

/** Offset of row i of a packed lower triangle: i (i + 1) / 2. */
static inline size_t blw_la_packed_row(size_t i)
{
    return (i * (i + 1U)) / 2U;
}

/** Offset of row i of a packed lower trapezoid with d columns: rows grow to d, then stay full. */
static inline size_t blw_la_trap_row(size_t d, size_t i)
{
    return (i < d) ? blw_la_packed_row(i) : (blw_la_packed_row(d) + ((i - d) * d));
}

/** Cut the next len numbers off *mem. */
static inline blw_real_t *blw_la_take(blw_real_t **mem, size_t len)
{
    blw_real_t *const taken = *mem;

    *mem = taken + len;
    return taken;
}

/** Every x_i is finite. */
bool blw_la_finite(size_t n, const blw_real_t *x);
/** Every |x_i| <= BLW_SIGNAL_MAX; false if one of them is NaN. */
bool blw_la_bounded(size_t n, const blw_real_t *x);
/** y = x */
void blw_la_copy(size_t n, const blw_real_t *x, blw_real_t *y);
/** x = 0 */
void blw_la_zero(size_t n, blw_real_t *x);
/** x = (value, ..., value) */
void blw_la_fill(size_t n, blw_real_t value, blw_real_t *x);
/** a' b */
blw_real_t blw_la_dot(size_t n, const blw_real_t *a, const blw_real_t *b);
/** y = y + alpha x, in place */
void blw_la_axpy(size_t n, blw_real_t alpha, const blw_real_t *x, blw_real_t *y);
/** y = a + b */
void blw_la_sum(size_t n, const blw_real_t *a, const blw_real_t *b, blw_real_t *y);
/** y = A x, A [rows x cols] */
void blw_la_gemv(size_t rows, size_t cols, const blw_real_t *A, const blw_real_t *x, blw_real_t *y);
/** y = y + A x, A [rows x cols], in place */
void blw_la_gemv_add(size_t rows, size_t cols, const blw_real_t *A, const blw_real_t *x,
                     blw_real_t *y);
/** y = S x, S [n x n] symmetric, lower triangle packed */
void blw_la_symv(size_t n, const blw_real_t *S, const blw_real_t *x, blw_real_t *y);
/** y = Z x, Z [N x d] packed lower trapezoid */
void blw_la_trapv(size_t N, size_t d, const blw_real_t *Z, const blw_real_t *x, blw_real_t *y);
/** y = Z' x, Z [N x d] packed lower trapezoid */
void blw_la_trapv_t(size_t N, size_t d, const blw_real_t *Z, const blw_real_t *x, blw_real_t *y);
/** x = L^-1 x, L [n x n] packed lower triangle with a diagonal /= 0, in place */
void blw_la_solve_lower(size_t n, const blw_real_t *L, blw_real_t *x);
/** x = L'^-1 x, L [n x n] packed lower triangle with a diagonal /= 0, in place */
void blw_la_solve_lower_t(size_t n, const blw_real_t *L, blw_real_t *x);
/** |x|_2 */
blw_real_t blw_la_norm(size_t n, const blw_real_t *x);

#endif
