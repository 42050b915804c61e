/* SPDX-License-Identifier: MIT */
/** @file replay.h  Between the replay program and the one estimator that is linked into it. */
#ifndef REPLAY_H
#define REPLAY_H
#include "blw/blw_estimator.h"

extern const uint8_t replay_n; /* states */
extern const uint8_t replay_m; /* sensors */
extern const uint8_t replay_l; /* known inputs */

blw_status_t replay_init(void);
/** One step of the estimator. */
blw_status_t replay_step(const blw_real_t *u, const blw_real_t *y, blw_mask_t valid,
                         blw_estimator_out_t *out);
/** The same instructions around a call of replay_nothing(): what the measurement itself costs. */
blw_status_t replay_pause(const blw_real_t *u, const blw_real_t *y, blw_mask_t valid,
                          blw_estimator_out_t *out);
/** A step that only returns. */
blw_status_t replay_nothing(void *self, const blw_real_t *u, const blw_real_t *y, blw_mask_t valid,
                            blw_estimator_out_t *out);

#endif
