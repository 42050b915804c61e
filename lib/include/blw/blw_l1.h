/* SPDX-License-Identifier: MIT */
/** @file blw_l1.h  Secure fusion of local estimates: the l1-penalised least squares of [L] (31).
 *
 *  With zeta = G x + mu + nu, mu ~ N(0, W) benign and nu sparse, minimise over x, mu, nu
 *      1/2 mu' W^-1 mu + sum_g c_g |nu_g|,                                                    (1)
 *  g = groups of one row (real mode) or two (complex pair).  Reduced by Z' W Z = I, Z' G = 0 to
 *      min over nu of  1/2 |Z' (zeta - nu)|^2 + sum_g c_g |nu_g|,                             (2)
 *      l = Z Z' (zeta - nu),   x_hat = F (zeta - nu),                                         (3)
 *  nu is optimal iff  |l_g| <= c_g  for all g and  l_g = c_g nu_g / |nu_g|  where nu_g /= 0.  (4)
 *
 *  Certificate: if (4) holds for nu = 0, then x_hat is exactly the Kalman estimate ([L] Theorem 3).
 *  An engine solves the rest.  Each keeps tau = zeta - nu, not nu: tau stays at noise size however
 *  large the attack, so nothing large cancels.
 *
 *  Z is lower trapezoidal, packed by rows: row i has min(i + 1, d) numbers.  Rows of a group are
 *  adjacent and scaled so that a benign l_g has unit mean square per row.
 */
#ifndef BLW_L1_H
#define BLW_L1_H
#include "blw/blw_model.h"
#ifdef __cplusplus
extern "C" {
#endif

struct blw_l1;

/** A way to solve (2).  The model holds its address: a firmware links only the one it uses. */
typedef struct blw_l1_ops blw_l1_ops_t;

/** Pivots between supports; Newton steps where groups have two rows. */
extern const blw_l1_ops_t blw_l1_active_set_ops;
/** Alternating directions, then the same solve on the support found. */
extern const blw_l1_ops_t blw_l1_admm_ops;
/** Groups of one row only: pivots on the tableau of S, verified in W. */
extern const blw_l1_ops_t blw_l1_tableau_ops;
/** Groups of one row or two: smoothed Newton steps in W. */
extern const blw_l1_ops_t blw_l1_newton_ops;

/** What a pass over the rows of the tableau found. */
typedef struct blw_l1_survey {
    size_t     best; /**< the row whose sweep gains most, or N */
    blw_real_t gain; /**< what it gains is gain / over */
    blw_real_t over; /**< > 0 */
} blw_l1_survey_t;

/** l = S zeta, tau = zeta, x = F zeta.  @return max_g |l_g| / c_g as blw_l1_larger() finds it. */
typedef blw_real_t (*blw_l1_certify_kernel_t)(const struct blw_l1 *self, const blw_real_t *zeta,
                                              blw_real_t *x);
/** y = S x for S [N x N] packed lower. */
typedef void (*blw_l1_symv_kernel_t)(const blw_real_t *S, const blw_real_t *x, blw_real_t *y);
/** Column k of the tableau T, [N]. */
typedef void (*blw_l1_column_kernel_t)(size_t k, const blw_real_t *T, blw_real_t *col);
/** self->T swept on row k, into self->L, l -= t col, and what comes next (blw_l1_survey.h); col =
 *  self->step = column k, share = 1 / T_kk. */
typedef void (*blw_l1_sweep_kernel_t)(const struct blw_l1 *self, size_t k, blw_real_t share,
                                      blw_real_t t, blw_l1_survey_t *seen);

/** A product with a matrix M, F [n x N] or G [N x n]. */
typedef void (*blw_l1_product_kernel_t)(const blw_real_t *M, const blw_real_t *v, blw_real_t *out);

/** Straight-line code for one N and n that the design tool writes: the numbers of the loops; only
 *  the sign of a zero may differ, which no sum that starts from +0 lets through. */
typedef struct blw_l1_kernels {
    blw_l1_certify_kernel_t certify;
    blw_l1_symv_kernel_t    symv;
    blw_l1_column_kernel_t  column;
    blw_l1_sweep_kernel_t   sweep;
    blw_l1_product_kernel_t fuse;    /**< out = F v */
    blw_l1_product_kernel_t spread;  /**< out = F' v */
    blw_l1_product_kernel_t predict; /**< out += G v */
    blw_l1_product_kernel_t balance; /**< out = -G' v */
} blw_l1_kernels_t;

typedef struct blw_l1_model {
    uint16_t            N;              /**< rows of zeta */
    uint16_t            d;              /**< columns of Z, N - n */
    uint16_t            n_groups;       /**< groups */
    uint16_t            max_iterations; /**< bound on pivots or passes in one solve */
    uint8_t             n;              /**< states */
    const blw_l1_ops_t *engine;         /**< one of the above */
    const uint16_t     *first;          /**< [n_groups + 1] first row of each group, then N */
    const blw_real_t   *Z;              /**< [BLW_L1_Z_LEN(N, d)] packed trapezoid; NULL without */
    const blw_real_t   *F;              /**< [n x N] */
    const blw_real_t   *c;              /**< [n_groups] thresholds, > 0 */
    const blw_real_t   *M;              /**< ADMM: [N (N + 1) / 2] (Z Z' + rho I)^-1, packed lower;
                                           newton: S with W + D for W, D = rho sqrt(W_ii) / c_g with
                                           i the first row of g; NULL otherwise */
    const blw_real_t   *S; /**< tableau, newton: [N (N + 1) / 2] Z Z', packed lower, or NULL */
    const blw_real_t   *W; /**< tableau, newton: [N (N + 1) / 2] packed lower, or NULL */
    const blw_real_t   *G; /**< tableau, newton: [N x n], or NULL */
    const blw_real_t   *P; /**< tableau, newton: [n (n + 1) / 2] F W F', packed lower, or NULL */
    const blw_l1_kernels_t *fast;    /**< all of its members for the tableau, or NULL */
    blw_real_t              rho;     /**< ADMM: penalty; newton: kappa of M; > 0; else 0 */
    blw_real_t              kappa_G; /**< error bound, see blw_l1_info_t: sum_g c_g |(G x)_g| is at
                                           least |x| / kappa_G */
    blw_real_t              kappa_W; /**< and sum_g c_g |(W Z e)_g| is at most kappa_W |e| */
} blw_l1_model_t;

/** Solver state: the support A found last, from which the next solve starts. */
typedef struct blw_l1 {
    const blw_l1_model_t *model;
    blw_real_t           *tau;    /* [N] zeta - nu */
    blw_real_t           *l;      /* [N] multipliers (3) */
    blw_real_t           *dir;    /* [N] nu_g / |nu_g| on A; scaled dual of ADMM while that runs */
    blw_real_t           *step;   /* [N] steps of tau, first rows of A, then unused */
    blw_real_t           *z;      /* [d] Z' tau */
    blw_real_t           *dz;     /* [d] Z' step */
    blw_real_t           *L;      /* packed lower: L L' = Z_A Z_A', plus curvature of pairs; or T */
    const blw_real_t     *T;      /* tableau: S while nothing was swept, then L */
    blw_real_t           *A;      /* [n_groups] groups of the support in the order of L: small
                                     integers, exact in blw_real_t; newton: |nu_g| where it is
                                     gross, else 0 */
    uint16_t              n_A;    /* groups in A */
    uint16_t              rows;   /* rows of the groups in A = order of L */
    bool                  solved; /* whether tau is the solution of the last problem */
} blw_l1_t;

typedef struct blw_l1_info {
    blw_real_t statistic;  /**< max_g |l_g| / c_g at nu = 0; the certificate holds iff it is <= 1 */
    blw_real_t gap;        /**< duality gap of what is returned */
    blw_real_t bound;      /**< on |x_hat - x*|_2: the last correction if (4) was verified, else
                                from the gap, kappa_G and kappa_W */
    uint16_t   iterations; /**< pivots or passes used */
    bool       kalman;     /**< certificate: nu = 0 */
    bool       converged;  /**< (4) was verified */
} blw_l1_info_t;

/** Length of Z: d rows that grow from 1 to d, then N - d full ones. */
#define BLW_L1_Z_LEN(N, d) \
    ((((size_t)(d) * ((size_t)(d) + 1U)) / 2U) + (((size_t)(N) - (size_t)(d)) * (size_t)(d)))

/** Most rows that the support can have: rank(Z) = d and one to exchange, or all if there are pairs,
 *  whose curvature holds them apart. */
#define BLW_L1_ROWS(N, d, n_groups) (((n_groups) == (N)) ? ((size_t)(d) + 1U) : (size_t)(N))

/** Number of blw_real_t that init() needs: engines on Z, the tableau, and Newton steps. */
#define BLW_L1_MEM_Z(N, d, n_groups) \
    ((4U * (size_t)(N)) + (2U * (size_t)(d)) + (size_t)(n_groups) \
     + ((BLW_L1_ROWS(N, d, n_groups) * (BLW_L1_ROWS(N, d, n_groups) + 1U)) / 2U))
#define BLW_L1_MEM_TABLEAU(N, d) \
    ((5U * (size_t)(N)) - (size_t)(d) \
     + ((((2U * (size_t)(N)) - (size_t)(d)) * (((2U * (size_t)(N)) - (size_t)(d)) + 1U)) / 2U))
#define BLW_L1_MEM_NEWTON(N, d, n_groups) \
    (BLW_L1_MEM_TABLEAU(N, d) + (5U * (size_t)(N)) - (size_t)(d) + (size_t)(n_groups))
/** The same, whatever the engine. */
#define BLW_L1_MEM_W(N, d, n_groups) \
    (((n_groups) == (N)) ? BLW_L1_MEM_TABLEAU(N, d) : BLW_L1_MEM_NEWTON(N, d, n_groups))
#define BLW_L1_MEM(N, d, n_groups) \
    ((BLW_L1_MEM_Z(N, d, n_groups) > BLW_L1_MEM_W(N, d, n_groups)) ? BLW_L1_MEM_Z(N, d, n_groups) \
                                                                   : BLW_L1_MEM_W(N, d, n_groups))

/** Add the tables to a walk and check dimensions, groups, signs and what the engine needs. */
blw_status_t blw_l1_check(const blw_l1_model_t *model, blw_table_check_t *check);
/** Bind a checked model and BLW_L1_MEM numbers of memory, reset. */
void blw_l1_init(blw_l1_t *self, const blw_l1_model_t *model, blw_real_t *mem);
/** Forget the support. */
void blw_l1_reset(blw_l1_t *self);
/** Solve (2) for zeta [N], finite, and write x_hat [n] of (3).  Cannot fail; a bound reached is in
 *  *info and x_hat is then the best found.  BLW_L1_Z_LEN multiply-adds twice and N n if the
 *  certificate holds; at most model->max_iterations pivots or passes otherwise. */
void blw_l1_solve(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x_hat, blw_l1_info_t *info);
/** max over the groups with a row in first..first+count-1 of (|l_g| + |nu_g|) / c_g after a solve:
 *  how far these rows are from being explained by noise; > 1 iff one of them is in the support. */
blw_real_t blw_l1_excess(const blw_l1_t *self, const blw_real_t *zeta, size_t first, size_t count);
#ifdef __cplusplus
}
#endif
#endif
