/* SPDX-License-Identifier: MIT */
/** @file blw_bank.h  Secure estimation by a bank of Kalman filters: method `bank`.
 *
 *  One filter for every set s of all sensors but p, so that one of them is free of attack:
 *      x_bar_s(k) = A x_s(k-1) + Bu u(k-1),  x_s(k) = x_bar_s + K_s (y_s(k) - C_s x_bar_s)     (1)
 *  Every subset i of s that leaves out 2 p sensors yields x from the h samples of a block alone:
 *      x_i(t) = Z_i Y_i(t),   Y_i(t) = (y_i(t), ..., y_i(t+h-1)) less the part of u           (2)
 *      q_si(t) = |x_i(t) - x_s(t)|^2,   t = k-h+1                                             (3)
 *  The set passes if for all its subsets the average of q_si is at most what it is without attack,
 *  plus epsilon: [B] Algorithm 2.  The estimate is that of the passing set with the least P_opt; if
 *  none passes the last choice is kept and the outcome is BLW_OUTCOME_HELD.  The average is
 *      exponentially weighted, and decides in every step (window = 0), or                     (4)
 *      the mean of one window of blocks, and decides at its end for the next one.             (5)
 *  So that the first steps of a gross attack do no harm, a set with an innovation (1) beyond the
 *  gate does not pass for h steps from that one on, after which (3) has held the filter that the
 *  sample reached against the block; this test is not in [B].  If none passes, and the gate speaks
 *  against the last choice, that of the sets without a gross innovation with the least averages
 *  takes its place.
 *
 *  All of it runs relative to one reference trajectory x_ref, the estimate itself: the filters keep
 *  d_s = x_s - x_ref, the blocks hold innovations of x_ref.  So the residues stay at noise size
 *  whatever the operating point, and u enters in the reference only.
 *
 *  A missing sample leaves its innovation out of (1); a block that lacks a sample of i is left out
 *  of the average (4) and counts as its benign mean in (5).  Among passing sets, those that lack
 *  fewest samples now come first.  An average stops at the ceiling, so that it recovers from any
 *  attack in a bounded number of steps.
 *
 *  Sensors that send seldom (max_gap > 0): in K and Z a sample counts for all the steps that it
 *  stands for, and a block is compared as it is, by
 *      rho = Z_i Y_i - M_i x_s(t),   M_i = sum over the samples there are of Z_ij C_i A^j      (6)
 *  in place of x_i - x_s, which it is in the mean: Z_i O_i = I.  A sensor lacks samples only when
 *  it has sent none for more than max_gap steps.
 */
#ifndef BLW_BANK_H
#define BLW_BANK_H
#include "blw/blw_estimator.h"
#ifdef __cplusplus
extern "C" {
#endif

/** Limits of the method; init refuses a model beyond them. */
#define BLW_BANK_MAX_SENSORS  8U
#define BLW_BANK_MAX_ATTACKED 2U
#define BLW_BANK_MAX_SETS     28U /* ways to leave 2 of 8 sensors out */

typedef struct blw_bank_model {
    blw_model_t       head;
    uint8_t           sets;        /**< filters, in the order of P_opt, 1..28 */
    uint8_t           subsets;     /**< different subsets, >= 1 */
    uint8_t           per_set;     /**< subsets in a set, >= 1 */
    uint8_t           horizon;     /**< h, samples in a block, >= 1 */
    uint8_t           groups;      /**< averages of a pair, >= 1; more only with a window */
    uint8_t           filtered;    /**< 1: x_s of (1) is tested and returned; 0: x_bar_s */
    uint8_t           max_gap;     /**< steps after which a sensor is silent; 0: all send always */
    uint16_t          window;      /**< blocks in a window, a multiple of groups; 0: average (4) */
    uint16_t          warm_up;     /**< step of the first test, >= horizon */
    const uint16_t   *set_mask;    /**< [sets] sensors of a set, bit i for sensor i */
    const uint16_t   *subset_mask; /**< [subsets] sensors of a subset */
    const uint16_t   *pair;        /**< [sets x per_set] the subsets of every set */
    blw_real_t        gain;        /**< weight of one block in the average, (0, 1] */
    blw_real_t        ceiling;     /**< no average rises above it, > 1 */
    const blw_real_t *K;           /**< [sets][n x size of the set] gains */
    const blw_real_t *Z;           /**< [subsets][n x h size of the subset] left inverses */
    const blw_real_t *scale;       /**< [sets x per_set] 1 / threshold of the average, > 0 */
    const blw_real_t *start;       /**< [sets x per_set] benign mean of q times scale, 0..1 */
    const blw_real_t *gate;        /**< [sets][size of the set] 1 / largest innovation^2, > 0 */
} blw_bank_model_t;

/** Estimator state.  The caller owns it; the members are private. */
typedef struct blw_bank {
    blw_estimator_t         base;
    const blw_bank_model_t *model;
    blw_real_t             *x_hat;     /* [n] what is returned */
    blw_real_t             *x_ref;     /* [n] the reference */
    blw_real_t             *x_bar;     /* [n] its prediction */
    blw_real_t             *scratch;   /* [2 n] */
    blw_real_t             *d;         /* [sets x n] x_s - x_ref */
    blw_real_t             *past_d;    /* [h][sets x n] tested estimates less x_bar */
    blw_real_t             *past_e;    /* [h][m] innovations of the reference */
    blw_real_t             *past_move; /* [h][n] x_ref - x_bar */
    blw_real_t             *block;     /* [h x m] samples less those of an unmoved reference */
    blw_real_t             *x_fir;     /* [subsets x n] x_i - x_ref at the start of the block */
    blw_real_t             *response;  /* [subsets][n x n] M of (6); only with max_gap */
    blw_real_t             *average;   /* [sets x per_set x groups] of q times scale */
    blw_real_t             *worst;     /* [sets] largest average at the last decision */
    blw_real_t             *gross;     /* [sets] largest innovation^2 of this step, gated */
    blw_real_t             *suspicion; /* [m] */
    uint16_t                k;         /* steps so far, at most warm_up */
    uint16_t                blocks;    /* in the running window */
    uint8_t                 newest;    /* slot of step k in past_... */
    uint8_t                 choice;    /* the set that is returned */
    bool                    decided;   /* at least once since reset */
    uint8_t                 age[BLW_BANK_MAX_SENSORS]; /* samples since the last gap, at most h */
    uint8_t                 silent[BLW_BANK_MAX_SENSORS]; /* steps since the last sample, or 255 */
    uint8_t                 wait[BLW_BANK_MAX_SETS];      /* steps that a gate keeps the set out */
} blw_bank_t;

/** Number of blw_real_t that init() needs; averages = sets x per_set x groups, seldom = 1 with
 *  max_gap > 0, else 0. */
#define BLW_BANK_MEM(n, m, sets, subsets, averages, horizon, seldom) \
    (((size_t)(horizon) * (((size_t)(sets) * (size_t)(n)) + (2U * (size_t)(m)) + (size_t)(n))) \
     + (((size_t)(sets) + (size_t)(subsets) + 5U) * (size_t)(n)) + (size_t)(averages) \
     + (2U * (size_t)(sets)) + (size_t)(m) \
     + ((size_t)(seldom) * (size_t)(subsets) * (size_t)(n) * (size_t)(n)))

/** As blw_estimator_ops.init. */
blw_status_t blw_bank_init(blw_bank_t *self, const blw_bank_model_t *model, blw_real_t *mem,
                           size_t mem_len);
/** As blw_estimator_ops.reset. */
blw_status_t blw_bank_reset(blw_bank_t *self, const blw_real_t *x0);
/** As blw_estimator_ops.step.  out->statistic is what speaks most against any set, so it exceeds
 *  out->threshold = 1 as long as a set fails; a sensor's suspicion comes from the best set that
 *  holds it.  Every set leaves p sensors out, but out->excluded holds only those that no passing
 *  set holds, or with BLW_OUTCOME_HELD those that the last choice leaves out.
 *  With s = |set|, theta = |subset|, the same whatever the data:
 *      n (n + l + m) + sum over sets (n n + 2 s (n + 1)) + h n (n + m) + sum over subsets h n theta
 *      + sets per_set (n + 2) multiply-adds;
 *  with max_gap > 0 also  subsets h (n n n + theta n n) + sets per_set n n. */
blw_status_t blw_bank_step(blw_bank_t *self, const blw_real_t *u, const blw_real_t *y,
                           blw_mask_t valid, blw_estimator_out_t *out);

/** The same through blw_estimator_t. */
extern const blw_estimator_ops_t blw_bank_ops;
#ifdef __cplusplus
}
#endif
#endif
