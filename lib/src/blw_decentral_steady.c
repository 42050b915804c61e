/* SPDX-License-Identifier: MIT */
/* Steady-state gains: all that is factored comes as tables. */
#include "blw_cold.h"
#include "blw_decentral_internal.h"
#include "blw_la.h"

static void advance(blw_decentral_t *self)
{
    const blw_decentral_model_t *const  model  = self->model;
    const blw_decentral_steady_t *const steady = model->steady;
    const blw_real_t                   *F      = steady->F;

    for (size_t i = 0U; i < model->head.plant->m; i++) {
        const size_t mu    = blw_decentral_mu(model, i);
        const size_t first = model->first[i];
        blw_la_gemv(mu, mu, F, &self->delta[first], &self->z[first]);
        blw_la_axpy(mu, self->nu[i], &steady->K[first], &self->z[first]);
        F = &F[mu * mu];
    }
    blw_la_copy(model->mu, self->z, self->delta);
}

/* w += N x with the columns of N from begin to end only. */
static void add_columns(blw_decentral_t *self, size_t begin, size_t end, const blw_real_t *x)
{
    const size_t                        mu     = self->model->mu;
    const blw_decentral_steady_t *const steady = self->model->steady;
    const size_t                        rows   = (end < steady->d) ? end : steady->d;
    const blw_real_t                   *row    = steady->N;

    for (size_t r = 0U; r < rows; r++) {
        const size_t from = (begin > r) ? begin : r;
        self->w[r] += blw_la_dot(end - from, &row[from - r], &x[from]);
        row = &row[mu - r];
    }
}

/* |w|^2 */
static blw_real_t squared(const blw_decentral_t *self)
{
    return blw_la_dot(self->model->steady->d, self->w, self->w);
}

static size_t rows_of_q(const blw_decentral_model_t *model, size_t i)
{
    const size_t end = model->first[i + 1U];

    return (end < model->steady->d) ? end : model->steady->d;
}

/* Numbers of the sensors before one, in the tables that are kept per sensor. */
typedef struct offsets {
    size_t F;
    size_t Q;
    size_t H;
} offsets_t;

static offsets_t offsets_of(const blw_decentral_model_t *model, size_t sensor)
{
    offsets_t at = {0U, 0U, 0U};

    for (size_t i = 0U; i < sensor; i++) {
        const size_t mu = blw_decentral_mu(model, i);
        at.F += mu * mu;
        at.Q += mu * rows_of_q(model, i);
        at.H += blw_la_packed_row(mu);
    }
    return at;
}

/* t of a set from that of its parent, (2) of decentral_fusion.py: t_b = X t + T q_b, q_b = Q_b' w,
 * from below, since row r needs q_0 .. q_r.  A sensor alone has T = I and no rows.
 * @return how many t are then */
static size_t extend(blw_decentral_t *self, size_t set, size_t before)
{
    const blw_decentral_model_t *const  model  = self->model;
    const blw_decentral_steady_t *const steady = model->steady;
    const size_t                        sensor = model->sets->sensor[set];
    const size_t                        mu     = blw_decentral_mu(model, sensor);
    const blw_real_t *const             Q      = &steady->Q[offsets_of(model, sensor).Q];
    size_t                              len    = before + mu;

    blw_la_gemv(mu, rows_of_q(model, sensor), Q, self->w, &self->t[before]);
    for (size_t at = steady->at[set + 1U]; at > steady->at[set]; len--) {
        at -= len;
        self->t[len - 1U] = blw_la_dot(len, &steady->M[at], self->t);
    }
    return before + mu;
}

/* t of a set, parents first: the depth of a set is small, its parents have smaller numbers.
 * @return |t|^2 */
static blw_real_t build(blw_decentral_t *self, size_t set)
{
    const uint16_t *const parent = self->model->sets->parent;
    size_t                rows   = 0U;
    size_t                done   = 0U;

    while (done != set) {
        size_t next = set;
        while (parent[next] != done) {
            next = parent[next];
        }
        rows = extend(self, next, rows);
        done = next;
    }
    return blw_la_dot(rows, self->t, self->t);
}

static blw_real_t statistic(blw_decentral_t *self, size_t set)
{
    blw_decentral_leave_out(self, set);
    blw_la_zero(self->model->steady->d, self->w);
    add_columns(self, 0U, self->model->mu, self->z);
    const blw_real_t g = squared(self);
    if (set == 0U) {
        return g;
    }
    const blw_real_t explained = build(self, set);
    return (g > explained) ? (g - explained) : BLW_R(0.0);
}

/* s_b = T' t_b in place, t += X' t_b for the sensors before, and dx -= Y_b s_b.
 * @return how many t are left */
static size_t correct(blw_decentral_t *self, size_t set, size_t rows)
{
    const blw_decentral_model_t *const  model  = self->model;
    const blw_decentral_steady_t *const steady = model->steady;
    const size_t                        n      = model->head.plant->n;
    const size_t                        sensor = model->sets->sensor[set];
    const size_t                        before = rows - blw_decentral_mu(model, sensor);
    const blw_real_t                   *Y      = &steady->Y[model->first[sensor] * n];
    const blw_real_t                   *row    = &steady->M[steady->at[set]];
    blw_real_t *const                   t      = self->t;

    for (size_t r = before; (before > 0U) && (r < rows); r++) {
        const blw_real_t t_r = t[r];
        t[r]                 = BLW_R(0.0);
        blw_la_axpy(r + 1U, t_r, row, t);
        row = &row[r + 1U];
    }
    for (size_t r = before; r < rows; r++) {
        blw_la_axpy(n, -t[r], Y, self->dx);
        Y = &Y[n];
    }
    return before;
}

static void estimate(blw_decentral_t *self, size_t set)
{
    const blw_decentral_model_t *const model = self->model;
    size_t                             rows  = blw_decentral_rows(model, set);

    blw_la_gemv(model->head.plant->n, model->mu, model->steady->Psi, self->z, self->dx);
    for (size_t rest = set; rest != 0U; rest = model->sets->parent[rest]) {
        rows = correct(self, rest, rows);
    }
}

static blw_real_t all_statistic(blw_decentral_t *self, size_t set)
{
    const blw_decentral_sets_t *const sets  = self->model->sets;
    const uint16_t *const             first = self->model->first;

    for (size_t rest = set; rest != 0U; rest = sets->parent[rest]) {
        const size_t sensor = sets->sensor[rest];
        add_columns(self, first[sensor], first[sensor + 1U], self->delta);
    }
    return squared(self);
}

/* delta_i = -R_i^-1 s_i; estimate() has left s in self->t. */
static BLW_COLD void reseed(blw_decentral_t *self, size_t set)
{
    const blw_decentral_model_t *const model = self->model;
    const blw_real_t                  *s     = &self->t[blw_decentral_rows(model, set)];

    for (size_t rest = set; rest != 0U; rest = model->sets->parent[rest]) {
        const size_t            sensor = model->sets->sensor[rest];
        const size_t            mu     = blw_decentral_mu(model, sensor);
        blw_real_t *const       delta  = &self->delta[model->first[sensor]];
        const blw_real_t *const H      = &model->steady->H[offsets_of(model, sensor).H];

        s -= mu;
        blw_la_zero(mu, delta);
        for (size_t r = 0U; r < mu; r++) {
            blw_la_axpy(r + 1U, -s[r], &H[blw_la_packed_row(r)], delta);
        }
    }
}

/* Whether `at` fits the sets. */
static bool removals_ok(const blw_decentral_model_t *model)
{
    const blw_decentral_steady_t *const steady = model->steady;

    if ((steady->at == NULL) || (steady->at[0] != 0U)) {
        return false;
    }
    for (size_t set = 0U; set < model->sets->n_sets; set++) {
        const size_t rows   = blw_decentral_rows(model, set);
        const size_t before = blw_decentral_rows(model, model->sets->parent[set]);
        const size_t len =
            (before > 0U) ? (blw_la_packed_row(rows) - blw_la_packed_row(before)) : 0U;
        if (steady->at[set + 1U] != (steady->at[set] + len)) {
            return false;
        }
    }
    return true;
}

static BLW_COLD void add(const blw_decentral_model_t *model, blw_table_check_t *check)
{
    const blw_decentral_steady_t *const steady = model->steady;
    const size_t                        n      = model->head.plant->n;
    const size_t                        mu     = model->mu;
    const size_t                        d      = mu - n;

    if ((steady == NULL) || (steady->d != d) || !removals_ok(model)) {
        check->ok = false;
        return;
    }
    const offsets_t len = offsets_of(model, model->head.plant->m);
    blw_table_add(check, steady->F, len.F);
    blw_table_add(check, steady->K, mu);
    blw_table_add(check, steady->N, (d * mu) - ((d * (d - 1U)) / 2U));
    blw_table_add(check, steady->Psi, n * mu);
    blw_table_add(check, steady->Q, len.Q);
    blw_table_add(check, steady->Y, mu * n);
    blw_table_add(check, steady->H, (model->reseed != 0U) ? len.H : 0U);
    blw_table_add(check, steady->M, steady->at[model->sets->n_sets]);
}

const blw_decentral_gains_t blw_decentral_steady_ops = {
    .add           = add,
    .reset         = NULL,
    .advance       = advance,
    .statistic     = statistic,
    .estimate      = estimate,
    .all_statistic = all_statistic,
    .reseed        = reseed,
};
