/* SPDX-License-Identifier: MIT */
/* What init() checks before it trusts a model. */
#include "blw_cold.h"
#include "blw_decentral_internal.h"

static bool sizes_ok(const blw_decentral_model_t *model)
{
    const blw_plant_t *const plant = model->head.plant;

    if ((model->first == NULL) || (model->sets == NULL) || (model->ranking == NULL)
        || (model->mu <= plant->n) || (model->first[0] != 0U)
        || (model->first[plant->m] != model->mu) || (model->max_gap == 0U)
        || (model->reseed > 1U)) {
        return false;
    }
    for (size_t i = 0U; i < plant->m; i++) {
        if (model->first[i] >= model->first[i + 1U]) {
            return false;
        }
    }
    return (model->gains != NULL) && ((model->steady == NULL) != (model->recursive == NULL));
}

static bool set_ok(const blw_decentral_model_t *model, size_t set)
{
    const blw_decentral_sets_t *const sets   = model->sets;
    const size_t                      parent = sets->parent[set];

    return (parent < set) && (sets->sensor[set] < model->head.plant->m)
           && ((parent == 0U) || (sets->sensor[parent] < sets->sensor[set]))
           && (blw_decentral_rows(model, set) <= model->rows);
}

static bool sets_ok(const blw_decentral_model_t *model)
{
    const blw_decentral_sets_t *const sets = model->sets;

    if ((sets->n_sets == 0U) || (sets->parent == NULL) || (sets->sensor == NULL)
        || (model->ranking->removed == NULL) || (sets->parent[0] != 0U)) {
        return false;
    }
    for (size_t set = 0U; set < sets->n_sets; set++) {
        if (((set > 0U) && !set_ok(model, set))
            || (blw_decentral_place(model, set) >= model->ranking->n_dof)) {
            return false;
        }
    }
    return true;
}

static bool candidates_ok(const blw_decentral_model_t *model)
{
    const blw_decentral_sets_t *const    sets    = model->sets;
    const blw_decentral_ranking_t *const ranking = model->ranking;
    const bool                           ranked  = ranking->n_ranked > 0U;

    if ((ranking->n_ranked > ranking->n_dof) || (ranked && (ranking->n_knots < 2U))
        || ((sets->n_candidates > 0U) && (sets->candidate == NULL))) {
        return false;
    }
    for (size_t i = 0U; i < sets->n_candidates; i++) {
        const size_t set = sets->candidate[i];
        if ((set >= sets->n_sets)
            || (ranked && (blw_decentral_place(model, set) >= ranking->n_ranked))) {
            return false;
        }
    }
    return true;
}

static bool positive(size_t len, const blw_real_t *x)
{
    for (size_t i = 0U; i < len; i++) {
        if (!(x[i] > BLW_R(0.0))) {
            return false;
        }
    }
    return true;
}

static bool growing(size_t len, const blw_real_t *x)
{
    for (size_t i = 1U; i < len; i++) {
        if (!(x[i] > x[i - 1U])) {
            return false;
        }
    }
    return true;
}

static void add_common(const blw_decentral_model_t *model, blw_table_check_t *check)
{
    const blw_decentral_ranking_t *const ranking = model->ranking;
    const blw_plant_t *const             plant   = model->head.plant;
    const size_t                         ranked  = ranking->n_ranked;
    const size_t                         knots   = (ranked > 0U) ? ranking->n_knots : 0U;

    blw_table_add(check, model->Phi, (size_t)model->mu * plant->n);
    blw_table_add(check, model->scale, plant->m);
    blw_table_add(check, ranking->thr, ranking->n_dof);
    blw_table_add(check, ranking->knots, knots);
    blw_table_add(check, ranking->c, ranked * knots);
    if (check->ok) {
        check->ok = positive(plant->m, model->scale) && positive(ranking->n_dof, ranking->thr)
                    && growing(knots, ranking->knots);
    }
}

BLW_COLD blw_status_t blw_decentral_check(const blw_decentral_model_t *model)
{
    blw_table_check_t  check;
    const blw_status_t status = blw_model_begin(&model->head, BLW_METHOD_DECENTRAL, &check);

    if (status != BLW_OK) {
        return status;
    }
    if (!sizes_ok(model) || !sets_ok(model) || !candidates_ok(model)) {
        return BLW_ERR_MODEL;
    }
    add_common(model, &check);
    model->gains->add(model, &check);
    return blw_model_end(&model->head, &check);
}
