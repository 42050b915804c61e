/* SPDX-License-Identifier: MIT */
#include "blw_bank_internal.h"
#include "blw_cold.h"

static bool sizes_ok(const blw_bank_model_t *model)
{
    const blw_plant_t *const plant = model->head.plant;

    return (plant->m <= BLW_BANK_MAX_SENSORS) && (plant->p <= BLW_BANK_MAX_ATTACKED)
           && (model->sets >= 1U) && (model->sets <= BLW_BANK_MAX_SETS) && (model->subsets >= 1U)
           && (model->per_set >= 1U) && (model->horizon >= 1U) && (model->warm_up >= model->horizon)
           && (model->filtered <= 1U);
}

static bool averaging_ok(const blw_bank_model_t *model)
{
    if (!(model->gain > BLW_R(0.0)) || !(model->gain <= BLW_R(1.0))
        || !(model->ceiling > BLW_R(1.0)) || (model->groups < 1U)) {
        return false;
    }
    return (model->window == 0U) ? (model->groups == 1U) : ((model->window % model->groups) == 0U);
}

static bool masks_ok(const blw_plant_t *plant, const uint16_t *masks, size_t count)
{
    if (masks == NULL) {
        return false;
    }
    for (size_t i = 0U; i < count; i++) {
        if ((masks[i] == 0U) || ((masks[i] & ~BLW_MASK_ALL(plant->m)) != 0U)) {
            return false;
        }
    }
    return true;
}

/* Every subset exists and lies in its set. */
static bool pairs_ok(const blw_bank_model_t *model)
{
    if (model->pair == NULL) {
        return false;
    }
    for (size_t i = 0U; i < ((size_t)model->sets * model->per_set); i++) {
        if (model->pair[i] >= model->subsets) {
            return false;
        }
        const unsigned set    = model->set_mask[i / model->per_set];
        const unsigned subset = model->subset_mask[model->pair[i]];
        if ((subset & ~set) != 0U) {
            return false;
        }
    }
    return true;
}

static bool thresholds_ok(const blw_bank_model_t *model, size_t gates)
{
    for (size_t i = 0U; i < ((size_t)model->sets * model->per_set); i++) {
        if (!(model->scale[i] > BLW_R(0.0)) || !(model->start[i] >= BLW_R(0.0))
            || !(model->start[i] <= BLW_R(1.0))) {
            return false;
        }
    }
    for (size_t i = 0U; i < gates; i++) {
        if (!(model->gate[i] > BLW_R(0.0))) {
            return false;
        }
    }
    return true;
}

static size_t sensors_in_all(const uint16_t *masks, size_t count)
{
    size_t sum = 0U;

    for (size_t i = 0U; i < count; i++) {
        sum += blw_mask_count(masks[i]);
    }
    return sum;
}

BLW_COLD blw_status_t blw_bank_check(const blw_bank_model_t *model)
{
    blw_table_check_t  check;
    const blw_status_t status = blw_model_begin(&model->head, BLW_METHOD_BANK, &check);

    if (status != BLW_OK) {
        return status;
    }
    const blw_plant_t *const plant = model->head.plant;
    const size_t             pairs = (size_t)model->sets * model->per_set;
    if (!sizes_ok(model) || !averaging_ok(model) || !masks_ok(plant, model->set_mask, model->sets)
        || !masks_ok(plant, model->subset_mask, model->subsets) || !pairs_ok(model)) {
        return BLW_ERR_MODEL;
    }
    const size_t gates = sensors_in_all(model->set_mask, model->sets);
    const size_t Z_len =
        (size_t)plant->n * model->horizon * sensors_in_all(model->subset_mask, model->subsets);

    blw_table_add_real(&check, model->gain);
    blw_table_add_real(&check, model->ceiling);
    blw_table_add(&check, model->K, plant->n * gates);
    blw_table_add(&check, model->Z, Z_len);
    blw_table_add(&check, model->scale, pairs);
    blw_table_add(&check, model->start, pairs);
    blw_table_add(&check, model->gate, gates);
    if (!check.ok || !thresholds_ok(model, gates)) {
        return BLW_ERR_MODEL;
    }
    return blw_model_end(&model->head, &check);
}
