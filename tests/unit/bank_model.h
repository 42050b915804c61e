/* SPDX-License-Identifier: MIT */
/** @file bank_model.h  Shared by the tests of the bank: a small model to be worked out by hand.
 *
 *  The plant is x(k+1) = x/2 + u, y_i = x + offset_i, i = 0..2, offsets 1, 2, 3, x(0) = 0; p = 1.
 *  Sets {0,1}, {0,2}, {1,2} with the gains 1/4; subsets {0}, {1}, {2} with h = 2 and
 *  Z = (0.6, 0.8), so that Z O = 0.6 + 0.8/2 = 1.  Averages with gain 1/2 and threshold 1, benign
 *  mean 1/2; gate at 10.
 */
#ifndef BANK_MODEL_H
#define BANK_MODEL_H
#include "blw/blw_bank.h"
#include "support.h"

#define BANK_SETS    3U
#define BANK_PER_SET 2U
#define BANK_PAIRS   (BANK_SETS * BANK_PER_SET)
#define BANK_HORIZON 2U
#define BANK_MEM     BLW_BANK_MEM(1, 3, BANK_SETS, 3U, 2U * BANK_PAIRS, BANK_HORIZON, 1U)

/** Longer than BLW_BANK_MAX_SENSORS, for the test of that limit. */
#define BANK_SENSORS 9U

/** A writable copy of the model with all its tables. */
typedef struct bank_model {
    blw_plant_t      plant;
    blw_bank_model_t model;
    blw_real_t       half[1];            /* A */
    blw_real_t       zero[1];            /* x0 */
    blw_real_t       ones[BANK_SENSORS]; /* Bu and C */
    blw_real_t       offset[BANK_SENSORS];
    blw_real_t       y_min[BANK_SENSORS];
    blw_real_t       y_max[BANK_SENSORS];
    blw_real_t       K[6];
    blw_real_t       Z[6];
    blw_real_t       scale[BANK_PAIRS];
    blw_real_t       start[BANK_PAIRS];
    blw_real_t       gate[6];
    uint16_t         set_mask[BANK_SETS];
    uint16_t         subset_mask[3];
    uint16_t         pair[BANK_PAIRS];
} bank_model_t;

/** Set head.crc to the sum of the tables as they are now. */
static inline void bank_seal(bank_model_t *made)
{
    blw_bank_model_t *const model = &made->model;
    blw_table_check_t       check = {0}; /* begin() refuses some of the tests' heads */

    (void)blw_model_begin(&model->head, BLW_METHOD_BANK, &check);
    blw_table_add_real(&check, model->gain);
    blw_table_add_real(&check, model->ceiling);
    blw_table_add(&check, model->K, 6U);
    blw_table_add(&check, model->Z, 6U);
    blw_table_add(&check, model->scale, BANK_PAIRS);
    blw_table_add(&check, model->start, BANK_PAIRS);
    blw_table_add(&check, model->gate, 6U);
    model->head.crc = check.crc;
}

static inline void bank_fill_tables(bank_model_t *made)
{
    static const uint16_t masks[BANK_SETS]  = {3U, 5U, 6U};
    static const uint16_t pairs[BANK_PAIRS] = {0U, 1U, 0U, 2U, 1U, 2U};

    for (size_t i = 0U; i < BANK_PAIRS; i++) {
        made->K[i]     = BLW_R(0.25);
        made->Z[i]     = ((i % 2U) == 0U) ? BLW_R(0.6) : BLW_R(0.8);
        made->scale[i] = BLW_R(1.0);
        made->start[i] = BLW_R(0.5);
        made->gate[i]  = BLW_R(0.01);
        made->pair[i]  = pairs[i];
    }
    for (size_t i = 0U; i < BANK_SETS; i++) {
        made->set_mask[i]    = masks[i];
        made->subset_mask[i] = (uint16_t)(1U << i);
    }
}

static inline void bank_fill_plant(bank_model_t *made)
{
    made->half[0] = BLW_R(0.5);
    made->zero[0] = BLW_R(0.0);
    for (size_t i = 0U; i < BANK_SENSORS; i++) {
        made->ones[i]   = BLW_R(1.0);
        made->offset[i] = (blw_real_t)(i + 1U);
        made->y_min[i]  = -BLW_REAL_MAX;
        made->y_max[i]  = BLW_REAL_MAX;
    }
    made->plant = (blw_plant_t){
        .n      = 1U,
        .m      = 3U,
        .l      = 1U,
        .p      = 1U,
        .A      = made->half,
        .Bu     = made->ones,
        .C      = made->ones,
        .offset = made->offset,
        .y_min  = made->y_min,
        .y_max  = made->y_max,
        .x0     = made->zero,
    };
}

/** Write the model of this file's head, sealed. */
static inline void bank_make(bank_model_t *made)
{
    bank_fill_plant(made);
    bank_fill_tables(made);
    made->model = (blw_bank_model_t){
        .head = {.abi = BLW_MODEL_ABI, .method = (uint8_t)BLW_METHOD_BANK, .plant = &made->plant},
        .sets = (uint8_t)BANK_SETS,
        .subsets     = 3U,
        .per_set     = (uint8_t)BANK_PER_SET,
        .horizon     = (uint8_t)BANK_HORIZON,
        .groups      = 1U,
        .filtered    = 1U,
        .warm_up     = (uint16_t)BANK_HORIZON,
        .set_mask    = made->set_mask,
        .subset_mask = made->subset_mask,
        .pair        = made->pair,
        .gain        = BLW_R(0.5),
        .ceiling     = BLW_R(2.25),
        .K           = made->K,
        .Z           = made->Z,
        .scale       = made->scale,
        .start       = made->start,
        .gate        = made->gate,
    };
    bank_seal(made);
}

#endif
