/* SPDX-License-Identifier: MIT */
/** @file blw_estimator.h  One small interface over all methods.
 *
 *  A node or a simulator holds any method through a const table of functions; firmware that uses
 *  one method may call its own header instead, which does the same without the indirection.
 *  The state of every method starts with a blw_estimator_t, so a pointer to it is a pointer to the
 *  state (MISRA C:2012 deviation D-1).  Reentrant: all that changes is in *self and its memory.
 */
#ifndef BLW_ESTIMATOR_H
#define BLW_ESTIMATOR_H
#include "blw/blw_model.h"
#ifdef __cplusplus
extern "C" {
#endif

/** How the estimate of one step came about. */
typedef enum blw_outcome {
    BLW_OUTCOME_KALMAN    = 0, /**< nothing suspicious: exactly the estimate of all used samples */
    BLW_OUTCOME_CONVERGED = 1, /**< a secure estimate, computed to the end */
    BLW_OUTCOME_BOUND     = 2, /**< the bound on work was reached; see blw_estimator_out_t.bound */
    BLW_OUTCOME_HELD      = 3  /**< no hypothesis passed its test: the last choice was kept */
} blw_outcome_t;

/** Reservations about one step; any number of them. */
#define BLW_FLAG_MISSING    0x01U /**< at least one sample was missing and replaced by prediction */
#define BLW_FLAG_DEGRADED   0x02U /**< more than p sensors missing or excluded at once */
#define BLW_FLAG_BLIND      0x04U /**< no sample could be used: the estimate is a prediction */
#define BLW_FLAG_WARMING_UP 0x08U /**< the initial error has not decayed yet */
#define BLW_FLAG_AMBIGUOUS  0x10U /**< the minimiser need not be unique */

/** Result of one step.  The arrays belong to the estimator and hold until its next call. */
typedef struct blw_estimator_out {
    const blw_real_t *x_hat;      /**< [n] the estimate, in the units of the model */
    const blw_real_t *suspicion;  /**< [m] s/(1+s), s = the sensor's statistic over its threshold:
                                       0 = none, 1/2 = at the threshold, towards 1 = sure; 1 for a
                                       sensor whose sample is missing */
    blw_real_t        statistic;  /**< what decided between BLW_OUTCOME_KALMAN and the rest */
    blw_real_t        threshold;  /**< what it was held against; 0 if the method has no test */
    blw_real_t        bound;      /**< on |x_hat - what the method would return with unlimited work|
                                       or a radius on |x - x_hat| where the method certifies one */
    blw_mask_t        excluded;   /**< sensors the estimate does not use */
    blw_mask_t        used;       /**< samples that were taken in (valid, finite, inside range) */
    uint16_t          iterations; /**< of the method's solver; 0 with BLW_OUTCOME_KALMAN */
    uint8_t           outcome;    /**< blw_outcome_t */
    uint8_t           flags;      /**< BLW_FLAG_... */
} blw_estimator_out_t;

typedef struct blw_estimator_ops blw_estimator_ops_t;

/** First member of the state of every method. */
typedef struct blw_estimator {
    const blw_estimator_ops_t *ops;
} blw_estimator_t;

struct blw_estimator_ops {
    blw_method_t method;
    size_t       state_size; /**< sizeof the method's state */
    /** Numbers of memory that init() needs for a model; 0 for a model of another method. */
    size_t (*mem_len)(const blw_model_t *model);
    /** Bind model and memory, check every table, reset.
     *  @return BLW_OK; or BLW_ERR_ARG, BLW_ERR_MODEL, BLW_ERR_MEM with *self untouched. */
    blw_status_t (*init)(blw_estimator_t *self, const blw_model_t *model, blw_real_t *mem,
                         size_t mem_len);
    /** Start again from x(0) = x0 [n]; NULL takes the model's x0.
     *  @return BLW_OK, or BLW_ERR_ARG with nothing changed if x0 is not within BLW_SIGNAL_MAX. */
    blw_status_t (*reset)(blw_estimator_t *self, const blw_real_t *x0);
    /** Advance from k-1 to k with u(k-1) [l] (NULL means 0), y(k) [m] and the set of valid samples.
     *  A sample that is not in valid, out of its range or beyond BLW_SIGNAL_MAX is missing.
     *  @return BLW_OK; or BLW_ERR_ARG (also: valid names a sensor >= m) or BLW_ERR_INPUT (u is not
     *  within BLW_SIGNAL_MAX) with state and *out untouched. */
    blw_status_t (*step)(blw_estimator_t *self, const blw_real_t *u, const blw_real_t *y,
                         blw_mask_t valid, blw_estimator_out_t *out);
};

/** The four calls of the interface; self was initialised through ops->init. */
static inline blw_status_t blw_estimator_init(blw_estimator_t *self, const blw_estimator_ops_t *ops,
                                              const blw_model_t *model, blw_real_t *mem,
                                              size_t mem_len)
{
    return ops->init(self, model, mem, mem_len);
}

static inline blw_status_t blw_estimator_reset(blw_estimator_t *self, const blw_real_t *x0)
{
    return self->ops->reset(self, x0);
}

static inline blw_status_t blw_estimator_step(blw_estimator_t *self, const blw_real_t *u,
                                              const blw_real_t *y, blw_mask_t valid,
                                              blw_estimator_out_t *out)
{
    return self->ops->step(self, u, y, valid, out);
}
#ifdef __cplusplus
}
#endif
#endif
