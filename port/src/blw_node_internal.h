/* SPDX-License-Identifier: MIT */
/** @file blw_node_internal.h  Private: the parts of a node. */
#ifndef BLW_NODE_INTERNAL_H
#define BLW_NODE_INTERNAL_H
#include "blw/blw_node.h"

/** Count up, but not over. */
void blw_node_count(uint32_t *counter);

/** As a float: a double may be out of its range. */
float blw_node_narrow(blw_real_t value);

/** Make room for step k: nothing received yet. */
void blw_node_clear(blw_node_t *self);
/** Take a measurement, zeta or input frame. */
void blw_node_take_values(blw_node_t *self, const blw_frame_t *frame);
/** All values of step k are here. */
bool blw_node_complete(const blw_node_t *self);
/** Put the inputs of step k in force and tell which sensors can be used: all that is complete,
 *  without contradiction and not in quarantine.  Counts what is missing. */
blw_mask_t blw_node_settle(blw_node_t *self);
/** Take notice of a bad frame. */
void blw_node_refuse(blw_node_t *self, blw_wire_result_t result);

/** Start sending the report. */
void blw_node_announce(blw_node_t *self);
/** Send as much of it as the link takes. */
void blw_node_send(blw_node_t *self);

#endif
