/* SPDX-License-Identifier: MIT */
/* Products with S, whose blocks below the diagonal are stored sensor by sensor in strips. */
#include "blw_guard_internal.h"
#include "blw_guard_strips.h"
#include "blw_la.h"

static const blw_real_t *rows_of(const blw_guard_model_t *model, size_t i)
{
    const size_t r = model->r;

    return &model->S[(r * r * i * (i - 1U)) / 2U];
}

void blw_guard_multipliers(const blw_guard_model_t *model, const blw_real_t *tau, blw_real_t *l)
{
    const size_t      r   = model->r;
    const size_t      m   = model->head.plant->m;
    const blw_real_t *S   = model->S;
    size_t            row = 0U;

    if (model->multiply != NULL) {
        model->multiply(model->S, tau, l);
        return;
    }
    for (size_t i = 0U; i < m; i++) {
        blw_la_copy(model->rank[i], &tau[row], &l[row]); /* S_ii = diag(I, 0) */
        for (size_t a = model->rank[i]; a < r; a++) {
            l[row + a] = BLW_R(0.0);
        }
        blw_guard_both(r, row, S, &tau[row], tau, &l[row], l);
        S += r * row;
        row += r;
    }
}

void blw_guard_move(blw_guard_t *self, size_t i, const blw_real_t *step)
{
    const blw_guard_model_t *const model = self->model;
    const size_t                   r     = model->r;
    const size_t                   m     = model->head.plant->m;
    blw_real_t *const              tau   = &self->eta[i * r];
    blw_real_t *const              l     = &self->l[i * r];

    for (size_t a = 0U; a < model->rank[i]; a++) { /* S_ii = diag(I, 0) */
        tau[a] += step[a];
        l[a] += step[a];
    }
    if (model->move != NULL) {
        model->move(model->S, i, step, self->l);
        return;
    }
    if (i > 0U) {
        blw_guard_mul_t(r, i * r, 0U, i * r, rows_of(model, i), step, self->l, self->l);
    }
    for (size_t j = i + 1U; j < m; j++) {
        blw_guard_mul(r, j * r, i * r, r, rows_of(model, j), step, &self->l[j * r]);
    }
}

void blw_guard_squares(const blw_guard_model_t *model, const blw_real_t *l, blw_real_t *squares)
{
    const size_t r = model->r;
    const size_t m = model->head.plant->m;

    if (model->squares != NULL) {
        model->squares(l, squares);
        return;
    }
    for (size_t i = 0U; i < m; i++) {
        blw_real_t sum = l[0] * l[0];

        for (size_t a = 1U; a < r; a++) {
            sum += l[a] * l[a];
        }
        squares[i] = sum;
        l += r;
    }
}

void blw_guard_couple(const blw_guard_model_t *model, size_t i, size_t j, const blw_real_t *x,
                      blw_real_t *y)
{
    const size_t r = model->r;

    if (j < i) {
        blw_guard_mul(r, i * r, j * r, r, rows_of(model, i), x, y);
    } else {
        blw_guard_mul_t(r, j * r, i * r, r, rows_of(model, j), x, y, y);
    }
}

void blw_guard_row(const blw_guard_model_t *model, size_t i, size_t j, size_t a, blw_real_t *row)
{
    const size_t            r     = model->r;
    const size_t            first = a - (a % GUARD_STRIP);
    const size_t            width = ((r - first) < GUARD_STRIP) ? (r - first) : GUARD_STRIP;
    const blw_real_t *const M     = &rows_of(model, i)[(first * i * r) + (j * r * width)];

    for (size_t c = 0U; c < r; c++) {
        row[c] = M[(c * width) + (a - first)];
    }
}
