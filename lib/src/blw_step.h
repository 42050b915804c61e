/* SPDX-License-Identifier: MIT */
/** @file blw_step.h  Private: what the step of every method begins and ends with. */
#ifndef BLW_STEP_H
#define BLW_STEP_H
#include "blw/blw_estimator.h"

/** Check the inputs of a step.
 *  @return BLW_OK; BLW_ERR_ARG (y is NULL, or valid names sensors that do not exist) or
 *          BLW_ERR_INPUT. */
blw_status_t blw_step_check(const blw_plant_t *plant, const blw_real_t *u, const blw_real_t *y,
                            blw_mask_t valid);
/** BLW_FLAG_MISSING, _DEGRADED and _BLIND as they follow from the two sets. */
uint8_t blw_step_flags(const blw_plant_t *plant, blw_mask_t used, blw_mask_t excluded);
/** s / (1 + s) for s >= 0; 1 if s is infinite or NaN. */
blw_real_t blw_step_suspicion(blw_real_t s);

#endif
