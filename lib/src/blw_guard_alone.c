/* SPDX-License-Identifier: MIT */
/* One sensor alone.
 *
 * Since S_ii = diag(I, 0), the minimum of (2) over nu_i alone is (3), and with
 * s = min(1, k_i / |h_i|) it moves tau_i, and l_i, by
 *     step = s h_i - l_i.                                                                    (7)
 * tau is kept rather than nu: it stays at noise size however large the attack, and a sensor that
 * leaves the support gets tau_i = e_i exactly.  Where tau_i starts makes no difference to the
 * minimum: after a gross attack it starts from 0, and l = S tau holds no rounding of what was
 * sent. */
#include "blw_guard_internal.h"
#include "blw_la.h"

blw_real_t blw_guard_pull(size_t r, const blw_real_t *l, const blw_real_t *e, const blw_real_t *tau,
                          blw_real_t *h)
{
    blw_real_t sum = BLW_R(0.0);

    for (size_t a = 0U; a < r; a++) {
        h[a] = l[a] + (e[a] - tau[a]);
        sum += h[a] * h[a];
    }
    return blw_la_sqrt(sum);
}

blw_real_t blw_guard_step_alone(size_t r, blw_real_t k, const blw_real_t *l, const blw_real_t *e,
                                const blw_real_t *tau, blw_real_t *step, blw_real_t *square)
{
    const blw_real_t h   = blw_guard_pull(r, l, e, tau, step);
    const blw_real_t s   = (h > k) ? (k / h) : BLW_R(1.0);
    blw_real_t       sum = BLW_R(0.0);

    for (size_t a = 0U; a < r; a++) {
        step[a] = (s * step[a]) - l[a];
        sum += step[a] * step[a];
    }
    *square = sum;
    return h;
}

void blw_guard_move_to(blw_guard_t *self, size_t i, const blw_real_t *step, bool attacked)
{
    const size_t r = self->model->r;

    blw_guard_move(self, i, step);
    self->attacked |= guard_bit(i);
    if (!attacked) {
        blw_la_copy(r, &self->e[i * r], &self->eta[i * r]);
        self->attacked &= ~guard_bit(i);
    }
}

void blw_guard_move_alone(blw_guard_t *self, size_t i, blw_real_t k)
{
    const size_t      r      = self->model->r;
    const size_t      row    = i * r;
    blw_real_t *const step   = self->turned;
    blw_real_t        square = BLW_R(0.0);
    const blw_real_t  h =
        blw_guard_step_alone(r, k, &self->l[row], &self->e[row], &self->eta[row], step, &square);

    blw_guard_move_to(self, i, step, h > k);
}

static void note_step(blw_guard_view_t *view, size_t i, blw_real_t length)
{
    if (length > view->largest) {
        view->largest = length;
        view->sensor  = i;
    }
}

void blw_guard_survey(blw_guard_t *self, blw_guard_view_t *view)
{
    const size_t     r        = self->model->r;
    const blw_real_t k        = self->model->k;
    blw_real_t      *h        = self->h;
    blw_mask_t       excluded = self->excluded;
    blw_mask_t       attacked = self->attacked;

    view->pending = BLW_R(0.0);
    view->largest = BLW_R(0.0);
    view->l       = BLW_R(0.0);
    blw_guard_squares(self->model, self->l, h);
    for (size_t i = 0U; i < self->model->head.plant->m; i++) {
        const size_t row  = i * r;
        blw_real_t   step = blw_la_sqrt(h[i]);

        h[i]    = step;
        view->l = blw_la_max(view->l, step);
        if ((excluded & 1U) != 0U) {
            h[i] = blw_guard_pull(r, &self->l[row], &self->e[row], &self->eta[row], self->step);
        } else if ((attacked & 1U) != 0U) {
            h[i] = blw_guard_step_alone(r, k, &self->l[row], &self->e[row], &self->eta[row],
                                        self->step, &step);
            step = blw_la_sqrt(step);
        } else {
            step -= k;
        }
        if (step > BLW_R(0.0)) {
            view->pending += self->model->effect[i] * step;
            note_step(view, i, step);
        }
        attacked >>= 1;
        excluded >>= 1;
    }
}

bool blw_guard_begin(blw_guard_t *self)
{
    const blw_guard_model_t *const model = self->model;
    const size_t                   m     = model->head.plant->m;
    bool                           gross = false;

    if (self->attacked != 0U) {
        return false;
    }
    for (size_t i = 0U; i < m; i++) {
        gross = gross || (self->h[i] > (GUARD_GROSS * model->k));
    }
    blw_la_copy(m * model->r, self->e, self->eta);
    return gross;
}
