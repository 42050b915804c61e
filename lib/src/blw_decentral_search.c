/* SPDX-License-Identifier: MIT */
/* Sets of sensors: their members, their thresholds, and which one is the most plausible. */
#include "blw_cold.h"
#include "blw_decentral_internal.h"
#include "blw_la.h"

blw_mask_t blw_decentral_members(const blw_decentral_sets_t *sets, size_t set)
{
    blw_mask_t members = 0U;

    for (size_t rest = set; rest != 0U; rest = sets->parent[rest]) {
        members |= (blw_mask_t)1U << sets->sensor[rest];
    }
    return members;
}

size_t blw_decentral_rows(const blw_decentral_model_t *model, size_t set)
{
    size_t rows = 0U;

    for (size_t rest = set; rest != 0U; rest = model->sets->parent[rest]) {
        rows += blw_decentral_mu(model, model->sets->sensor[rest]);
    }
    return rows;
}

void blw_decentral_leave_out(blw_decentral_t *self, size_t set)
{
    const blw_decentral_model_t *const model = self->model;

    blw_la_copy(model->mu, self->delta, self->z);
    for (size_t rest = set; rest != 0U; rest = model->sets->parent[rest]) {
        const size_t sensor = model->sets->sensor[rest];
        blw_la_zero(blw_decentral_mu(model, sensor), &self->z[model->first[sensor]]);
    }
}

size_t blw_decentral_place(const blw_decentral_model_t *model, size_t set)
{
    const size_t rows  = blw_decentral_rows(model, set);
    size_t       place = 0U;

    while ((place < model->ranking->n_dof) && (model->ranking->removed[place] != rows)) {
        place++;
    }
    return place;
}

blw_real_t blw_decentral_threshold(const blw_decentral_model_t *model, size_t set)
{
    return model->ranking->thr[blw_decentral_place(model, set)];
}

/* c(g): linear between the knots, constant outside. */
static blw_real_t offset_of(const blw_decentral_ranking_t *ranking, size_t place, blw_real_t g)
{
    const blw_real_t *const knots = ranking->knots;
    const blw_real_t *const c     = &ranking->c[place * ranking->n_knots];
    const size_t            last  = (size_t)ranking->n_knots - 1U;
    size_t                  i     = 0U;

    while ((i < last) && (g > knots[i + 1U])) {
        i++;
    }
    if (i == last) {
        return c[last];
    }
    if (!(g > knots[i])) {
        return c[0];
    }
    return c[i] + (((c[i + 1U] - c[i]) * (g - knots[i])) / (knots[i + 1U] - knots[i]));
}

blw_real_t blw_decentral_score(const blw_decentral_model_t *model, size_t set, blw_real_t g)
{
    if (model->ranking->n_ranked == 0U) {
        return g;
    }
    return g + offset_of(model->ranking, blw_decentral_place(model, set), g);
}

size_t blw_decentral_search(blw_decentral_t *self, blw_mask_t needed, uint16_t *compared)
{
    const blw_decentral_sets_t *const sets = self->model->sets;
    size_t                            best = self->set;
    blw_real_t                        low  = BLW_REAL_MAX;

    *compared = 0U;
    for (size_t i = 0U; i < sets->n_candidates; i++) {
        const size_t set = sets->candidate[i];
        if ((needed & ~blw_decentral_members(sets, set)) != 0U) {
            continue;
        }
        const blw_real_t score =
            blw_decentral_score(self->model, set, self->model->gains->statistic(self, set));
        if ((*compared == 0U) || (score < low)) {
            low  = score;
            best = set;
        }
        (*compared)++;
    }
    return best;
}

BLW_COLD size_t blw_decentral_cover(const blw_decentral_sets_t *sets, blw_mask_t sensors)
{
    size_t   best    = 0U;
    unsigned covered = 0U;
    unsigned others  = 0U;

    for (size_t set = 1U; set < sets->n_sets; set++) {
        const blw_mask_t members = blw_decentral_members(sets, set);
        const unsigned   inside  = blw_mask_count(members & sensors);
        const unsigned   outside = blw_mask_count(members & ~sensors);
        if ((inside > covered) || ((inside == covered) && (outside < others))) {
            best    = set;
            covered = inside;
            others  = outside;
        }
    }
    return best;
}
