/* SPDX-License-Identifier: MIT */
/** @file blw_decentral_internal.h  Private: what the parts of `decentral` share.
 */
#ifndef BLW_DECENTRAL_INTERNAL_H
#define BLW_DECENTRAL_INTERNAL_H
#include "blw/blw_decentral.h"

/** What either kind of gains offers.  statistic() must come before estimate() of the same set, and
 *  both before all_statistic(). */
struct blw_decentral_gains {
    /** Check the own tables and add them to the walk. */
    void (*add)(const blw_decentral_model_t *model, blw_table_check_t *check);
    /** Begin anew; NULL: there is nothing to begin. */
    void (*reset)(blw_decentral_t *self);
    /** Local filters (1) with self->nu, in place. */
    void (*advance)(blw_decentral_t *self);
    /** g_J of (4) for J = all sensors but those of a set. */
    blw_real_t (*statistic)(blw_decentral_t *self, size_t set);
    /** self->dx = x_J - x_bar for the set of the last statistic(). */
    void (*estimate)(blw_decentral_t *self, size_t set);
    /** g of all sensors, after statistic() and estimate() of a set. */
    blw_real_t (*all_statistic)(blw_decentral_t *self, size_t set);
    /** (5) for the sensors of the set of the last estimate(); NULL where the model cannot ask. */
    void (*reseed)(blw_decentral_t *self, size_t set);
};

/** Local states of sensor i. */
static inline size_t blw_decentral_mu(const blw_decentral_model_t *model, size_t i)
{
    return (size_t)model->first[i + 1U] - model->first[i];
}

/** Delta without the sensors of a set, in self->z. */
void blw_decentral_leave_out(blw_decentral_t *self, size_t set);

/** Check every table and add it to the walk.  The plant has been checked. */
blw_status_t blw_decentral_check(const blw_decentral_model_t *model);

/** The sensors of a set. */
blw_mask_t blw_decentral_members(const blw_decentral_sets_t *sets, size_t set);
/** Local states of a set. */
size_t blw_decentral_rows(const blw_decentral_model_t *model, size_t set);
/** Place of a set's degrees of freedom in the ranking, n_dof if it has none. */
size_t blw_decentral_place(const blw_decentral_model_t *model, size_t set);
/** Threshold of the statistic of the sensors that are not in a set. */
blw_real_t blw_decentral_threshold(const blw_decentral_model_t *model, size_t set);
/** g + c(g): the smallest one is the most plausible. */
blw_real_t blw_decentral_score(const blw_decentral_model_t *model, size_t set, blw_real_t g);
/** The set that covers most of the given sensors, and of those the one with the fewest others. */
size_t blw_decentral_cover(const blw_decentral_sets_t *sets, blw_mask_t sensors);
/** The candidate with the most plausible statistic among those that contain the sensors of
 *  `needed`; self->set if there is none.  @param compared counts the candidates looked at */
size_t blw_decentral_search(blw_decentral_t *self, blw_mask_t needed, uint16_t *compared);

#endif
