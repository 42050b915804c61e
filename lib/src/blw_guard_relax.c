/* SPDX-License-Identifier: MIT */
/* Descent among a few sensors.
 *
 * The minimum of (2) over the nu of some sensors needs no l but theirs, and no blocks of S but
 * those between them.  So the steps (7) are taken on copies of their l and tau, and only the sums
 * of the steps go to the other sensors.  An excluded sensor i has k_i = 0 and takes the step that
 * makes l_i = 0 after those of the others.  With pairs, one sensor beside an excluded one needs a
 * single step (blw_guard_beside.c), and two excluded ones are eliminated at once: with
 * S_ii - S_ij S_ji = V' diag(s) V,
 *     step_i = -V' diag(s)^-1 V (l_i - S_ij l_j),   step_j = -l_j - S_ji step_i.     (11) */
#include "blw_cold.h"
#include "blw_guard_internal.h"
#include "blw_la.h"

/* Sweeps over some sensors at most before all are looked at again. */
#define MOST_SWEEPS 8U

/* Add step [r] to the sensor's own tau and l, and what it does to the l of the others. */
static BLW_COLD void spread(const blw_guard_t *self, blw_guard_some_t *some, blw_guard_local_t *own,
                            const blw_real_t *step)
{
    const size_t r = self->model->r;

    for (size_t a = 0U; a < r; a++) {
        own->tau[a] += step[a];
        own->l[a] += step[a];
    }
    for (size_t j = 0U; j < some->count; j++) {
        blw_guard_local_t *const other = &some->at[j];

        if (other != own) {
            blw_guard_couple(self->model, other->sensor, own->sensor, step, other->l);
        }
    }
}

/* (7).  @return |step| */
static BLW_COLD blw_real_t update(blw_guard_t *self, blw_guard_some_t *some, blw_guard_local_t *own)
{
    const size_t      r      = self->model->r;
    blw_real_t *const step   = self->turned;
    blw_real_t        square = BLW_R(0.0);
    const blw_real_t  h =
        blw_guard_step_alone(r, own->k, own->l, &self->e[own->sensor * r], own->tau, step, &square);

    spread(self, some, own, step);
    own->attacked = h > own->k;
    return blw_la_sqrt(square);
}

/* (11) for the last two sensors. */
static BLW_COLD void eliminate_two(blw_guard_t *self, blw_guard_some_t *some)
{
    const size_t             r     = self->model->r;
    blw_guard_local_t *const first = &some->at[some->count - 2U];
    blw_guard_local_t *const last  = &some->at[some->count - 1U];
    blw_real_t *const        step  = self->turned;

    for (size_t a = 0U; a < r; a++) {
        step[a] = -last->l[a];
    }
    spread(self, some, last, step);
    blw_guard_divide(self->model, first->sensor, last->sensor, first->l, &step[r], step);
    for (size_t a = 0U; a < r; a++) {
        step[a] = -step[a];
    }
    spread(self, some, first, step);
    for (size_t a = 0U; a < r; a++) {
        step[a] = -last->l[a];
    }
    spread(self, some, last, step);
}

/* l_i = 0 for the excluded sensors; more than two, or two without pairs, get there step by step.
 * @return the largest step that is not exact. */
static BLW_COLD blw_real_t eliminate(blw_guard_t *self, blw_guard_some_t *some)
{
    blw_real_t largest = BLW_R(0.0);

    if (blw_guard_exact(self, some->count - some->penalised)) {
        if ((some->count - some->penalised) == 2U) {
            eliminate_two(self, some);
        } else if (some->count > some->penalised) {
            (void)update(self, some, &some->at[some->penalised]);
        } else {
            /* nothing is excluded */
        }
        return largest;
    }
    for (size_t j = some->penalised; j < some->count; j++) {
        largest = blw_la_max(largest, update(self, some, &some->at[j]));
    }
    return largest;
}

/* One step of every sensor.  @return the largest one. */
static BLW_COLD blw_real_t sweep(blw_guard_t *self, blw_guard_some_t *some)
{
    blw_real_t largest = BLW_R(0.0);

    for (size_t j = 0U; j < some->penalised; j++) {
        largest = blw_la_max(largest, update(self, some, &some->at[j]));
    }
    return blw_la_max(largest, eliminate(self, some));
}

/* Give the sums of the steps to all sensors. */
static BLW_COLD void settle(blw_guard_t *self, const blw_guard_some_t *some)
{
    const size_t      r    = self->model->r;
    blw_real_t *const step = self->turned;

    for (size_t j = 0U; j < some->count; j++) {
        const blw_guard_local_t *const own = &some->at[j];
        const size_t                   row = own->sensor * r;

        for (size_t a = 0U; a < r; a++) {
            step[a] = own->tau[a] - self->eta[row + a];
        }
        blw_guard_move_to(self, own->sensor, step, own->attacked);
    }
}

/* Minimise (2) over the nu of the sensors in the list.  @return the number of sweeps. */
static BLW_COLD unsigned relax(blw_guard_t *self, blw_guard_some_t *some, blw_real_t tolerance,
                               unsigned sweeps)
{
    const size_t r    = self->model->r;
    unsigned     done = 0U;

    if (some->count == 1U) {
        blw_guard_move_alone(self, some->at[0].sensor, some->at[0].k);
        return 1U;
    }
    if ((self->model->pairs != 0U) && (some->count == 2U) && (some->penalised == 1U)) {
        blw_guard_move_alone(self, some->at[1].sensor, BLW_R(0.0));
        blw_guard_move_beside(self, some->at[0].sensor, some->at[1].sensor);
        return 1U;
    }
    for (size_t j = 0U; j < some->count; j++) {
        blw_guard_local_t *const own = &some->at[j];

        own->l   = &self->L[j * r];
        own->tau = &self->step[j * r];
        blw_la_copy(r, &self->l[own->sensor * r], own->l);
        blw_la_copy(r, &self->eta[own->sensor * r], own->tau);
    }
    blw_real_t largest = eliminate(self, some);
    while ((done < sweeps) && ((done == 0U) || (largest > tolerance))) {
        largest = sweep(self, some);
        done++;
    }
    settle(self, some);
    return done;
}

/* Put the sensors of a set at the end of the list.  @return false if they are too many. */
static BLW_COLD bool append(const blw_guard_t *self, blw_mask_t set, blw_real_t k,
                            blw_guard_some_t *some)
{
    const size_t most = (self->model->most < GUARD_SOME) ? self->model->most : GUARD_SOME;
    size_t       i    = 0U;

    for (blw_mask_t rest = set; rest != 0U; rest >>= 1) {
        if ((rest & 1U) != 0U) {
            if (some->count >= most) {
                return false;
            }
            some->at[some->count].sensor   = i;
            some->at[some->count].k        = k;
            some->at[some->count].attacked = true;
            some->count++;
        }
        i++;
    }
    return true;
}

BLW_COLD bool blw_guard_list(const blw_guard_t *self, blw_mask_t set, blw_guard_some_t *some)
{
    const blw_mask_t excluded = self->excluded;
    bool             room     = true;

    some->count     = 0U;
    room            = append(self, set & ~excluded, self->model->k, some);
    some->penalised = some->count;
    room            = room && append(self, set & excluded, BLW_R(0.0), some);
    some->count     = room ? some->count : 0U;
    return room;
}

blw_mask_t blw_guard_clipping(blw_guard_t *self)
{
    const blw_real_t  k      = self->model->k;
    blw_real_t *const square = self->suspicion; /* until judge_sensors() */
    blw_mask_t        set    = 0U;

    blw_guard_squares(self->model, self->l, square);
    for (size_t i = 0U; i < self->model->head.plant->m; i++) {
        if (square[i] > (k * k)) {
            set |= guard_bit(i);
        }
    }
    return set & ~(self->attacked | self->excluded);
}

BLW_COLD bool blw_guard_move_some(blw_guard_t *self, blw_guard_some_t *some, blw_real_t tolerance,
                                  unsigned limit)
{
    const unsigned count = (unsigned)some->count;
    const unsigned least = (count == 1U) ? 1U : (2U * count);

    if ((count == 0U) || ((self->updates + least) > limit)) {
        return false;
    }
    const unsigned more = (limit - self->updates - least) / count;
    const unsigned swept =
        relax(self, some, tolerance, (more < MOST_SWEEPS) ? (more + 1U) : MOST_SWEEPS);
    self->updates = (uint16_t)(self->updates + least + ((swept - 1U) * count));
    return true;
}

BLW_COLD BLW_APART void blw_guard_move_together(blw_guard_t *self, blw_mask_t set,
                                                blw_mask_t smaller, blw_real_t close,
                                                unsigned limit)
{
    blw_guard_some_t some;

    if (!blw_guard_list(self, set, &some) || !blw_guard_move_some(self, &some, close, limit)) {
        (void)blw_guard_list(self, smaller, &some);
        (void)blw_guard_move_some(self, &some, close, limit);
    }
}
