/* SPDX-License-Identifier: MIT */
/** @file blw_guard_strips.h  Private: products with matrices in strips.
 *
 *  A strip of three rows loads every x once for three sums, and the symmetric product loads every
 *  entry of S once for both of its places.  M [rows x cols]; a product takes `count` of its columns
 *  from `first` on.
 */
#ifndef BLW_GUARD_STRIPS_H
#define BLW_GUARD_STRIPS_H
#include "blw/blw_real.h"

/** Rows of a strip. */
#define GUARD_STRIP 3U

/** y [rows] += M x [count] */
void blw_guard_mul(size_t rows, size_t cols, size_t first, size_t count, const blw_real_t *M,
                   const blw_real_t *x, blw_real_t *y);
/** to [count] = from + M' x [rows]; rows >= 1 */
void blw_guard_mul_t(size_t rows, size_t cols, size_t first, size_t count, const blw_real_t *M,
                     const blw_real_t *x, const blw_real_t *from, blw_real_t *to);
/** y_rows += M x_cols, y_cols += M' x_rows, all columns. */
void blw_guard_both(size_t rows, size_t cols, const blw_real_t *M, const blw_real_t *x_rows,
                    const blw_real_t *x_cols, blw_real_t *y_rows, blw_real_t *y_cols);

#endif
