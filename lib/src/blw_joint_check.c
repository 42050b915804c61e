/* SPDX-License-Identifier: MIT */
/* What init() demands of a model, so that a step need not. */
#include "blw_cold.h"
#include "blw_joint_internal.h"
#include "blw_la.h"

static bool all_above(const blw_real_t *table, size_t len, blw_real_t least)
{
    for (size_t i = 0U; i < len; i++) {
        if (!(table[i] > least)) {
            return false;
        }
    }
    return true;
}

/* Every estimator has a weak sensor of its own, and none of its sensors twice. */
static bool local_ok(const blw_joint_model_t *model, size_t i, blw_mask_t *weak)
{
    blw_mask_t seen = 0U;

    for (size_t at = model->first[i]; at < model->first[i + 1U]; at++) {
        const size_t sensor = model->sensor[at];
        if ((sensor >= model->head.plant->m) || blw_joint_in(seen, sensor)) {
            return false;
        }
        seen |= (blw_mask_t)1U << sensor;
    }
    const size_t own = blw_joint_weak(model, i);
    const bool new   = !blw_joint_in(*weak, own);
    *weak |= (blw_mask_t)1U << own;
    return new;
}

static bool sets_ok(const blw_joint_model_t *model)
{
    const size_t m    = model->head.plant->m;
    blw_mask_t   weak = 0U;

    if ((model->r == 0U) || (model->r > m) || (model->first == NULL) || (model->sensor == NULL)
        || (model->strong == NULL) || (model->first[0] != 0U)) {
        return false;
    }
    for (size_t j = 0U; j < m; j++) {
        if (model->strong[j] > 1U) {
            return false;
        }
    }
    for (size_t i = 0U; i < model->r; i++) {
        const size_t first = model->first[i];
        const size_t end   = model->first[i + 1U];
        if ((end <= first) || ((end - first) > m) || !local_ok(model, i, &weak)) {
            return false;
        }
    }
    return true;
}

static bool schedule_ok(const blw_joint_model_t *model, blw_table_check_t *check)
{
    const blw_joint_schedule_t *const gains = model->schedule;
    const size_t                      n     = model->head.plant->n;
    const size_t                      r     = model->r;
    const size_t                      steps = gains->steps;

    blw_table_add(check, gains->K, steps * (n + 2U) * model->first[r]);
    blw_table_add(check, gains->G, steps * (r - 1U) * n * n);
    blw_table_add(check, gains->sd, steps * r);
    blw_table_add(check, gains->sd_gap, r);
    return (steps > 0U) && check->ok && all_above(gains->sd, steps * r, BLW_R(0.0))
           && all_above(gains->sd_gap, r, BLW_R(0.0));
}

static bool recursive_ok(const blw_joint_model_t *model, blw_table_check_t *check)
{
    const blw_joint_recursive_t *const gains = model->recursive;
    const size_t                       n     = model->head.plant->n;
    const size_t                       m     = model->head.plant->m;

    blw_table_add(check, gains->V, n * n);
    blw_table_add(check, gains->E, blw_la_packed_row(m));
    blw_table_add(check, gains->L0, blw_la_packed_row(n));
    blw_table_add(check, gains->theta_sd, model->r);
    if (!check->ok) {
        return false;
    }
    for (size_t j = 0U; j < m; j++) {
        if (!(gains->E[blw_la_packed_row(j) + j] > BLW_R(0.0))) {
            return false;
        }
    }
    return all_above(gains->theta_sd, model->r, BLW_R(0.0));
}

BLW_COLD blw_status_t blw_joint_check(const blw_joint_model_t *model)
{
    blw_table_check_t  check;
    const blw_status_t status = blw_model_begin(&model->head, BLW_METHOD_JOINT, &check);

    if (status != BLW_OK) {
        return status;
    }
    if (!sets_ok(model) || ((model->schedule == NULL) == (model->recursive == NULL))) {
        return BLW_ERR_MODEL;
    }
    blw_table_add(&check, model->scale, model->r);
    if (!check.ok || !all_above(model->scale, model->r, BLW_R(0.0))) {
        return BLW_ERR_MODEL;
    }
    const bool sound =
        (model->schedule != NULL) ? schedule_ok(model, &check) : recursive_ok(model, &check);
    return sound ? blw_model_end(&model->head, &check) : BLW_ERR_MODEL;
}
