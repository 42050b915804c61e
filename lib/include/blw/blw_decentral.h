/* SPDX-License-Identifier: MIT */
/** @file blw_decentral.h  One Kalman filter per sensor, a chi-square test and a search over the
 *  sets of sensors that may be attacked: method `decentral` [D].
 *
 *  Sensor i observes z_i = Z_i' x (mu_i numbers, mu in all).  Its filter runs on the innovations of
 *  the fused estimate: with x_bar = A x_hat(k-1) + Bu u(k-1) and delta_i = z_i - Z_i' x_bar,
 *      delta_i(k) = F_i delta_i + K_i nu_i,   nu_i = y_i - offset_i - C_i x_bar               (1)
 *      x_hat = x_bar + Psi delta,   delta := delta - Phi Psi delta                            (2)
 *  are (10) and (24) of [D] at noise size, whatever the operating point.  A missing sample has
 *  nu_i = 0: its filter coasts on the prediction.  With w = N delta, white without attack,
 *      g = |w|^2 ~ chi2(mu - n)                                                               (3)
 *  is held against its threshold.  If it fails, the sensors e whose removal leaves the most
 *  plausible g_J (largest survival probability, J = all others) are left out: with q_i = Q_i' w,
 *      g_J = |w|^2 - |t|^2,   x_J = x_bar + Psi delta - sum_i Y_i s_i                         (4)
 *  where t and s follow from the q_i of e (tools/blw/decentral_fusion.py).  Neither depends on
 *  delta_e, which is set to 0 for (4): an attack of any size leaves no rounding error behind.
 *
 *  Excluded sensors come back after `readmit` consecutive steps in which all sensors together pass;
 *  a sensor that is missing for longer than `max_gap` steps is left out until then, too.  A filter
 *  forgets an attack only with its own poles.  Reseeding replaces its state by the estimate of it,
 *      z_i := Z_i' x_J + E(z_i - Z_i' x | z_J - Phi_J x_J)  or  delta_i := -R_i^-1 s_i,       (5)
 *  after which all sensors together have the statistic of J.  (Z_i' x_J alone would not do: the
 *  errors of all local filters stem from the same process noise, and the test knows that.)
 *  With recursive gains P is propagated as a square root P = L L' from P0, factored on the device.
 */
#ifndef BLW_DECENTRAL_H
#define BLW_DECENTRAL_H
#include "blw/blw_estimator.h"
#ifdef __cplusplus
extern "C" {
#endif

/** Sets of sensors that can be left out.  Set 0 is empty; a set's parent lacks its last sensor and
 *  has a smaller number. */
typedef struct blw_decentral_sets {
    uint16_t        n_sets;       /**< >= 1 */
    uint16_t        n_candidates; /**< sets that the search compares; 0 if p = 0 */
    const uint16_t *parent;       /**< [n_sets], parent[0] = 0 */
    const uint16_t *sensor;       /**< [n_sets] the last sensor; growing from parent to child */
    const uint16_t *candidate;    /**< [n_candidates] their numbers; NULL if there is none */
} blw_decentral_sets_t;

/** Thresholds, and the comparison of statistics that differ in their degrees of freedom: the set
 *  with the smallest g + c(g) is the most plausible one; c is linear between its knots, constant
 *  outside, and 0 if n_ranked = 0. */
typedef struct blw_decentral_ranking {
    uint16_t          n_dof;    /**< different numbers of rows that sets leave out, >= 1 */
    uint16_t          n_ranked; /**< the first so many have a c: those of the candidates */
    uint16_t          n_knots;  /**< >= 2 if n_ranked > 0 */
    const uint16_t   *removed;  /**< [n_dof] rows left out; 0 is one of them */
    const blw_real_t *thr;      /**< [n_dof] thresholds of g, > 0 */
    const blw_real_t *knots;    /**< [n_knots] growing */
    const blw_real_t *c;        /**< [n_ranked x n_knots] */
} blw_decentral_ranking_t;

/** A kind of gains.  The model holds its address, so that a firmware links only the one it uses. */
typedef struct blw_decentral_gains blw_decentral_gains_t;

/** Steady-state gains: everything factored is in tables. */
extern const blw_decentral_gains_t blw_decentral_steady_ops;
/** Gains from a recursion on the device. */
extern const blw_decentral_gains_t blw_decentral_recursive_ops;

/** Tables of steady-state gains. */
typedef struct blw_decentral_steady {
    uint16_t          d;   /**< mu - n, >= 1 */
    const blw_real_t *F;   /**< per sensor [mu_i x mu_i] (I - K_i t_i) S_i */
    const blw_real_t *K;   /**< [mu] gains */
    const blw_real_t *N;   /**< [d x mu] upper trapezoid, packed by rows */
    const blw_real_t *Psi; /**< [n x mu] */
    const blw_real_t *Q;   /**< per sensor [mu_i x min(first[i + 1], d)] */
    const blw_real_t *Y;   /**< [mu x n] */
    const blw_real_t *H;   /**< per sensor R_i^-1 of N_i = Q_i R_i, transposed, packed lower; NULL
                                unless reseed */
    const uint16_t   *at;  /**< [n_sets + 1] where the part of a set in M begins */
    const blw_real_t *M;   /**< per set whose last sensor is b: [X T], mu_b rows that grow to the
                                set's length by one number each; nothing for sets of one sensor */
} blw_decentral_steady_t;

/** Tables of gains from a recursion. */
typedef struct blw_decentral_recursive {
    const blw_real_t *S;   /**< per sensor [mu_i x mu_i] Z_i' A Z_i */
    const blw_real_t *t;   /**< [mu] C_i Z_i */
    const blw_real_t *V;   /**< [mu x n] V V' = Phi B Q B' Phi' */
    const blw_real_t *E;   /**< [m (m + 1) / 2] E E' = R, packed lower, diagonal > 0 */
    const blw_real_t *L0;  /**< [mu x n] L0 L0' = Phi P0 Phi' */
    const blw_real_t *Psi; /**< [n x mu] steady-state fusion, until L can be inverted */
} blw_decentral_recursive_t;

typedef struct blw_decentral_model {
    blw_model_t                      head;
    uint16_t                         mu;      /**< local states of all sensors, > n */
    uint16_t                         rows;    /**< local states of the largest set */
    uint16_t                         warm_up; /**< steps without a test, while P0 decays */
    uint16_t                         readmit; /**< passes in a row for readmission; 0: never */
    uint16_t                         max_gap; /**< missing steps until a sensor is left out, >= 1 */
    uint8_t                          reseed;  /**< 1: an excluded sensor that tells the truth again
                                                   gets a new delta_i, see (5) */
    const uint16_t                  *first;   /**< [m + 1] first row of every sensor, then mu */
    const blw_real_t                *Phi;     /**< [mu x n] stacked Z_i' */
    const blw_real_t                *scale;   /**< [m] nu_i to 1 at its own threshold, > 0 */
    const blw_decentral_sets_t      *sets;
    const blw_decentral_ranking_t   *ranking;
    const blw_decentral_gains_t     *gains;
    const blw_decentral_steady_t    *steady; /**< the tables of those gains, the other one NULL */
    const blw_decentral_recursive_t *recursive;
} blw_decentral_model_t;

/** Estimator state.  The caller owns it; the members are private. */
typedef struct blw_decentral {
    blw_estimator_t              base;
    const blw_decentral_model_t *model;
    blw_real_t                  *x_hat;     /* [n] */
    blw_real_t                  *x_bar;     /* [n] */
    blw_real_t                  *dx;        /* [n] x_hat - x_bar */
    blw_real_t                  *nu;        /* [m] innovations */
    blw_real_t                  *gap;       /* [m] steps missing in a row, to max_gap: small
                                               integers, exact in blw_real_t */
    blw_real_t                  *suspicion; /* [m] */
    blw_real_t                  *delta;     /* [mu] */
    blw_real_t                  *z;         /* [mu] delta without the excluded sensors */
    blw_real_t                  *w;         /* [d]; recursive: [mu + n + m] */
    blw_real_t                  *t;         /* [rows]; recursive: unused */
    blw_real_t                  *L;         /* recursive: [mu (mu + 1) / 2]; NULL otherwise */
    blw_real_t                  *X;         /* recursive: [mu x (mu + n + m)]; NULL otherwise */
    uint32_t                     k;         /* steps since the reset, to warm_up + 1 */
    uint16_t                     set;       /* set left out */
    uint16_t                     passes;    /* of all sensors together, in a row */
    uint16_t                     calm;      /* steps in a row without suspicion of excluded ones */
    bool                         usable;    /* recursive: L can be inverted */
} blw_decentral_t;

/** Numbers of memory for the work of either kind of gains. */
#define BLW_DECENTRAL_WORK_STEADY(n, mu, rows) (((size_t)(mu) - (size_t)(n)) + (size_t)(rows))
#define BLW_DECENTRAL_WORK_RECURSIVE(n, m, mu) \
    ((((size_t)(mu) * ((size_t)(mu) + 1U)) / 2U) \
     + (((size_t)(mu) + 1U) * ((size_t)(mu) + (size_t)(n) + (size_t)(m))))

/** Number of blw_real_t that init() needs; recursive = 1 for recursive gains, else 0. */
#define BLW_DECENTRAL_MEM(n, m, mu, rows, recursive) \
    ((3U * ((size_t)(n) + (size_t)(m))) + (2U * (size_t)(mu)) \
     + (((recursive) != 0) ? BLW_DECENTRAL_WORK_RECURSIVE((n), (m), (mu)) \
                           : BLW_DECENTRAL_WORK_STEADY((n), (mu), (rows))))

/** As blw_estimator_ops.init. */
blw_status_t blw_decentral_init(blw_decentral_t *self, const blw_decentral_model_t *model,
                                blw_real_t *mem, size_t mem_len);
/** As blw_estimator_ops.reset: as if no sensor had ever been suspected. */
blw_status_t blw_decentral_reset(blw_decentral_t *self, const blw_real_t *x0);
/** As blw_estimator_ops.step.  statistic is g of all sensors, `excluded` the set left out,
 *  iterations the sets compared.  BLW_OUTCOME_HELD: the best set fails its test, too, or the chosen
 *  one does in a step without any sample, which is no reason to choose again.
 *  n (n + l) + m n + sum mu_i^2 + d mu - d^2 / 2 + 2 n mu multiply-adds with steady gains and
 *  nothing suspicious; about n_candidates (d mu - d^2 / 2 + d rows) more in a search. */
blw_status_t blw_decentral_step(blw_decentral_t *self, const blw_real_t *u, const blw_real_t *y,
                                blw_mask_t valid, blw_estimator_out_t *out);

/** The same through blw_estimator_t. */
extern const blw_estimator_ops_t blw_decentral_ops;
#ifdef __cplusplus
}
#endif
#endif
