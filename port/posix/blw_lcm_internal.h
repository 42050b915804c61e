/* SPDX-License-Identifier: MIT */
/** @file blw_lcm_internal.h  Private: messages to frames, frames to messages. */
#ifndef BLW_LCM_INTERNAL_H
#define BLW_LCM_INTERNAL_H
#include "blw_port_lcm.h"

/** Subscribe to everything that becomes frames.  @return false if LCM refuses. */
bool blw_lcm_listen(blw_port_lcm_t *self);
/** Publish what a frame completes.  @return false if LCM could not. */
bool blw_lcm_publish(blw_port_lcm_t *self, const blw_frame_t *frame);

#endif
