/* SPDX-License-Identifier: MIT */
/** @file l1_work.h  Included in front of every module of the l1 fusion: calls of the dense kernels,
 *  and the elements they go through, are counted for l1_work.c. */
#ifndef L1_WORK_H
#define L1_WORK_H
#include "blw_la.h"

/** Kernels that are counted, in the order of KERNELS in l1_work.py. */
enum l1_kernel {
    L1_DOT,
    L1_AXPY,
    L1_MOVE,
    L1_GEMV,
    L1_SYMV,
    L1_TRAPV,
    L1_TRAPV_T,
    L1_SOLVE,
    L1_NORM,
    L1_FACTOR,
    L1_MATRIX,
    L1_KERNELS
};

typedef struct l1_work {
    uint32_t calls;
    uint32_t elements;
} l1_work_t;

extern l1_work_t l1_work[L1_KERNELS];

static inline void l1_count(enum l1_kernel kernel, size_t elements)
{
    l1_work[kernel].calls++;
    l1_work[kernel].elements += (uint32_t)elements;
}

#define blw_la_dot(n, a, b)        (l1_count(L1_DOT, n), blw_la_dot(n, a, b))
#define blw_la_axpy(n, a, x, y)    (l1_count(L1_AXPY, n), blw_la_axpy(n, a, x, y))
#define blw_la_copy(n, x, y)       (l1_count(L1_MOVE, n), blw_la_copy(n, x, y))
#define blw_la_fill(n, value, x)   (l1_count(L1_MOVE, n), blw_la_fill(n, value, x))
#define blw_la_gemv(r, c, A, x, y) (l1_count(L1_GEMV, (r) * (c)), blw_la_gemv(r, c, A, x, y))
#define blw_la_gemv_add(r, c, A, x, y) \
    (l1_count(L1_GEMV, (r) * (c)), blw_la_gemv_add(r, c, A, x, y))
#define blw_la_symv(n, S, x, y) (l1_count(L1_SYMV, (n) * (n)), blw_la_symv(n, S, x, y))
#define blw_la_trapv(N, d, Z, x, y) \
    (l1_count(L1_TRAPV, blw_la_trap_row(d, N)), blw_la_trapv(N, d, Z, x, y))
#define blw_la_trapv_t(N, d, Z, x, y) \
    (l1_count(L1_TRAPV_T, blw_la_trap_row(d, N)), blw_la_trapv_t(N, d, Z, x, y))
#define blw_la_solve_lower(n, L, x) \
    (l1_count(L1_SOLVE, blw_la_packed_row(n)), blw_la_solve_lower(n, L, x))
#define blw_la_solve_lower_t(n, L, x) \
    (l1_count(L1_SOLVE, blw_la_packed_row(n)), blw_la_solve_lower_t(n, L, x))
#define blw_la_norm(n, x) (l1_count(L1_NORM, n), blw_la_norm(n, x))

#include "blw_l1_internal.h" /* its inline functions count, its declarations stay */

#define blw_l1_factor(l1, f, size, share) \
    (l1_count(L1_FACTOR, ((size) * (size) * (size)) / 6U), \
     l1_count(L1_MATRIX, blw_la_packed_row(size)), blw_l1_factor(l1, f, size, share))

#endif
