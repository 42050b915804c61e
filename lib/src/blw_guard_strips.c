/* SPDX-License-Identifier: MIT */
/* The width of a strip is a constant wherever the inner functions are used, so that the compiler
 * keeps the sums in registers; that is why they are inline. */
#include "blw_guard_strips.h"
#include "blw_cold.h"

/* Rows of two strips. */
#define GUARD_TWO 6U

/* Rows of a strip if so many are left. */
static inline size_t width_of(size_t rows)
{
    return (rows < GUARD_STRIP) ? rows : GUARD_STRIP;
}

static inline void mul_strip(size_t width, size_t count, const blw_real_t *M, const blw_real_t *x,
                             blw_real_t *y)
{
    blw_real_t sum[GUARD_STRIP] = {BLW_R(0.0)};

    for (size_t c = 0U; c < count; c++) {
        for (size_t a = 0U; a < width; a++) {
            sum[a] += M[(c * width) + a] * x[c];
        }
    }
    for (size_t a = 0U; a < width; a++) {
        y[a] += sum[a];
    }
}

/* Two strips of three at once: the same sums with half the loads of x. */
static inline void mul_two(size_t count, const blw_real_t *M, const blw_real_t *below,
                           const blw_real_t *x, blw_real_t *y)
{
    blw_real_t sum[GUARD_TWO] = {BLW_R(0.0)};

    for (size_t c = 0U; c < count; c++) {
        for (size_t a = 0U; a < GUARD_STRIP; a++) {
            sum[a] += M[a] * x[c];
            sum[GUARD_STRIP + a] += below[a] * x[c];
        }
        M += GUARD_STRIP;
        below += GUARD_STRIP;
    }
    for (size_t a = 0U; a < GUARD_TWO; a++) {
        y[a] += sum[a];
    }
}

static inline void mul_t_strip(size_t width, size_t count, const blw_real_t *M, const blw_real_t *x,
                               const blw_real_t *from, blw_real_t *to)
{
    blw_real_t x_rows[GUARD_STRIP] = {BLW_R(0.0)};

    for (size_t a = 0U; a < width; a++) {
        x_rows[a] = x[a];
    }
    for (size_t c = 0U; c < count; c++) {
        blw_real_t sum = M[c * width] * x_rows[0];

        for (size_t a = 1U; a < width; a++) {
            sum += M[(c * width) + a] * x_rows[a];
        }
        to[c] = from[c] + sum;
    }
}

static inline void mul_t_two(size_t count, const blw_real_t *M, const blw_real_t *below,
                             const blw_real_t *x, const blw_real_t *from, blw_real_t *to)
{
    blw_real_t x_rows[GUARD_TWO];

    for (size_t a = 0U; a < GUARD_TWO; a++) {
        x_rows[a] = x[a];
    }
    for (size_t c = 0U; c < count; c++) {
        blw_real_t upper = M[0] * x_rows[0];
        blw_real_t lower = below[0] * x_rows[GUARD_STRIP];

        for (size_t a = 1U; a < GUARD_STRIP; a++) {
            upper += M[a] * x_rows[a];
            lower += below[a] * x_rows[GUARD_STRIP + a];
        }
        to[c] = (from[c] + upper) + lower;
        M += GUARD_STRIP;
        below += GUARD_STRIP;
    }
}

static inline void both_strip(size_t width, size_t count, const blw_real_t *M,
                              const blw_real_t *x_rows, const blw_real_t *x_cols,
                              blw_real_t *y_rows, blw_real_t *y_cols)
{
    blw_real_t x[GUARD_STRIP]   = {BLW_R(0.0)};
    blw_real_t sum[GUARD_STRIP] = {BLW_R(0.0)};

    for (size_t a = 0U; a < width; a++) {
        x[a] = x_rows[a];
    }
    for (size_t c = 0U; c < count; c++) {
        blw_real_t back = y_cols[c];

        for (size_t a = 0U; a < width; a++) {
            sum[a] += M[(c * width) + a] * x_cols[c];
            back += M[(c * width) + a] * x[a];
        }
        y_cols[c] = back;
    }
    for (size_t a = 0U; a < width; a++) {
        y_rows[a] += sum[a];
    }
}

static inline void both_two(size_t count, const blw_real_t *M, const blw_real_t *below,
                            const blw_real_t *x_rows, const blw_real_t *x_cols, blw_real_t *y_rows,
                            blw_real_t *y_cols)
{
    blw_real_t x[GUARD_TWO];
    blw_real_t sum[GUARD_TWO] = {BLW_R(0.0)};

    for (size_t a = 0U; a < GUARD_TWO; a++) {
        x[a] = x_rows[a];
    }
    for (size_t c = 0U; c < count; c++) {
        const blw_real_t x_c  = x_cols[c];
        blw_real_t       back = y_cols[c];

        for (size_t a = 0U; a < GUARD_STRIP; a++) {
            sum[a] += M[a] * x_c;
            back += M[a] * x[a];
        }
        for (size_t a = 0U; a < GUARD_STRIP; a++) {
            sum[GUARD_STRIP + a] += below[a] * x_c;
            back += below[a] * x[GUARD_STRIP + a];
        }
        y_cols[c] = back;
        M += GUARD_STRIP;
        below += GUARD_STRIP;
    }
    for (size_t a = 0U; a < GUARD_TWO; a++) {
        y_rows[a] += sum[a];
    }
}

void blw_guard_mul(size_t rows, size_t cols, size_t first, size_t count, const blw_real_t *M,
                   const blw_real_t *x, blw_real_t *y)
{
    const size_t skip = first * GUARD_STRIP;
    size_t       a    = 0U;

    for (; (BLW_AT_ONCE != 0) && ((a + GUARD_TWO) <= rows); a += GUARD_TWO) {
        mul_two(count, &M[(a * cols) + skip], &M[((a + 3U) * cols) + skip], x, &y[a]);
    }
    for (; a < rows; a += GUARD_STRIP) {
        const size_t            width = width_of(rows - a);
        const blw_real_t *const strip = &M[(a * cols) + (first * width)];

        if (width == 3U) {
            mul_strip(3U, count, strip, x, &y[a]);
        } else if (width == 2U) {
            mul_strip(2U, count, strip, x, &y[a]);
        } else {
            mul_strip(1U, count, strip, x, &y[a]);
        }
    }
}

void blw_guard_mul_t(size_t rows, size_t cols, size_t first, size_t count, const blw_real_t *M,
                     const blw_real_t *x, const blw_real_t *from, blw_real_t *to)
{
    const size_t      skip  = first * GUARD_STRIP;
    const blw_real_t *start = from;
    size_t            a     = 0U;

    for (; (BLW_AT_ONCE != 0) && ((a + GUARD_TWO) <= rows); a += GUARD_TWO) {
        mul_t_two(count, &M[(a * cols) + skip], &M[((a + 3U) * cols) + skip], &x[a], start, to);
        start = to;
    }
    for (; a < rows; a += GUARD_STRIP) {
        const size_t            width = width_of(rows - a);
        const blw_real_t *const strip = &M[(a * cols) + (first * width)];

        if (width == 3U) {
            mul_t_strip(3U, count, strip, &x[a], start, to);
        } else if (width == 2U) {
            mul_t_strip(2U, count, strip, &x[a], start, to);
        } else {
            mul_t_strip(1U, count, strip, &x[a], start, to);
        }
        start = to;
    }
}

void blw_guard_both(size_t rows, size_t cols, const blw_real_t *M, const blw_real_t *x_rows,
                    const blw_real_t *x_cols, blw_real_t *y_rows, blw_real_t *y_cols)
{
    size_t a = 0U;

    for (; (BLW_AT_ONCE != 0) && ((a + GUARD_TWO) <= rows); a += GUARD_TWO) {
        both_two(cols, &M[a * cols], &M[(a + 3U) * cols], &x_rows[a], x_cols, &y_rows[a], y_cols);
    }
    for (; a < rows; a += GUARD_STRIP) {
        const size_t            width = width_of(rows - a);
        const blw_real_t *const strip = &M[a * cols];

        if (width == 3U) {
            both_strip(3U, cols, strip, &x_rows[a], x_cols, &y_rows[a], y_cols);
        } else if (width == 2U) {
            both_strip(2U, cols, strip, &x_rows[a], x_cols, &y_rows[a], y_cols);
        } else {
            both_strip(1U, cols, strip, &x_rows[a], x_cols, &y_rows[a], y_cols);
        }
    }
}
