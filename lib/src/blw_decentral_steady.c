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

/* w = N z, @return |w|^2 */
static blw_real_t whiten(blw_decentral_t *self)
{
    const size_t                        mu     = self->model->mu;
    const blw_decentral_steady_t *const steady = self->model->steady;
    const blw_real_t                   *row    = steady->N;

    for (size_t r = 0U; r < steady->d; r++) {
        self->w[r] = blw_la_dot(mu - r, row, &self->z[r]);
        row        = &row[mu - r];
    }
    return blw_la_dot(steady->d, self->w, self->w);
}

static size_t rows_of_q(const blw_decentral_model_t *model, size_t i)
{
    const size_t end = model->first[i + 1U];

    return (end < model->steady->d) ? end : model->steady->d;
}

/* q = Q_b' w */
static void project(const blw_decentral_t *self, size_t sensor, blw_real_t *q)
{
    const blw_decentral_model_t *const model = self->model;
    const blw_real_t                  *Q     = model->steady->Q;

    for (size_t i = 0U; i < sensor; i++) {
        Q = &Q[blw_decentral_mu(model, i) * rows_of_q(model, i)];
    }
    blw_la_gemv(blw_decentral_mu(model, sensor), rows_of_q(model, sensor), Q, self->w, q);
}

/* t of a set from that of its parent, (2) of decentral_fusion.py: t_b = T q_b + X t. */
static void extend(blw_decentral_t *self, size_t set, size_t before)
{
    const blw_decentral_model_t *const model  = self->model;
    const size_t                       sensor = model->sets->sensor[set];
    const size_t                       mu     = blw_decentral_mu(model, sensor);
    const blw_real_t *const            X      = &model->steady->M[model->steady->at[set]];
    const blw_real_t *const            T      = &X[mu * before];
    blw_real_t *const                  t_b    = &self->t[before];

    project(self, sensor, t_b);
    if (before == 0U) {
        return; /* T = I */
    }
    for (size_t r = mu; r-- > 0U;) { /* from below, since row r needs q_0 .. q_r */
        t_b[r] = blw_la_dot(r + 1U, &T[blw_la_packed_row(r)], t_b)
                 + blw_la_dot(before, &X[r * before], self->t);
    }
}

/* t of a set, parents first: the depth of a set is small, its parents have smaller numbers. */
static void build(blw_decentral_t *self, size_t set)
{
    const blw_decentral_sets_t *const sets   = self->model->sets;
    size_t                            before = 0U;
    size_t                            done   = 0U;

    while (done != set) {
        size_t next = set;
        while (sets->parent[next] != done) {
            next = sets->parent[next];
        }
        extend(self, next, before);
        before += blw_decentral_mu(self->model, sets->sensor[next]);
        done = next;
    }
}

static blw_real_t statistic(blw_decentral_t *self, size_t set)
{
    blw_decentral_leave_out(self, set);
    const blw_real_t g = whiten(self);
    if (set == 0U) {
        return g;
    }
    build(self, set);
    const blw_real_t explained = blw_la_dot(blw_decentral_rows(self->model, set), self->t, self->t);
    return (g > explained) ? (g - explained) : BLW_R(0.0);
}

/* dx -= Y_b s_b, with s_b = T' t_b in place; then t += X' t_b for the sensors before. */
static void correct(blw_decentral_t *self, size_t set, size_t before)
{
    const blw_decentral_model_t *const model  = self->model;
    const size_t                       n      = model->head.plant->n;
    const size_t                       sensor = model->sets->sensor[set];
    const size_t                       mu     = blw_decentral_mu(model, sensor);
    const blw_real_t *const            Y      = &model->steady->Y[model->first[sensor] * n];
    const blw_real_t *const            X      = &model->steady->M[model->steady->at[set]];
    const blw_real_t *const            T      = &X[mu * before];
    blw_real_t *const                  t_b    = &self->t[before];

    for (size_t r = 0U; (before > 0U) && (r < mu); r++) {
        const blw_real_t t_r = t_b[r];
        blw_la_axpy(before, t_r, &X[r * before], self->t);
        t_b[r] = BLW_R(0.0);
        blw_la_axpy(r + 1U, t_r, &T[blw_la_packed_row(r)], t_b);
    }
    for (size_t r = 0U; r < mu; r++) {
        blw_la_axpy(n, -t_b[r], &Y[r * n], self->dx);
    }
}

static void estimate(blw_decentral_t *self, size_t set)
{
    const blw_decentral_model_t *const model  = self->model;
    size_t                             before = blw_decentral_rows(model, set);

    blw_la_gemv(model->head.plant->n, model->mu, model->steady->Psi, self->z, self->dx);
    for (size_t rest = set; rest != 0U; rest = model->sets->parent[rest]) {
        before -= blw_decentral_mu(model, model->sets->sensor[rest]);
        correct(self, rest, before);
    }
}

/* w += N_i delta_i */
static void put_back(blw_decentral_t *self, size_t sensor)
{
    const blw_decentral_model_t *const model = self->model;
    const size_t                       begin = model->first[sensor];
    const size_t                       end   = model->first[sensor + 1U];
    const size_t                       rows  = rows_of_q(model, sensor);
    const blw_real_t                  *row   = model->steady->N;

    for (size_t r = 0U; r < rows; r++) {
        const size_t from = (begin > r) ? begin : r;
        self->w[r] += blw_la_dot(end - from, &row[from - r], &self->delta[from]);
        row = &row[model->mu - r];
    }
}

static blw_real_t all_statistic(blw_decentral_t *self, size_t set)
{
    const blw_decentral_sets_t *const sets = self->model->sets;

    for (size_t rest = set; rest != 0U; rest = sets->parent[rest]) {
        put_back(self, sets->sensor[rest]);
    }
    return blw_la_dot(self->model->steady->d, self->w, self->w);
}

/* delta_i = -R_i^-1 s_i; estimate() has left s in self->t. */
static BLW_COLD void reseed_sensor(blw_decentral_t *self, size_t sensor, const blw_real_t *s)
{
    const blw_decentral_model_t *const model = self->model;
    const size_t                       mu    = blw_decentral_mu(model, sensor);
    blw_real_t *const                  delta = &self->delta[model->first[sensor]];
    const blw_real_t                  *H     = model->steady->H;

    for (size_t i = 0U; i < sensor; i++) {
        H = &H[blw_la_packed_row(blw_decentral_mu(model, i))];
    }
    blw_la_fill(mu, BLW_R(0.0), delta);
    for (size_t r = 0U; r < mu; r++) {
        blw_la_axpy(r + 1U, -s[r], &H[blw_la_packed_row(r)], delta);
    }
}

static BLW_COLD void reseed(blw_decentral_t *self, size_t set)
{
    const blw_decentral_model_t *const model  = self->model;
    size_t                             before = blw_decentral_rows(model, set);

    for (size_t rest = set; rest != 0U; rest = model->sets->parent[rest]) {
        const size_t sensor = model->sets->sensor[rest];
        before -= blw_decentral_mu(model, sensor);
        reseed_sensor(self, sensor, &self->t[before]);
    }
}

/* Numbers of the tables that are kept per sensor. */
typedef struct lengths {
    size_t F;
    size_t Q;
    size_t H;
} lengths_t;

static lengths_t lengths_of(const blw_decentral_model_t *model)
{
    lengths_t len = {0U, 0U, 0U};

    for (size_t i = 0U; i < model->head.plant->m; i++) {
        const size_t mu = blw_decentral_mu(model, i);
        len.F += mu * mu;
        len.Q += mu * rows_of_q(model, i);
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
    const lengths_t len = lengths_of(model);
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
