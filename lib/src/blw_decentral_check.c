/* SPDX-License-Identifier: MIT */
/* What init() checks before it trusts a model. */
#include "blw_cold.h"
#include "blw_decentral_internal.h"
#include "blw_la.h"

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
    return (model->steady == NULL) != (model->recursive == NULL);
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
        || ((sets->n_candidates > 0U) && (sets->candidate == NULL)) || (sets->parent[0] != 0U)) {
        return false;
    }
    for (size_t set = 1U; set < sets->n_sets; set++) {
        if (!set_ok(model, set)) {
            return false;
        }
    }
    for (size_t i = 0U; i < sets->n_candidates; i++) {
        if (sets->candidate[i] >= sets->n_sets) {
            return false;
        }
    }
    return true;
}

/* Number of the entry of `removed` for a set, at most n_dof. */
static size_t place_of(const blw_decentral_model_t *model, size_t set)
{
    const size_t rows  = blw_decentral_rows(model, set);
    size_t       place = 0U;

    while ((place < model->ranking->n_dof) && (model->ranking->removed[place] != rows)) {
        place++;
    }
    return place;
}

static bool ranking_ok(const blw_decentral_model_t *model)
{
    const blw_decentral_ranking_t *const ranking = model->ranking;
    const blw_decentral_sets_t *const    sets    = model->sets;

    if ((ranking->removed == NULL) || (ranking->n_ranked > ranking->n_dof)
        || ((ranking->n_ranked > 0U) && (ranking->n_knots < 2U))) {
        return false;
    }
    for (size_t set = 0U; set < sets->n_sets; set++) {
        if (place_of(model, set) >= ranking->n_dof) {
            return false;
        }
    }
    for (size_t i = 0U; (ranking->n_ranked > 0U) && (i < sets->n_candidates); i++) {
        if (place_of(model, sets->candidate[i]) >= ranking->n_ranked) {
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

/* Numbers of the tables that are kept per sensor. */
typedef struct lengths {
    size_t F; /* or S */
    size_t Q;
    size_t H;
} lengths_t;

static lengths_t lengths_of(const blw_decentral_model_t *model)
{
    const size_t d   = (size_t)model->mu - model->head.plant->n;
    lengths_t    len = {0U, 0U, 0U};

    for (size_t i = 0U; i < model->head.plant->m; i++) {
        const size_t mu  = blw_decentral_mu(model, i);
        const size_t end = model->first[i + 1U];
        len.F += mu * mu;
        len.Q += mu * ((end < d) ? end : d);
        len.H += blw_la_packed_row(mu);
    }
    return len;
}

/* Whether `at` fits the sets. */
static bool removals_ok(const blw_decentral_model_t *model)
{
    const blw_decentral_steady_t *const steady = model->steady;

    if ((steady->at == NULL) || (steady->at[0] != 0U)) {
        return false;
    }
    for (size_t set = 0U; set < model->sets->n_sets; set++) {
        const size_t rows = blw_decentral_rows(model, set);
        const size_t mu   = (set > 0U) ? blw_decentral_mu(model, model->sets->sensor[set]) : 0U;
        const size_t len  = (rows > mu) ? ((mu * (rows - mu)) + blw_la_packed_row(mu)) : 0U;
        if (steady->at[set + 1U] != (steady->at[set] + len)) {
            return false;
        }
    }
    return true;
}

static void add_steady(const blw_decentral_model_t *model, blw_table_check_t *check)
{
    const blw_decentral_steady_t *const steady = model->steady;
    const size_t                        n      = model->head.plant->n;
    const size_t                        mu     = model->mu;
    const size_t                        d      = mu - n;
    const lengths_t                     len    = lengths_of(model);

    if ((steady->d != d) || !removals_ok(model)) {
        check->ok = false;
        return;
    }
    blw_table_add(check, steady->F, len.F);
    blw_table_add(check, steady->K, mu);
    blw_table_add(check, steady->N, (d * mu) - ((d * (d - 1U)) / 2U));
    blw_table_add(check, steady->Psi, n * mu);
    blw_table_add(check, steady->Q, len.Q);
    blw_table_add(check, steady->Y, mu * n);
    blw_table_add(check, steady->H, (model->reseed != 0U) ? len.H : 0U);
    blw_table_add(check, steady->M, steady->at[model->sets->n_sets]);
}

static void add_recursive(const blw_decentral_model_t *model, blw_table_check_t *check)
{
    const blw_decentral_recursive_t *const recursive = model->recursive;
    const size_t                           n         = model->head.plant->n;
    const size_t                           m         = model->head.plant->m;
    const size_t                           mu        = model->mu;

    blw_table_add(check, recursive->S, lengths_of(model).F);
    blw_table_add(check, recursive->t, mu);
    blw_table_add(check, recursive->V, mu * n);
    blw_table_add(check, recursive->E, blw_la_packed_row(m));
    blw_table_add(check, recursive->L0, mu * n);
    blw_table_add(check, recursive->Psi, n * mu);
    check->ok = check->ok && (model->reseed == 0U) && (model->warm_up == 0U);
    for (size_t i = 0U; check->ok && (i < m); i++) {
        check->ok = positive(1U, &recursive->E[blw_la_packed_row(i) + i]);
    }
}

BLW_COLD blw_status_t blw_decentral_check(const blw_decentral_model_t *model)
{
    blw_table_check_t  check;
    const blw_status_t status = blw_model_begin(&model->head, BLW_METHOD_DECENTRAL, &check);

    if (status != BLW_OK) {
        return status;
    }
    if (!sizes_ok(model) || !sets_ok(model) || !ranking_ok(model)) {
        return BLW_ERR_MODEL;
    }
    add_common(model, &check);
    if (model->steady != NULL) {
        add_steady(model, &check);
    } else {
        add_recursive(model, &check);
    }
    return blw_model_end(&model->head, &check);
}
