/* SPDX-License-Identifier: MIT */
/* What a gross attack has left in a filter would leave its rounding in l = S e.  Where tau_i starts
 * makes no difference to the minimum of (2), so for such sensors it starts from 0, not from e_i. */
#include "blw_guard_internal.h"
#include "blw_la.h"

/* Whether |e_i| is above a limit where other sensors can check it. */
static bool is_checked(const blw_guard_t *self, size_t i, blw_real_t limit)
{
    const size_t r    = self->model->r;
    const size_t rank = self->model->rank[i];

    return (rank == r) || (blw_la_norm(rank, &self->e[i * r]) > limit);
}

blw_mask_t blw_guard_gross(blw_guard_t *self)
{
    const size_t      m      = self->model->head.plant->m;
    const blw_real_t  limit  = self->model->gross;
    blw_real_t *const square = self->suspicion; /* until judge_sensors() */
    blw_mask_t        set    = 0U;
    size_t            count  = 0U;

    blw_guard_squares(self->model, self->e, square);
    for (size_t i = 0U; i < m; i++) {
        if ((square[i] > (limit * limit)) && is_checked(self, i, limit)) {
            set |= guard_bit(i);
            count++;
        }
    }
    return ((2U * count) <= m) ? set : 0U;
}

void blw_guard_start_without(blw_guard_t *self, blw_mask_t set)
{
    const blw_guard_model_t *const model = self->model;
    const size_t                   r     = model->r;
    size_t                         i     = 0U;

    blw_la_copy(model->head.plant->m * r, self->e, self->eta);
    for (blw_mask_t rest = set; rest != 0U; rest >>= 1) {
        if ((rest & 1U) != 0U) { /* nothing can check the rest of tau_i */
            blw_la_zero(model->rank[i], &self->eta[i * r]);
        }
        i++;
    }
    blw_guard_multipliers(model, self->eta, self->l);
    self->attacked = set;
}

blw_real_t blw_guard_test_without(blw_guard_t *self, blw_mask_t set)
{
    const size_t r       = self->model->r;
    blw_mask_t   rest    = set;
    blw_real_t   largest = BLW_R(0.0);
    blw_real_t   all     = BLW_R(0.0);

    blw_guard_start_without(self, set);
    blw_guard_squares(self->model, self->l, self->h);
    for (size_t i = 0U; i < self->model->head.plant->m; i++) {
        const size_t row = i * r;
        blw_real_t   h   = blw_la_sqrt(self->h[i]);

        if ((rest & 1U) != 0U) {
            h = blw_guard_pull(r, &self->l[row], &self->e[row], &self->eta[row], self->step);
        }
        self->h[i] = h;
        all += h;
        largest = blw_la_max(largest, h);
        rest >>= 1;
    }
    return (all <= BLW_REAL_MAX) ? (largest * largest) : all;
}
