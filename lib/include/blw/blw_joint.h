/* SPDX-License-Identifier: MIT */
/** @file blw_joint.h  State and injected signal together, with the help of strong sensors: method
 *  `joint` [J].
 *
 *  Local estimator i combines one weak sensor, which may be attacked, with strong ones, which may
 *  not.  It estimates X_i = [x; theta_i], theta_i the signal added to the weak sensor, and
 *  phi_i(k) = theta_i(k) - theta_i(k-1):
 *      y~_i   = y_i - Ca_i (Aa X_i(k-1) + [Bu u(k-1); phi_i(k-1)])                            (1)
 *      X_i(k) = Aa X_i(k-1) + [Bu u(k-1); phi_i(k-1)] + K_i y~_i                              (2)
 *      phi_i(k) = phi_i(k-1) + Gamma_i y~_i                                                   (3)
 *  are (6) and (7) of [J] with a known input.  The states are fused by matrix weights,
 *      x_hat = sum_i G_i x_i = x_1 + sum_{i > 1} G_i (x_i - x_1),                             (4)
 *  which sum to I by construction.  All of it runs relative to the last estimate: the estimators
 *  keep delta_i = x_i - x_hat, so (1)-(4) stay at noise size whatever the operating point.
 *
 *  theta is designed for as white with the variance eta.  The gains are either a schedule from the
 *  design (entry k for step k, the last one from then on), or come from a recursion on the device:
 *  then the set of strong sensors (Remark 2 of [J]) and A, Bu, C may change in every step.
 *
 *  A missing sample leaves its innovation out of (2) and (3); the recursion accounts for it.
 *  No sensor is ever excluded for what it says.  The statistic is the largest theta_i^2 in units of
 *  its threshold, which is set by the false-alarm rate without attack.
 */
#ifndef BLW_JOINT_H
#define BLW_JOINT_H
#include "blw/blw_estimator.h"
#ifdef __cplusplus
extern "C" {
#endif

/** Gains by step.  M = first[r] counts the sensors of all local estimators. */
typedef struct blw_joint_schedule {
    uint16_t          steps;  /**< T >= 1: step k takes entry min(k, T) - 1 */
    const blw_real_t *K;      /**< [T] per estimator [(n + 2) x m_i]: rows of x, theta and phi */
    const blw_real_t *G;      /**< [T][r - 1][n x n] weights of (4); NULL if r = 1 */
    const blw_real_t *sd;     /**< [T x r] of the error of theta, > 0 */
    const blw_real_t *sd_gap; /**< [r] the same where the weak sensor's sample is missing */
} blw_joint_schedule_t;

/** Gains from a recursion on the device. */
typedef struct blw_joint_recursive {
    const blw_real_t *V;        /**< [n x n] V V' = B Q B' */
    const blw_real_t *E;        /**< [m (m + 1) / 2] E E' = R, packed lower, diagonal > 0 */
    const blw_real_t *L0;       /**< [n (n + 1) / 2] L0 L0' = P0, packed lower */
    const blw_real_t *theta_sd; /**< [r] square roots of eta, > 0 */
} blw_joint_recursive_t;

typedef struct blw_joint_model {
    blw_model_t                  head;
    uint8_t                      r;        /**< local estimators, 1..m */
    uint16_t                     warm_up;  /**< steps until the initial error has decayed */
    const uint16_t              *first;    /**< [r + 1] where the sensors of each begin, then M */
    const uint16_t              *sensor;   /**< [M] the weak sensor of each, then its partners */
    const uint16_t              *strong;   /**< [m] 1 for a strong sensor, else 0 */
    const blw_real_t            *scale;    /**< [r] theta to 1 at its threshold, > 0 */
    const blw_joint_schedule_t  *schedule; /**< one of the two, the other one NULL */
    const blw_joint_recursive_t *recursive;
} blw_joint_model_t;

/** Estimator state.  The caller owns it; the members are private. */
typedef struct blw_joint {
    blw_estimator_t          base;
    const blw_joint_model_t *model;
    blw_plant_t              plant;     /* the model's, or with A, Bu, C of the caller */
    blw_real_t              *x_hat;     /* [n] */
    blw_real_t              *x_bar;     /* [n] */
    blw_real_t              *dx;        /* [n] x_hat - x_bar */
    blw_real_t              *scratch;   /* [n] */
    blw_real_t              *nu;        /* [m] innovations of x_bar */
    blw_real_t              *suspicion; /* [m] */
    blw_real_t              *delta;     /* [r x n] */
    blw_real_t              *theta;     /* [r] */
    blw_real_t              *phi;       /* [r] */
    blw_real_t              *sd;        /* [r] */
    blw_real_t              *L;         /* recursive: packed factor; NULL otherwise */
    blw_real_t              *c;         /* recursive: [r (n + 2)]; NULL otherwise */
    blw_real_t              *X;         /* recursive: rows of errors; NULL otherwise */
    blw_real_t              *e;         /* recursive: [m] white innovations; NULL otherwise */
    blw_mask_t               strong;    /* sensors taken for strong */
    blw_mask_t               heard;     /* weak sensors whose last sample was taken in */
    uint16_t                 k;         /* steps since the reset, saturating */
} blw_joint_t;

/** What is known about the signal on one sensor. */
typedef struct blw_joint_attack {
    blw_real_t theta; /**< estimate of the signal, in the unit of the sensor */
    blw_real_t sd;    /**< its standard deviation if theta is white with the variance eta */
    bool       heard; /**< the sample of the last step was taken in; else theta is a prediction */
} blw_joint_attack_t;

/** Rows of the errors of r estimators, and the numbers that their recursion needs. */
#define BLW_JOINT_ROWS(n, r) ((size_t)(r) * ((size_t)(n) + 2U))
#define BLW_JOINT_WIDTH(n, m, r) \
    (BLW_JOINT_ROWS((n), (r)) + (2U * (size_t)(r)) + (size_t)(n) + (size_t)(m))
#define BLW_JOINT_WORK(n, m, r) \
    (((BLW_JOINT_ROWS((n), (r)) * (BLW_JOINT_ROWS((n), (r)) + 3U)) / 2U) \
     + ((BLW_JOINT_ROWS((n), (r)) + (size_t)(m)) * BLW_JOINT_WIDTH((n), (m), (r))) + (size_t)(m))

/** Number of blw_real_t that init() needs; recursive = 1 for recursive gains, else 0. */
#define BLW_JOINT_MEM(n, m, r, recursive) \
    ((4U * (size_t)(n)) + (2U * (size_t)(m)) + ((size_t)(r) * ((size_t)(n) + 3U)) \
     + (((recursive) != 0) ? BLW_JOINT_WORK((n), (m), (r)) : 0U))

/** As blw_estimator_ops.init. */
blw_status_t blw_joint_init(blw_joint_t *self, const blw_joint_model_t *model, blw_real_t *mem,
                            size_t mem_len);
/** As blw_estimator_ops.reset; strong sensors and plant are those of the model again. */
blw_status_t blw_joint_reset(blw_joint_t *self, const blw_real_t *x0);
/** As blw_estimator_ops.step.  `excluded` are the sensors that no local estimator listens to.
 *  With a schedule n (n + l) + m n + r n^2 + sum m_i (2 n + 2) + (r - 1) n^2 multiply-adds; the
 *  recursion adds about R^2 (R + 2 r + n + m) for R = r (n + 2). */
blw_status_t blw_joint_step(blw_joint_t *self, const blw_real_t *u, const blw_real_t *y,
                            blw_mask_t valid, blw_estimator_out_t *out);
/** The signal on a weak sensor.  @return BLW_OK, or BLW_ERR_ARG: a sensor without an estimator. */
blw_status_t blw_joint_get_attack(const blw_joint_t *self, size_t sensor,
                                  blw_joint_attack_t *attack);
/** Recursive gains only: the partners that may be trusted from the next step on, e.g. those that a
 *  detector has cleared.  @return BLW_OK, or BLW_ERR_ARG with nothing changed. */
blw_status_t blw_joint_set_strong(blw_joint_t *self, blw_mask_t strong);
/** Recursive gains only: A [n x n], Bu [n x l] and C [m x n] from the next step on; NULL stands for
 *  the model's.  They are read in every step until replaced.
 *  @return BLW_OK, or BLW_ERR_ARG with nothing changed if one of them is not finite. */
blw_status_t blw_joint_set_plant(blw_joint_t *self, const blw_real_t *A, const blw_real_t *Bu,
                                 const blw_real_t *C);

/** The same through blw_estimator_t. */
extern const blw_estimator_ops_t blw_joint_ops;
#ifdef __cplusplus
}
#endif
#endif
