/* SPDX-License-Identifier: MIT */
/* Several sensors at once: factors of S_II, Newton steps, and the search over all sets.
 *
 * Removing I lowers the least squares (2) without penalty by l_I' S_II^-1 l_I / 2.           (6) */
#include "blw_cold.h"
#include "blw_guard_internal.h"
#include "blw_la.h"

/* A Newton step may shorten an attack to this part of its length, not further. */
#define SHORTEST BLW_R(0.05)

/* Row a of sensor i in S_II up to its diagonal. */
static BLW_COLD void gather_row(const blw_guard_t *self, blw_mask_t set, size_t i, size_t a,
                                blw_real_t *to)
{
    const blw_guard_model_t *const model = self->model;

    for (size_t j = 0U; j < i; j++) {
        if (guard_has(set, j)) {
            blw_guard_row(model, i, j, a, to);
            to += model->r;
        }
    }
    blw_la_zero(a, to);
    to[a] = (a < model->rank[i]) ? BLW_R(1.0) : BLW_R(0.0);
}

BLW_COLD size_t blw_guard_gather(const blw_guard_t *self, blw_mask_t set)
{
    size_t row = 0U;

    for (size_t i = 0U; i < self->model->head.plant->m; i++) {
        for (size_t a = 0U; guard_has(set, i) && (a < self->model->r); a++) {
            gather_row(self, set, i, a, &self->L[blw_la_packed_row(row)]);
            row++;
        }
    }
    return row;
}

BLW_COLD void blw_guard_factor(const blw_guard_t *self, size_t rows)
{
    for (size_t i = 0U; i < rows; i++) {
        blw_real_t *const Li = &self->L[blw_la_packed_row(i)];

        for (size_t j = 0U; j < i; j++) {
            const blw_real_t *const Lj = &self->L[blw_la_packed_row(j)];

            Li[j] = (Lj[j] > BLW_R(0.0)) ? ((Li[j] - blw_la_dot(j, Li, Lj)) / Lj[j]) : BLW_R(0.0);
        }
        const blw_real_t pivot = Li[i] - blw_la_dot(i, Li, Li);
        Li[i]                  = (pivot > GUARD_PIVOT_MIN) ? blw_la_sqrt(pivot) : BLW_R(0.0);
    }
}

BLW_COLD blw_real_t blw_guard_reduce(const blw_guard_t *self, size_t rows, blw_real_t *x)
{
    blw_real_t total = BLW_R(0.0);

    for (size_t i = 0U; i < rows; i++) {
        const blw_real_t *const Li = &self->L[blw_la_packed_row(i)];

        x[i] = (Li[i] > BLW_R(0.0)) ? ((x[i] - blw_la_dot(i, Li, x)) / Li[i]) : BLW_R(0.0);
        total += x[i] * x[i];
    }
    return total;
}

BLW_COLD void blw_guard_expand(const blw_guard_t *self, size_t rows, blw_real_t *x)
{
    for (size_t i = rows; i-- > 0U;) {
        const blw_real_t *const Li = &self->L[blw_la_packed_row(i)];

        if (Li[i] > BLW_R(0.0)) { /* otherwise x_i is 0 */
            x[i] /= Li[i];
            blw_la_axpy(i, -x[i], Li, x);
        }
    }
}

/* Right side l_i - k nu_i / |nu_i| of the Newton step for one sensor with a penalty, and its
 * curvature k (I - nu_i nu_i' / |nu_i|^2) / |nu_i| on the diagonal of S_II from `row` on. */
static BLW_COLD void add_penalty(const blw_guard_t *self, size_t i, size_t row, blw_real_t *right)
{
    const size_t            r     = self->model->r;
    const blw_real_t *const e     = &self->e[i * r];
    const blw_real_t *const tau   = &self->eta[i * r];
    blw_real_t              total = BLW_R(0.0);

    for (size_t a = 0U; a < r; a++) {
        total += (e[a] - tau[a]) * (e[a] - tau[a]);
    }
    const blw_real_t bend = self->model->k / blw_la_sqrt(total);
    for (size_t a = 0U; a < r; a++) {
        blw_real_t *const La = &self->L[blw_la_packed_row(row + a) + row];

        right[a] -= bend * (e[a] - tau[a]);
        for (size_t c = 0U; c <= a; c++) {
            La[c] -= (bend / total) * (e[a] - tau[a]) * (e[c] - tau[c]);
        }
        La[a] += bend;
    }
}

/* Whether nu_i keeps its side, and its length by and large, if `step` is added to it. */
static BLW_COLD bool within_reach(const blw_guard_t *self, size_t i, const blw_real_t *step)
{
    const size_t            r      = self->model->r;
    const blw_real_t *const e      = &self->e[i * r];
    const blw_real_t *const tau    = &self->eta[i * r];
    blw_real_t              before = BLW_R(0.0);
    blw_real_t              after  = BLW_R(0.0);

    for (size_t a = 0U; a < r; a++) {
        const blw_real_t nu = e[a] - tau[a];

        before += nu * nu;
        after += nu * (nu + step[a]);
    }
    return after >= (SHORTEST * before);
}

/* The Newton step into self->step.  @return whether it is within reach. */
static BLW_COLD BLW_APART bool find_step(blw_guard_t *self, blw_mask_t set)
{
    const size_t r    = self->model->r;
    const size_t m    = self->model->head.plant->m;
    const size_t rows = blw_guard_gather(self, set);
    size_t       row  = 0U;
    bool         good = true;

    for (size_t i = 0U; i < m; i++) {
        if (!guard_has(set, i)) {
            continue;
        }
        blw_la_copy(r, &self->l[i * r], &self->step[row]);
        if (!guard_has(self->excluded, i)) {
            add_penalty(self, i, row, &self->step[row]);
        }
        row += r;
    }
    blw_guard_factor(self, rows);
    (void)blw_guard_reduce(self, rows, self->step);
    blw_guard_expand(self, rows, self->step);
    row = 0U;
    for (size_t i = 0U; i < m; i++) {
        if (guard_has(set & ~self->excluded, i)) {
            good = good && within_reach(self, i, &self->step[row]);
        }
        row += guard_has(set, i) ? r : 0U;
    }
    return good;
}

BLW_COLD bool blw_guard_newton(blw_guard_t *self, blw_mask_t set)
{
    const blw_guard_model_t *const model = self->model;
    const size_t                   r     = model->r;
    blw_real_t                    *step  = self->step;

    if (!find_step(self, set)) {
        return false;
    }
    for (size_t i = 0U; i < model->head.plant->m; i++) {
        if (!guard_has(set, i)) {
            continue;
        }
        for (size_t a = 0U; a < r; a++) {
            step[a] = (a < model->rank[i]) ? -step[a] : BLW_R(0.0);
        }
        blw_guard_move(self, i, step);
        step += r;
    }
    self->attacked |= set;
    return true;
}

/* The largest |h_i| of the sensors outside a set, 0 if there is none; and whose it is. */
static BLW_COLD blw_real_t largest_outside(const blw_guard_t *self, blw_mask_t set, size_t *sensor)
{
    const size_t m       = self->model->head.plant->m;
    blw_real_t   largest = BLW_R(0.0);

    for (size_t i = 0U; i < m; i++) {
        if (((set & 1U) == 0U) && (self->h[i] > largest)) {
            largest = self->h[i];
            *sensor = i;
        }
        set >>= 1;
    }
    return largest;
}

/* Sensors of the unit of sensor i. */
static BLW_COLD blw_mask_t unit_of(const blw_guard_model_t *model, size_t i)
{
    const size_t m   = model->head.plant->m;
    blw_mask_t   set = guard_bit(i);

    for (size_t j = 0U; (model->n_units < m) && (j < m); j++) {
        set |= (model->unit[j] == model->unit[i]) ? guard_bit(j) : 0U;
    }
    return set;
}

BLW_COLD bool blw_guard_stands_out(const blw_guard_t *self, blw_mask_t set, blw_real_t margin)
{
    blw_real_t least = BLW_REAL_MAX;         /* inside */
    blw_real_t most  = self->model->exclude; /* outside */

    for (size_t i = 0U; i < self->model->head.plant->m; i++) {
        const blw_real_t h = self->h[i];

        if ((set & 1U) == 0U) {
            most = blw_la_max(most, h);
        } else if (h < least) {
            least = h;
        } else {
            /* another one is nearer */
        }
        set >>= 1;
    }
    return (least - most) > margin;
}

BLW_COLD blw_mask_t blw_guard_choose(const blw_guard_t *self, blw_real_t margin, bool *clear)
{
    const blw_guard_model_t *const model  = self->model;
    const size_t                   p      = model->head.plant->p;
    blw_mask_t                     chosen = 0U;
    size_t                         sensor = 0U;

    for (size_t taken = 0U; taken < p; taken++) {
        if (!(largest_outside(self, chosen, &sensor) > model->exclude)) {
            *clear = false;
            return chosen;
        }
        chosen |= unit_of(model, sensor);
    }
    *clear = blw_guard_stands_out(self, chosen, margin);
    return chosen;
}

/* Sensors of the units in `units`. */
static BLW_COLD blw_mask_t sensors_of(const blw_guard_model_t *model, blw_mask_t units)
{
    blw_mask_t sensors = 0U;

    for (size_t i = 0U; i < model->head.plant->m; i++) {
        sensors |= guard_has(units, model->unit[i]) ? guard_bit(i) : 0U;
    }
    return sensors;
}

/* The next larger number with as many bits set; units /= 0. */
static BLW_COLD blw_mask_t next_of_same_size(blw_mask_t units)
{
    const blw_mask_t low    = units & (~units + 1U);
    const blw_mask_t ripple = units + low;

    return (ripple == 0U) ? 0U : (ripple | (((units ^ ripple) >> 2) / low));
}

/* (6) for two sensors with V and s: |l_j|^2 + g' (S_ii - S_ij S_ji)^-1 g, g = l_i - S_ij l_j. */
static BLW_COLD blw_real_t explained_by_two(const blw_guard_t *self, size_t i, size_t j)
{
    const size_t            r    = self->model->r;
    const blw_real_t *const l_j  = &self->l[j * r];
    blw_real_t *const       sent = self->turned;
    blw_real_t *const       g    = &self->turned[r];
    blw_real_t *const       y    = &self->turned[3U * r];

    for (size_t a = 0U; a < r; a++) {
        sent[a] = -l_j[a];
        g[a]    = self->l[(i * r) + a];
    }
    blw_guard_couple(self->model, i, j, sent, g);
    blw_guard_divide(self->model, i, j, g, &self->turned[2U * r], y);
    return blw_la_dot(r, l_j, l_j) + blw_la_dot(r, g, y);
}

/* (6) for one set. */
static BLW_COLD blw_real_t explained_by(const blw_guard_t *self, blw_mask_t set)
{
    const size_t     r  = self->model->r;
    blw_real_t      *to = self->step;
    blw_guard_some_t some;

    if ((self->model->pairs != 0U) && blw_guard_list(self, set, &some) && (some.count == 2U)) {
        return explained_by_two(self, some.sensor[0], some.sensor[1]);
    }
    const size_t rows = blw_guard_gather(self, set);

    for (size_t i = 0U; i < self->model->head.plant->m; i++) {
        if (guard_has(set, i)) {
            blw_la_copy(r, &self->l[i * r], to);
            to += r;
        }
    }
    blw_guard_factor(self, rows);
    return blw_guard_reduce(self, rows, self->step);
}

BLW_COLD blw_mask_t blw_guard_search(blw_guard_t *self, blw_mask_t known)
{
    const blw_guard_model_t *const model = self->model;
    const blw_mask_t               all   = BLW_MASK_ALL(model->n_units);
    blw_mask_t                     units = BLW_MASK_ALL(model->head.plant->p);
    blw_mask_t                     best  = sensors_of(model, units);
    blw_real_t                     most  = BLW_R(-1.0);

    if (known != 0U) {
        most = explained_by(self, known) + (BLW_R(0.25) * model->k * model->k);
        best = known;
    }
    while ((units != 0U) && (units <= all)) {
        const blw_mask_t set       = sensors_of(model, units);
        const blw_real_t explained = explained_by(self, set);

        if (explained > most) {
            most = explained;
            best = set;
        }
        units = next_of_same_size(units);
    }
    return best;
}
