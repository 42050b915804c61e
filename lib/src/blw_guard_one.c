/* SPDX-License-Identifier: MIT */
/* One liar at most, and the tables to solve for any sensor beside it exactly: one sensor after the
 * other.
 *
 * The sensor with the largest |h_i| is excluded at once if it stands out, before and after;
 * otherwise sensors take their steps (7) until it is clear which one to exclude, if any.  Then
 * whatever still has the largest step takes (10). */
#include "blw_guard_internal.h"
#include "blw_la.h"

/* Updates that a step (7) or (10) counts as, with the look at all sensors that follows it. */
#define ALONE  3U
#define BESIDE 4U

typedef struct one_descent {
    blw_guard_view_t view;
    blw_real_t       clear;    /* by how much the largest |h_i| is above all others, and exclude */
    size_t           leader;   /* whose it is */
    size_t           excluded; /* if self->excluded is not 0 */
    bool             gross;    /* l may hold the rounding of a gross attack */
} one_descent_t;

static void find_leader(const blw_guard_t *self, one_descent_t *descent)
{
    blw_real_t most   = BLW_R(0.0);
    blw_real_t second = self->model->exclude;

    for (size_t i = 0U; i < self->model->head.plant->m; i++) {
        const blw_real_t h = self->h[i];

        if (h > most) {
            second          = blw_la_max(second, most);
            most            = h;
            descent->leader = i;
        } else {
            second = blw_la_max(second, h);
        }
    }
    descent->clear = most - second;
}

/* l_i = 0 from now on.  @return false with nothing changed if the limit does not allow that. */
static bool exclude(blw_guard_t *self, one_descent_t *descent, size_t i)
{
    if ((self->updates + ALONE) > self->model->max_updates) {
        return false;
    }
    self->updates     = (uint16_t)(self->updates + ALONE);
    self->excluded    = guard_bit(i);
    descent->excluded = i;
    blw_guard_move_alone(self, i, BLW_R(0.0));
    blw_guard_survey(self, &descent->view);
    return true;
}

/* Take the largest step.  @return false if the limit does not allow that. */
static bool update(blw_guard_t *self, one_descent_t *descent, unsigned limit)
{
    const size_t i      = descent->view.sensor;
    const bool   alone  = (self->excluded == 0U) || (i == descent->excluded);
    unsigned     needed = BESIDE;

    if (alone) {
        needed = ALONE;
    }
    if ((self->updates + needed) > limit) {
        return false;
    }
    self->updates = (uint16_t)(self->updates + needed);
    if (alone) {
        blw_guard_move_alone(self, i, (self->excluded == 0U) ? self->model->k : BLW_R(0.0));
    } else {
        blw_guard_move_beside(self, i, descent->excluded);
    }
    blw_guard_survey(self, &descent->view);
    return true;
}

/* Descend until nothing moves, who lies is clear if that is asked for, or the limit is reached.
 * @return whether nothing moves. */
static bool descend(blw_guard_t *self, one_descent_t *descent, unsigned limit, bool decides)
{
    for (;;) {
        const bool still = descent->view.largest <= (GUARD_TOLERANCE * self->model->k);

        if (still && descent->gross) {
            const unsigned product = self->model->head.plant->m; /* in block columns of S */

            if ((self->updates + product) > limit) {
                return false;
            }
            self->updates = (uint16_t)(self->updates + product);
            blw_guard_multipliers(self->model, self->eta, self->l);
            blw_guard_survey(self, &descent->view);
            descent->gross = false;
            continue;
        }
        if (decides) {
            find_leader(self, descent);
        }
        if (still || (decides && (descent->clear > (GUARD_CLEAR * descent->view.largest)))
            || !update(self, descent, limit)) {
            return still;
        }
    }
}

/* Exclude who stands out, and see whether it still does.  @return that; if not, nothing is
 * excluded. */
static bool exclude_at_once(blw_guard_t *self, one_descent_t *descent)
{
    const blw_real_t margin = GUARD_AT_ONCE * self->model->k;

    find_leader(self, descent);
    const size_t leader = descent->leader;
    if (!(descent->clear > margin) || !exclude(self, descent, leader)) {
        return false;
    }
    find_leader(self, descent);
    if ((descent->leader == leader) && (descent->clear > margin)) {
        return true;
    }
    self->excluded = 0U;
    return false;
}

static blw_real_t solve(blw_guard_t *self, bool *converged)
{
    const unsigned most    = self->model->max_updates;
    const bool     decides = self->warm_up == 0U;
    one_descent_t  descent = {.gross = blw_guard_begin(self)};

    if (!decides || !exclude_at_once(self, &descent)) {
        blw_guard_survey(self, &descent.view);
        if (decides) {
            (void)descend(self, &descent, most / 2U, true);
        }
        if (decides && (descent.clear > BLW_R(0.0))) {
            (void)exclude(self, &descent, descent.leader);
        }
    }
    *converged = descend(self, &descent, most, false);
    return *converged ? descent.view.pending : blw_guard_bound(self, descent.view.l);
}

const blw_guard_solver_t blw_guard_one_ops = {.solve = solve, .single = true};
