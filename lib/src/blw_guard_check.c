/* SPDX-License-Identifier: MIT */
#include "blw_cold.h"
#include "blw_guard_internal.h"
#include "blw_la.h"

static bool sizes_ok(const blw_guard_model_t *model)
{
    const blw_plant_t *const plant = model->head.plant;

    return (model->r >= 1U) && (model->reach >= 1U) && (model->reach <= model->r)
           && (model->n_u <= plant->n) && (model->n_units <= plant->m)
           && (model->n_units > plant->p) && (model->most >= 1U) && (model->most <= plant->m)
           && (model->search <= 2U) && (model->max_updates >= 1U) && (model->pairs <= 1U)
           && (model->solver != NULL);
}

/* Pairs are for single sensors only, and one of the solvers for one liar with pairs. */
static bool pairs_ok(const blw_guard_model_t *model)
{
    const blw_plant_t *const plant = model->head.plant;

    if (model->pairs == 0U) {
        return !model->solver->single;
    }
    return (plant->p >= 1U) && (plant->p <= (model->solver->single ? 1U : 2U))
           && (model->n_units == plant->m);
}

/* Every unit has a number below n_units, no p units hold more than `most` sensors, every rank is
 * at most r. */
static bool units_ok(const blw_guard_model_t *model)
{
    const blw_plant_t *const plant                  = model->head.plant;
    uint8_t                  count[BLW_MAX_SENSORS] = {0U};
    size_t                   most                   = 0U;

    if ((model->unit == NULL) || (model->rank == NULL)) {
        return false;
    }
    for (size_t i = 0U; i < plant->m; i++) {
        if ((model->unit[i] >= model->n_units) || (model->rank[i] > model->r)) {
            return false;
        }
        count[model->unit[i]]++;
    }
    for (size_t taken = 0U; taken < plant->p; taken++) {
        size_t largest = 0U;

        for (size_t unit = 1U; unit < model->n_units; unit++) {
            largest = (count[unit] > count[largest]) ? unit : largest;
        }
        most += count[largest];
        count[largest] = 0U;
    }
    return most <= model->most;
}

/* The scalars, and the positive table; written so that a NaN fails. */
static bool values_ok(const blw_guard_model_t *model)
{
    const blw_real_t zero = BLW_R(0.0);

    for (size_t i = 0U; i < model->head.plant->m; i++) {
        if (!(model->drift[i] > zero) || !(model->effect[i] >= zero)) {
            return false;
        }
    }
    return (model->k > zero) && (model->exclude >= model->k) && (model->gross > zero)
           && (model->gain > zero) && (model->gain <= BLW_R(1.0)) && (model->kappa >= zero)
           && (model->omega >= zero) && (model->sigma >= zero);
}

static BLW_COLD void add_tables(const blw_guard_model_t *model, blw_table_check_t *check)
{
    const size_t n   = model->head.plant->n;
    const size_t m   = model->head.plant->m;
    const size_t r   = model->r;
    const size_t N   = m * r;
    const size_t n_u = model->n_u;
    const size_t n_s = n - n_u;
    const size_t len = (model->pairs != 0U) ? (N * (m - 1U)) : 0U;

    blw_table_add(check, model->Lam, m * blw_guard_filter_len(model));
    blw_table_add(check, model->b, m * model->reach);
    blw_table_add(check, model->S, (r * r * m * (m - 1U)) / 2U);
    blw_table_add(check, model->V, len * r);
    blw_table_add(check, model->s, len);
    blw_table_add(check, model->Fu, n_u * N);
    blw_table_add(check, model->Gu, n_u * N);
    blw_table_add(check, model->Xu, (n_s > 0U) ? (n * n_u) : 0U);
    blw_table_add(check, model->Xs, n * n_s);
    blw_table_add(check, model->Sig, n_s * N);
    blw_table_add(check, model->effect, m);
    blw_table_add(check, model->drift, m);
    blw_table_add_real(check, model->k);
    blw_table_add_real(check, model->exclude);
    blw_table_add_real(check, model->gross);
    blw_table_add_real(check, model->gain);
    blw_table_add_real(check, model->kappa);
    blw_table_add_real(check, model->omega);
    blw_table_add_real(check, model->sigma);
}

BLW_COLD blw_status_t blw_guard_check(const blw_guard_model_t *model)
{
    blw_table_check_t  check;
    const blw_status_t status = blw_model_begin(&model->head, BLW_METHOD_GUARD, &check);

    if (status != BLW_OK) {
        return status;
    }
    if (!sizes_ok(model) || !units_ok(model) || !pairs_ok(model)) {
        return BLW_ERR_MODEL;
    }
    add_tables(model, &check);
    if (!check.ok || !values_ok(model)) {
        return BLW_ERR_MODEL;
    }
    return blw_model_end(&model->head, &check);
}
