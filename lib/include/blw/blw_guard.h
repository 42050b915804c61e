/* SPDX-License-Identifier: MIT */
/** @file blw_guard.h  Method `guard`: secure fusion with one penalty per sensor.
 *
 *  The modes of A inside a circle of radius 0.9 forget by themselves; only the others, x_u of
 *  x = Xu x_u + Xs x_s, need secure fusion.  Per sensor a local filter of r states with the poles
 *  of A - K C A runs on the innovation about a reference x_ref, which follows the estimate:
 *      x_bar = A x_ref + Bu u,   e_i = Lam_i eta_i + b_i (y_i - offset_i - C_i x_bar)         (1)
 *  Without attack e = Gu d_u + noise, d_u = x_u less that of x_bar, and the multipliers l = S e
 *  are N(0, S).  Coordinates are chosen per sensor such that S_ii = diag(I, 0); the zeros are
 *  directions that no other sensor can check.  Fusion: minimise over the attacks nu
 *      1/2 (e - nu)' S (e - nu) + sum_i k_i |nu_i|,   k_i = k, or 0 if sensor i is excluded    (2)
 *      tau = e - nu,   l = S tau,   h_i = l_i + nu_i,   nu_i = (1 - k_i / |h_i|)_+ h_i         (3)
 *      d_u = Fu tau,   x_s = Sig l,   x_ref = x_bar + Xu d_u,   x_hat = x_ref + Xs x_s         (4)
 *      eta = e - Gu d_u                                                                     (5)
 *  Certificate: if |l_i| <= k for all i at nu = 0, x_hat is exactly the Kalman estimate.  Else (3)
 *  is solved sensor by sensor, the largest change first: no step size, no factorisation.  Then the
 *  units (sensors, or groups that fall together) with |h_i| > exclude, at most p, the largest
 *  first, get k_i = 0 and (2) is solved on from there: their samples then have no influence at all.
 *  As soon as it is beyond doubt which units these will be, the first descent ends.  If that leaves
 *  another sensor with nu_i /= 0, and the model asks for it, all sets I of p units are searched for
 *  the one whose removal explains most, l_I' S_II^-1 l_I.  (Or whenever a unit is excluded, and
 *  then the first choice stands unless another set explains k^2 / 4 more.)
 *
 *  A missing sample is replaced by its prediction from the last estimate.  docs/guard.md derives
 *  all of this; tools/blw/guard.py makes the tables.
 *
 *  Strips: a matrix [rows x cols] is stored three rows at a time (the last strip may have fewer),
 *  each strip by columns.
 */
#ifndef BLW_GUARD_H
#define BLW_GUARD_H
#include "blw/blw_estimator.h"
#ifdef __cplusplus
extern "C" {
#endif

/** How (2) is solved: each model names one of these, and only that one is linked. */
typedef struct blw_guard_solver blw_guard_solver_t;

/** For p = 1, with pairs: one sensor after the other. */
extern const blw_guard_solver_t blw_guard_one_ops;
/** For everything: some sensors together, Newton steps on them, and the search. */
extern const blw_guard_solver_t blw_guard_many_ops;

/* Straight-line code that the design tool writes for small models: the same bits as the loops. */

/** x_bar and e of (1) from u [l], y [m], all valid, x_ref and eta.  @return false with nothing
 *  changed unless u, y and x_ref are so small that no bound and no range can be exceeded, which
 *  also refuses NaN. */
typedef bool (*blw_guard_advance_kernel_t)(const blw_real_t *u, const blw_real_t *y,
                                           const blw_real_t *x_ref, const blw_real_t *eta,
                                           blw_real_t *x_bar, blw_real_t *e);
/** l = S tau; S as in the model, also below: code that reads the table needs no copy of it. */
typedef void (*blw_guard_multiply_kernel_t)(const blw_real_t *S, const blw_real_t *tau,
                                            blw_real_t *l);
/** squares [m] = |l_i|^2 */
typedef void (*blw_guard_squares_kernel_t)(const blw_real_t *l, blw_real_t *squares);
/** average += gain (l - average), squares [m] = |average_i|^2 */
typedef void (*blw_guard_average_kernel_t)(const blw_real_t *l, blw_real_t *average,
                                           blw_real_t *squares);
/** x_ref of (4) and eta of (5). */
typedef void (*blw_guard_fuse_kernel_t)(const blw_real_t *tau, const blw_real_t *e,
                                        const blw_real_t *x_bar, blw_real_t *x_ref,
                                        blw_real_t *eta);
/** l_j += S_ji step for all sensors j but i. */
typedef void (*blw_guard_move_kernel_t)(const blw_real_t *S, size_t i, const blw_real_t *step,
                                        blw_real_t *l);

typedef struct blw_guard_model {
    blw_model_t       head;
    uint8_t           r;           /**< local states per sensor, >= 1 */
    uint8_t           reach;       /**< diagonals of Lam_i below the main one, and numbers of b_i,
                                        1..r */
    uint8_t           n_u;         /**< modes fused securely, 0..n; n_s = n - n_u */
    uint8_t           n_units;     /**< units, p < n_units <= m */
    uint8_t           most;        /**< sensors that may move in one Newton step, those of
                                        the p largest units at least, >= 1 */
    uint8_t           search;      /**< 1: search the sets of p units when exclusion fails, 2: and
                                        whenever a unit is excluded */
    uint8_t           pairs;       /**< 1: V and s are there; needs p = 1 or 2 and n_units = m */
    uint16_t          max_updates; /**< bound on block updates in one step, >= 1; joint steps count
                                        as several */
    uint16_t          warm_up;     /**< steps after reset without exclusion */
    const uint16_t   *unit;        /**< [m] the sensor's unit */
    const uint16_t   *rank;        /**< [m] ones in S_ii, the first of its diagonal */
    const blw_real_t *Lam;     /**< [m][r x r] by rows, each from `reach` left of the diagonal */
    const blw_real_t *b;       /**< [m][reach], the rest of b_i is 0; N = m r */
    const blw_real_t *S;       /**< for i = 1..m-1 [r x i r] in strips: S below its diagonal */
    const blw_real_t *V;       /**< [m][m-1][r x r] for sensor i and every other j */
    const blw_real_t *s;       /**< [m][m-1][r]  V'diag(s) V = S_ii - S_ij S_ji; NULL without
                                        pairs, as V */
    const blw_real_t *Fu;      /**< [n_u x N] in strips; NULL if n_u = 0 */
    const blw_real_t *Gu;      /**< [n_u x N] Gu' in strips; NULL if n_u = 0 */
    const blw_real_t *Xu;      /**< [n x n_u]; NULL if n_u is 0 or n, where it is I */
    const blw_real_t *Xs;      /**< [n x n_s]; NULL if n_s = 0 */
    const blw_real_t *Sig;     /**< [n_s x N] in strips; NULL if n_s = 0 */
    const blw_real_t *effect;  /**< [m] largest change of x_hat by a change of tau_i, |.|_2 */
    const blw_real_t *drift;   /**< [m] largest benign |average of l_i|, > 0 */
    blw_real_t        k;       /**< threshold on |l_i|, > 0 */
    blw_real_t        exclude; /**< threshold on |h_i|, >= k */
    blw_real_t        gross;   /**< limit on |e_i|, beyond which tau_i starts from 0, > 0 */
    blw_real_t        gain;    /**< of the exponentially weighted average of l_i, (0, 1] */
    blw_real_t        kappa;   /**< |Xu x| <= kappa sum_i |Gu_i x|, whatever p units are left
                                        out of the sum; 0 if there is no such number */
    blw_real_t        omega;   /**< sum_i |(W z)_i| <= omega |z' S^+ z|^(1/2) for z in range S */
    blw_real_t        sigma;   /**< |Xs Sig l| <= sigma |l' S^+ l|^(1/2) */
    const blw_guard_solver_t   *solver;  /**< one of the above */
    blw_guard_advance_kernel_t  advance; /**< as the next five may be NULL */
    blw_guard_multiply_kernel_t multiply;
    blw_guard_squares_kernel_t  squares;
    blw_guard_average_kernel_t  average;
    blw_guard_fuse_kernel_t     fuse;
    blw_guard_move_kernel_t     move;
} blw_guard_model_t;

/** Estimator state.  The caller owns it; the members are private. */
typedef struct blw_guard {
    blw_estimator_t          base;
    const blw_guard_model_t *model;
    blw_real_t              *eta;       /* [N] between steps: (5); within a step: tau */
    blw_real_t              *e;         /* [N] (1) */
    blw_real_t              *l;         /* [N] (3) */
    blw_real_t              *average;   /* [N] of l */
    blw_real_t              *h;         /* [m] |h_i| */
    blw_real_t              *suspicion; /* [m] */
    blw_real_t              *x_bar;     /* [n] */
    blw_real_t              *x_ref;     /* [n] */
    blw_real_t              *x_hat;     /* [n] */
    blw_real_t              *d;         /* [n] d_u, then x_s */
    blw_real_t              *step;      /* [most r] change of tau */
    blw_real_t              *turned;    /* [4 r] of one sensor, also in the coordinates of V */
    blw_real_t              *L;         /* packed lower: factor of a part of S */
    blw_mask_t               all;       /* every sensor */
    blw_mask_t               attacked;  /* sensors with nu_i /= 0 */
    blw_mask_t               excluded;  /* sensors with k_i = 0 */
    uint16_t                 updates;   /* block updates in this step */
    uint16_t                 warm_up;   /* steps left without exclusion */
} blw_guard_t;

/** Number of blw_real_t that init() needs; most as in the model. */
#define BLW_GUARD_MEM(n, m, r, most) \
    ((4U * (size_t)(m) * (size_t)(r)) + (2U * (size_t)(m)) + (4U * (size_t)(n)) \
     + (4U * (size_t)(r)) \
     + (((size_t)(most) * (size_t)(r) * (((size_t)(most) * (size_t)(r)) + 3U)) / 2U))

/** As blw_estimator_ops.init. */
blw_status_t blw_guard_init(blw_guard_t *self, const blw_guard_model_t *model, blw_real_t *mem,
                            size_t mem_len);
/** As blw_estimator_ops.reset. */
blw_status_t blw_guard_reset(blw_guard_t *self, const blw_real_t *x0);
/** As blw_estimator_ops.step.  out->statistic = max_i |l_i| at nu = 0 (after a gross
 *  attack max_i |h_i|, where tau_i = 0 for the sensors that it has reached), out->threshold = k; a
 *  sensor's suspicion is from |h_i| / k, or from the slow average of l_i if that is larger.
 *  Without attack N^2 + 2 N n + N (r + n_u) multiply-adds at most; every block update adds N r, and
 *  N^2 are added once or twice where an attack is gross. */
blw_status_t blw_guard_step(blw_guard_t *self, const blw_real_t *u, const blw_real_t *y,
                            blw_mask_t valid, blw_estimator_out_t *out);

/** The same through blw_estimator_t. */
extern const blw_estimator_ops_t blw_guard_ops;
#ifdef __cplusplus
}
#endif
#endif
