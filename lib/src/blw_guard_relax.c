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

/* The copies of the j-th sensor, [r]. */
static inline blw_real_t *l_of(const blw_guard_t *self, size_t j)
{
    return &self->L[j * self->model->r];
}

static inline blw_real_t *tau_of(const blw_guard_t *self, size_t j)
{
    return &self->step[j * self->model->r];
}

/* k_i of the j-th sensor. */
static inline blw_real_t k_of(const blw_guard_t *self, const blw_guard_some_t *some, size_t j)
{
    return (j < some->penalised) ? self->model->k : BLW_R(0.0);
}

/* Add step [r] to the sensor's own tau and l, and what it does to the l of the others. */
static BLW_COLD void spread(const blw_guard_t *self, const blw_guard_some_t *some, size_t own,
                            const blw_real_t *step)
{
    const size_t r = self->model->r;

    blw_la_axpy(r, BLW_R(1.0), step, tau_of(self, own));
    blw_la_axpy(r, BLW_R(1.0), step, l_of(self, own));
    for (size_t j = 0U; j < some->count; j++) {
        if (j != own) {
            blw_guard_couple(self->model, some->sensor[j], some->sensor[own], step, l_of(self, j));
        }
    }
}

/* (7).  @return |step| */
static BLW_COLD blw_real_t update(blw_guard_t *self, blw_guard_some_t *some, size_t j)
{
    const size_t            r      = self->model->r;
    const blw_real_t        k      = k_of(self, some, j);
    const blw_real_t *const e      = &self->e[some->sensor[j] * r];
    blw_real_t *const       step   = self->turned;
    blw_real_t              square = BLW_R(0.0);
    const blw_real_t        h =
        blw_guard_step_alone(r, k, l_of(self, j), e, tau_of(self, j), step, &square);

    spread(self, some, j, step);
    some->attacked[j] = h > k;
    return blw_la_sqrt(square);
}

/* The step that makes l of the last sensor 0. */
static BLW_COLD void clear_last(blw_guard_t *self, const blw_guard_some_t *some)
{
    const size_t            last = some->count - 1U;
    const blw_real_t *const l    = l_of(self, last);

    for (size_t a = 0U; a < self->model->r; a++) {
        self->turned[a] = -l[a];
    }
    spread(self, some, last, self->turned);
}

/* (11) for the last two sensors. */
static BLW_COLD void eliminate_two(blw_guard_t *self, const blw_guard_some_t *some)
{
    const size_t      r     = self->model->r;
    const size_t      first = some->count - 2U;
    blw_real_t *const step  = self->turned;

    clear_last(self, some);
    blw_guard_divide(self->model, some->sensor[first], some->sensor[first + 1U], l_of(self, first),
                     &step[r], step);
    for (size_t a = 0U; a < r; a++) {
        step[a] = -step[a];
    }
    spread(self, some, first, step);
    clear_last(self, some);
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
            (void)update(self, some, some->penalised);
        } else {
            /* nothing is excluded */
        }
        return largest;
    }
    for (size_t j = some->penalised; j < some->count; j++) {
        largest = blw_la_max(largest, update(self, some, j));
    }
    return largest;
}

/* One step of every sensor.  @return the largest one. */
static BLW_COLD blw_real_t sweep(blw_guard_t *self, blw_guard_some_t *some)
{
    blw_real_t largest = BLW_R(0.0);

    for (size_t j = 0U; j < some->penalised; j++) {
        largest = blw_la_max(largest, update(self, some, j));
    }
    return blw_la_max(largest, eliminate(self, some));
}

/* Give the sums of the steps to all sensors. */
static BLW_COLD void settle(blw_guard_t *self, const blw_guard_some_t *some)
{
    const size_t      r    = self->model->r;
    blw_real_t *const step = self->turned;

    for (size_t j = 0U; j < some->count; j++) {
        const size_t            i   = some->sensor[j];
        const blw_real_t *const tau = tau_of(self, j);

        for (size_t a = 0U; a < r; a++) {
            step[a] = tau[a] - self->eta[(i * r) + a];
        }
        blw_guard_move_to(self, i, step, some->attacked[j]);
    }
}

/* Minimise (2) over the nu of the sensors in the list.  @return the number of sweeps. */
static BLW_COLD unsigned relax(blw_guard_t *self, blw_guard_some_t *some, blw_real_t tolerance,
                               unsigned sweeps)
{
    const size_t r    = self->model->r;
    unsigned     done = 0U;

    if (some->count == 1U) {
        blw_guard_move_alone(self, some->sensor[0], k_of(self, some, 0U));
        return 1U;
    }
    if ((self->model->pairs != 0U) && (some->count == 2U) && (some->penalised == 1U)) {
        blw_guard_move_alone(self, some->sensor[1], BLW_R(0.0));
        blw_guard_move_beside(self, some->sensor[0], some->sensor[1]);
        return 1U;
    }
    for (size_t j = 0U; j < some->count; j++) {
        blw_la_copy(r, &self->l[some->sensor[j] * r], l_of(self, j));
        blw_la_copy(r, &self->eta[some->sensor[j] * r], tau_of(self, j));
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
static BLW_COLD bool append(const blw_guard_t *self, blw_mask_t set, blw_guard_some_t *some)
{
    const size_t most = (self->model->most < GUARD_SOME) ? self->model->most : GUARD_SOME;
    uint8_t      i    = 0U;

    for (blw_mask_t rest = set; rest != 0U; rest >>= 1) {
        if ((rest & 1U) != 0U) {
            if (some->count >= most) {
                return false;
            }
            some->sensor[some->count]   = i;
            some->attacked[some->count] = true;
            some->count++;
        }
        i++;
    }
    return true;
}

BLW_COLD bool blw_guard_list(const blw_guard_t *self, blw_mask_t set, blw_guard_some_t *some)
{
    const blw_mask_t excluded = self->excluded;

    some->count     = 0U;
    bool room       = append(self, set & ~excluded, some);
    some->penalised = some->count;
    room            = room && append(self, set & excluded, some);
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
