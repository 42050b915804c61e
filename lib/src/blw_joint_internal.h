/* SPDX-License-Identifier: MIT */
/** @file blw_joint_internal.h  Private: shared by the parts of blw_joint. */
#ifndef BLW_JOINT_INTERNAL_H
#define BLW_JOINT_INTERNAL_H
#include "blw/blw_joint.h"

/** The sensor is in the set. */
static inline bool blw_joint_in(blw_mask_t set, size_t sensor)
{
    return ((set >> sensor) & 1U) != 0U;
}

/** Sensors of estimator i. */
static inline size_t blw_joint_sensors(const blw_joint_model_t *model, size_t i)
{
    return (size_t)model->first[i + 1U] - model->first[i];
}

/** Weak sensor of estimator i. */
static inline size_t blw_joint_weak(const blw_joint_model_t *model, size_t i)
{
    return model->sensor[model->first[i]];
}

/** Check every table of a model that is not NULL. */
blw_status_t blw_joint_check(const blw_joint_model_t *model);

/** What estimator i adds to the prediction: sample of its j-th sensor less (1). */
blw_real_t blw_joint_innovation(const blw_joint_t *self, size_t i, size_t j);

/** Standard deviations before the first sample. */
void blw_joint_schedule_reset(blw_joint_t *self);
/** (2), (3) from the predicted states, then dx of (4).  heard: samples to be taken in. */
void blw_joint_schedule_correct(blw_joint_t *self, blw_mask_t heard);

/** Back to P0. */
void blw_joint_recursive_reset(blw_joint_t *self);
/** As blw_joint_schedule_correct, with gains for the samples that are there.
 *  @return false if the covariances overflow. */
bool blw_joint_recursive_correct(blw_joint_t *self, blw_mask_t heard);

#endif
