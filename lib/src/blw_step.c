/* SPDX-License-Identifier: MIT */
#include "blw_step.h"
#include "blw_cold.h"

/* Once for both: to shift a mask by a variable takes a dozen instructions where words are short. */
static BLW_APART blw_mask_t all_sensors(const blw_plant_t *plant)
{
    return BLW_MASK_ALL(plant->m);
}

blw_status_t blw_step_check(const blw_plant_t *plant, const blw_real_t *u, const blw_real_t *y,
                            blw_mask_t valid)
{
    if ((y == NULL) || ((valid & ~all_sensors(plant)) != 0U)) {
        return BLW_ERR_ARG;
    }
    return blw_plant_input_ok(plant, u) ? BLW_OK : BLW_ERR_INPUT;
}

uint8_t blw_step_flags(const blw_plant_t *plant, blw_mask_t used, blw_mask_t excluded)
{
    const blw_mask_t missing = all_sensors(plant) & ~used;
    unsigned         flags   = 0U;

    if (missing != 0U) {
        flags |= BLW_FLAG_MISSING;
    }
    if (blw_mask_count(missing | excluded) > plant->p) {
        flags |= BLW_FLAG_DEGRADED;
    }
    if ((used & ~excluded) == 0U) {
        flags |= BLW_FLAG_BLIND;
    }
    return (uint8_t)flags;
}

blw_real_t blw_step_suspicion(blw_real_t s)
{
    return (s <= BLW_REAL_MAX) ? (s / (BLW_R(1.0) + s)) : BLW_R(1.0);
}
