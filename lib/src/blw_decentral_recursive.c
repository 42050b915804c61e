/* SPDX-License-Identifier: MIT */
/* Gains from a recursion: the stacked covariance of [D] (23) is propagated as P = L L', which keeps
 * it symmetric and positive semidefinite and halves the digits that float loses:
 *
 *     X_i = [S_i L_i  V_i]   X X' = A-step of (10d), (17)                                    (1)
 *     a_i = t_i X_i,   K_i = X_i a_i' / (a_i a_i' + R_ii)                                    (2)
 *     L L' = [X_i - K_i a_i,  K_i E_i] [...]'                                                (3)
 *
 * (3) by Householder reflections of the columns.  Fusion: the least-squares problem
 * min |L^-1 (z - E_e a - Phi dx)| over an unknown offset a of the excluded rows and dx, again by
 * Householder reflections; its residual is g_J. */
#include "blw_cold.h"
#include "blw_decentral_internal.h"
#include "blw_la.h"

/* Smallest |L_ii| relative to its row that may be divided by. */
#define PIVOT_MIN (BLW_R(32.0) * BLW_REAL_EPS)

/* What is left of a row that depends on those above is rounding: smaller squares count as 0. */
#define SQUARE_MIN BLW_R(1e-30)

static size_t width_of(const blw_decentral_model_t *model)
{
    return (size_t)model->mu + model->head.plant->n + model->head.plant->m;
}

/* The reflection of x [len] onto its first axis: v replaces x, the image is returned.
 * *beta = 2 / v'v, or 0 if there is nothing to reflect. */
static blw_real_t reflector(size_t len, blw_real_t *x, blw_real_t *beta)
{
    const blw_real_t norm  = blw_la_norm(len, x);
    const blw_real_t first = x[0];
    const blw_real_t image = (first > BLW_R(0.0)) ? -norm : norm;
    x[0]                   = first - image;
    const blw_real_t half  = norm * blw_la_abs(x[0]); /* v'v / 2 = norm (norm + |first|) */
    *beta                  = (half > SQUARE_MIN) ? (BLW_R(1.0) / half) : BLW_R(0.0);
    return image;
}

/* y -= beta (v'y) v */
static void reflect(size_t len, blw_real_t beta, const blw_real_t *v, blw_real_t *y)
{
    blw_la_axpy(len, -(beta * blw_la_dot(len, v, y)), v, y);
}

/* X [rows x width] to lower trapezoidal by reflections from the right, packed into L. */
static void triangularise(blw_decentral_t *self)
{
    const size_t mu    = self->model->mu;
    const size_t width = width_of(self->model);

    for (size_t r = 0U; r < mu; r++) {
        blw_real_t *const row   = &self->X[r * width];
        blw_real_t        beta  = BLW_R(0.0);
        const blw_real_t  image = reflector(width - r, &row[r], &beta);
        for (size_t below = r + 1U; below < mu; below++) {
            reflect(width - r, beta, &row[r], &self->X[(below * width) + r]);
        }
        row[r] = image;
        blw_la_copy(r + 1U, row, &self->L[blw_la_packed_row(r)]);
    }
}

/* Whether L can be inverted: it cannot before every local state has met some noise. */
static bool invertible(const blw_decentral_t *self)
{
    for (size_t r = 0U; r < self->model->mu; r++) {
        const blw_real_t *const row   = &self->L[blw_la_packed_row(r)];
        const blw_real_t        size2 = blw_la_dot(r + 1U, row, row);
        if (!((row[r] * row[r]) > ((PIVOT_MIN * PIVOT_MIN) * size2))) {
            return false;
        }
    }
    return true;
}

static BLW_COLD void reset(blw_decentral_t *self)
{
    const size_t mu    = self->model->mu;
    const size_t n     = self->model->head.plant->n;
    const size_t width = width_of(self->model);

    blw_la_zero(mu * width, self->X);
    for (size_t row = 0U; row < mu; row++) {
        blw_la_copy(n, &self->model->recursive->L0[row * n], &self->X[row * width]);
    }
    triangularise(self);
    self->usable = invertible(self);
}

/* X_i of (1), S points to S_i */
static void predict_factor(blw_decentral_t *self, size_t sensor, const blw_real_t *S)
{
    const blw_decentral_model_t *const model = self->model;
    const size_t                       n     = model->head.plant->n;
    const size_t                       mu    = blw_decentral_mu(model, sensor);
    const size_t                       first = model->first[sensor];
    const size_t                       width = width_of(model);

    for (size_t r = 0U; r < mu; r++) {
        blw_real_t *const row = &self->X[(first + r) * width];
        blw_la_zero(width, row);
        for (size_t b = 0U; b < mu; b++) {
            blw_la_axpy(first + b + 1U, S[(r * mu) + b], &self->L[blw_la_packed_row(first + b)],
                        row);
        }
        blw_la_copy(n, &model->recursive->V[(first + r) * n], &row[model->mu]);
    }
}

/* (2), (3) and the local filter (10a) of one sensor; z_i holds S_i delta_i. */
static void correct_factor(blw_decentral_t *self, size_t sensor)
{
    const blw_decentral_model_t *const model = self->model;
    const size_t                       n     = model->head.plant->n;
    const size_t                       mu    = blw_decentral_mu(model, sensor);
    const size_t                       first = model->first[sensor];
    const size_t                       width = width_of(model);
    const size_t                       used  = (size_t)model->mu + n;
    const blw_real_t *const            t     = &model->recursive->t[first];
    const blw_real_t *const            E     = &model->recursive->E[blw_la_packed_row(sensor)];
    blw_real_t *const                  a     = self->w;

    blw_la_zero(used, a);
    for (size_t r = 0U; r < mu; r++) {
        blw_la_axpy(used, t[r], &self->X[(first + r) * width], a);
    }
    const blw_real_t per_S = BLW_R(1.0) / (blw_la_dot(used, a, a) + blw_la_dot(sensor + 1U, E, E));
    const blw_real_t nu    = self->nu[sensor] - blw_la_dot(mu, t, &self->z[first]);
    for (size_t r = 0U; r < mu; r++) {
        blw_real_t *const row = &self->X[(first + r) * width];
        const blw_real_t  K   = blw_la_dot(used, row, a) * per_S;
        blw_la_axpy(used, -K, a, row);
        blw_la_axpy(sensor + 1U, K, E, &row[used]);
        self->delta[first + r] = self->z[first + r] + (K * nu);
    }
}

static void advance(blw_decentral_t *self)
{
    const blw_decentral_model_t *const model = self->model;
    const blw_real_t                  *S     = model->recursive->S;

    for (size_t i = 0U; i < model->head.plant->m; i++) {
        const size_t mu    = blw_decentral_mu(model, i);
        const size_t first = model->first[i];
        blw_la_gemv(mu, mu, S, &self->delta[first], &self->z[first]);
        predict_factor(self, i, S);
        correct_factor(self, i);
        S = &S[mu * mu];
    }
    triangularise(self);
    self->usable = invertible(self);
}

/* Columns of L^-1 [E_e  Phi  z], each [mu]; @return their number without z. */
static size_t whiten_columns(blw_decentral_t *self, size_t set)
{
    const blw_decentral_model_t *const model   = self->model;
    const size_t                       mu      = model->mu;
    const size_t                       n       = model->head.plant->n;
    size_t                             columns = 0U;

    for (size_t rest = set; rest != 0U; rest = model->sets->parent[rest]) {
        const size_t sensor = model->sets->sensor[rest];
        for (size_t r = model->first[sensor]; r < model->first[sensor + 1U]; r++) {
            blw_la_zero(mu, &self->X[columns * mu]);
            self->X[(columns * mu) + r] = BLW_R(1.0);
            columns++;
        }
    }
    for (size_t j = 0U; j < n; j++) {
        for (size_t r = 0U; r < mu; r++) {
            self->X[(columns * mu) + r] = model->Phi[(r * n) + j];
        }
        columns++;
    }
    blw_la_copy(mu, self->z, &self->X[columns * mu]);
    for (size_t j = 0U; j <= columns; j++) {
        blw_la_solve_lower(mu, self->L, &self->X[j * mu]);
    }
    return columns;
}

static blw_real_t statistic(blw_decentral_t *self, size_t set)
{
    const size_t mu = self->model->mu;

    blw_decentral_leave_out(self, set);
    if (!self->usable) {
        return BLW_R(0.0);
    }
    const size_t      columns = whiten_columns(self, set);
    blw_real_t *const rhs     = &self->X[columns * mu];
    for (size_t j = 0U; j < columns; j++) {
        blw_real_t *const column = &self->X[j * mu];
        blw_real_t        beta   = BLW_R(0.0);
        const blw_real_t  image  = reflector(mu - j, &column[j], &beta);
        for (size_t other = j + 1U; other <= columns; other++) {
            reflect(mu - j, beta, &column[j], &self->X[(other * mu) + j]);
        }
        column[j] = image;
    }
    return blw_la_dot(mu - columns, &rhs[columns], &rhs[columns]);
}

static void estimate(blw_decentral_t *self, size_t set)
{
    const blw_decentral_model_t *const model = self->model;
    const size_t                       mu    = model->mu;
    const size_t                       n     = model->head.plant->n;
    const size_t                       rows  = blw_decentral_rows(model, set);

    if (!self->usable) {
        blw_la_gemv(n, mu, model->recursive->Psi, self->z, self->dx);
        return;
    }
    blw_la_copy(n, &self->X[((rows + n) * mu) + rows], self->dx);
    for (size_t j = n; j-- > 0U;) { /* back substitution by columns */
        const blw_real_t *const column = &self->X[((rows + j) * mu) + rows];
        self->dx[j] /= column[j];
        blw_la_axpy(j, -self->dx[j], column, self->dx);
    }
}

/* The factors hold no trace of the set. */
static blw_real_t all_statistic(blw_decentral_t *self, size_t set)
{
    (void)set;
    return statistic(self, 0U);
}

static BLW_COLD void add(const blw_decentral_model_t *model, blw_table_check_t *check)
{
    const blw_decentral_recursive_t *const recursive = model->recursive;
    const size_t                           n         = model->head.plant->n;
    const size_t                           m         = model->head.plant->m;
    const size_t                           mu        = model->mu;
    size_t                                 squares   = 0U;

    if (recursive == NULL) {
        check->ok = false;
        return;
    }
    for (size_t i = 0U; i < m; i++) {
        squares += blw_decentral_mu(model, i) * blw_decentral_mu(model, i);
    }
    blw_table_add(check, recursive->S, squares);
    blw_table_add(check, recursive->t, mu);
    blw_table_add(check, recursive->V, mu * n);
    blw_table_add(check, recursive->E, blw_la_packed_row(m));
    blw_table_add(check, recursive->L0, mu * n);
    blw_table_add(check, recursive->Psi, n * mu);
    check->ok = check->ok && (model->reseed == 0U) && (model->warm_up == 0U);
    for (size_t i = 0U; check->ok && (i < m); i++) {
        check->ok = recursive->E[blw_la_packed_row(i) + i] > BLW_R(0.0);
    }
}

const blw_decentral_gains_t blw_decentral_recursive_ops = {
    .add           = add,
    .reset         = reset,
    .advance       = advance,
    .statistic     = statistic,
    .estimate      = estimate,
    .all_statistic = all_statistic,
    .reseed        = NULL,
};
