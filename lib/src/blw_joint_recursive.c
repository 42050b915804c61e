/* SPDX-License-Identifier: MIT */
/* Gains from a recursion.  Every error is kept as a row of coefficients of independent unit noises,
 * so that covariances are products of rows: symmetric and positive semidefinite by construction, in
 * half the digits that a covariance would need.  Estimator i has n + 2 rows; at the end of a step
 *
 *     rows of x~_i,   b_i = theta_hat_i + phi_hat_i,   phi_hat_i                               (5)
 *
 * in R = r (n + 2) columns (the triangular factor L) and one column c for its own theta_i(k), the
 * only newer noise that they contain.  In the next step theta_i(k) is an old noise: this is what
 * makes the covariances exact, E{phi_hat phi~'} and the rest, where (19) of [J] takes them for 0.
 *
 *     x~ = A x~ + w,   e_theta = theta(k) - b,   e_phi = theta(k) - theta(k-1) - phi_hat       (6)
 *
 * are the errors of the prediction.  A sample with the error row Y and the innovation e, made
 * orthonormal to those before it (q = Y / |Y|, Gram-Schmidt, e likewise), corrects every row v of
 * (6) by -(v q') q and the estimate that belongs to it by (v q') e: this is (36), (37) of [J].
 * The fusion works alike: differences of local estimates are free to be added to x_ref, and so they
 * are projected out of its rows.  All operations on estimates are the same combinations of
 * differences, so the weights sum to I whatever the covariances. */
#include "blw_cold.h"
#include "blw_joint_internal.h"
#include "blw_la.h"

/* Smaller squares count as 0. */
#define SQUARE_MIN BLW_R(1e-30)

/* Columns of a row in the step. */
typedef struct columns {
    size_t rows; /* R; also the first column of theta(k-1) */
    size_t w;    /* first column of the process noise */
    size_t v;    /* first column of the measurement noise */
    size_t now;  /* first column of theta(k) */
    size_t width;
} columns_t;

static columns_t columns_of(const blw_joint_t *self)
{
    const size_t r = self->model->r;
    columns_t    at;

    at.rows  = BLW_JOINT_ROWS(self->plant.n, r);
    at.w     = at.rows + r;
    at.v     = at.w + self->plant.n;
    at.now   = at.v + self->plant.m;
    at.width = at.now + r;
    return at;
}

BLW_COLD void blw_joint_recursive_reset(blw_joint_t *self)
{
    const size_t n    = self->plant.n;
    const size_t rows = BLW_JOINT_ROWS(n, self->model->r);

    blw_la_zero(blw_la_packed_row(rows), self->L);
    blw_la_zero(rows, self->c);
    for (size_t i = 0U; i < self->model->r; i++) {
        for (size_t a = 0U; a < n; a++) {
            const size_t row = (i * (n + 2U)) + a;
            blw_la_copy(a + 1U, &self->model->recursive->L0[blw_la_packed_row(a)],
                        &self->L[blw_la_packed_row(row)]);
        }
    }
    blw_la_copy(self->model->r, self->model->recursive->theta_sd, self->sd);
}

/* target += alpha times row `row` of (5), which belongs to estimator i. */
static void add_row(const blw_joint_t *self, const columns_t *at, size_t i, size_t row,
                    blw_real_t alpha, blw_real_t *target)
{
    blw_la_axpy(row + 1U, alpha, &self->L[blw_la_packed_row(row)], target);
    target[at->rows + i] += alpha * self->c[row];
}

/* (6) */
static void predict_rows(blw_joint_t *self, const columns_t *at, size_t i)
{
    const size_t      n     = self->plant.n;
    const size_t      base  = i * (n + 2U);
    const blw_real_t  sd    = self->model->recursive->theta_sd[i];
    blw_real_t *const first = &self->X[base * at->width];

    blw_la_zero((n + 2U) * at->width, first);
    for (size_t a = 0U; a < n; a++) {
        blw_real_t *const row = &first[a * at->width];
        for (size_t b = 0U; b < n; b++) {
            add_row(self, at, i, base + b, self->plant.A[(a * n) + b], row);
        }
        blw_la_copy(n, &self->model->recursive->V[a * n], &row[at->w]);
    }
    blw_real_t *const e_theta = &first[n * at->width];
    blw_real_t *const e_phi   = &e_theta[at->width];
    add_row(self, at, i, base + n, BLW_R(-1.0), e_theta);
    add_row(self, at, i, base + n + 1U, BLW_R(-1.0), e_phi);
    e_phi[at->rows + i] -= sd;
    e_theta[at->now + i] = sd;
    e_phi[at->now + i]   = sd;
}

/* The error row Y of the j-th sensor of estimator i. */
static void sample_row(const blw_joint_t *self, const columns_t *at, size_t i, size_t j,
                       blw_real_t *Y)
{
    const size_t            n      = self->plant.n;
    const size_t            sensor = self->model->sensor[self->model->first[i] + j];
    const blw_real_t *const first  = &self->X[i * (n + 2U) * at->width];

    blw_la_zero(at->width, Y);
    blw_la_copy(sensor + 1U, &self->model->recursive->E[blw_la_packed_row(sensor)], &Y[at->v]);
    for (size_t a = 0U; a < n; a++) {
        blw_la_axpy(at->width, self->plant.C[(sensor * n) + a], &first[a * at->width], Y);
    }
    if (j == 0U) {
        blw_la_axpy(at->width, BLW_R(1.0), &first[n * at->width], Y);
    }
}

/* Correct the rows of estimator i, and its estimates, by the innovation e of the unit row q. */
static void correct_rows(blw_joint_t *self, const columns_t *at, size_t i, const blw_real_t *q,
                         blw_real_t e)
{
    const size_t      n     = self->plant.n;
    blw_real_t *const first = &self->X[i * (n + 2U) * at->width];

    for (size_t a = 0U; a < (n + 2U); a++) {
        blw_real_t *const row = &first[a * at->width];
        const blw_real_t  k   = blw_la_dot(at->width, row, q);

        blw_la_axpy(at->width, -k, q, row);
        if (a < n) {
            self->delta[(i * n) + a] += k * e;
        } else if (a == n) {
            self->theta[i] += k * e;
        } else {
            self->phi[i] += k * e;
        }
    }
}

/* From the errors (6) back to (5). */
static void keep_rows(blw_joint_t *self, const columns_t *at, size_t i)
{
    const size_t      n       = self->plant.n;
    const blw_real_t  sd      = self->model->recursive->theta_sd[i];
    blw_real_t *const e_theta = &self->X[((i * (n + 2U)) + n) * at->width];
    blw_real_t *const e_phi   = &e_theta[at->width];

    for (size_t column = 0U; column < at->width; column++) {
        e_phi[column]   = -e_phi[column];
        e_theta[column] = e_phi[column] - e_theta[column];
    }
    e_phi[at->rows + i] -= sd;
    e_phi[at->now + i] += sd;
    e_theta[at->rows + i] -= sd;
    e_theta[at->now + i] += BLW_R(2.0) * sd;
}

static void correct_local(blw_joint_t *self, const columns_t *at, size_t i, blw_mask_t heard)
{
    const blw_joint_model_t *const model = self->model;
    blw_real_t *const              Q     = &self->X[at->rows * at->width];
    size_t                         taken = 0U;

    for (size_t j = 0U; j < blw_joint_sensors(model, i); j++) {
        const size_t sensor = model->sensor[model->first[i] + j];
        if (!blw_joint_in(heard, sensor) || ((j > 0U) && !blw_joint_in(self->strong, sensor))) {
            continue;
        }
        blw_real_t *const Y = &Q[taken * at->width];
        blw_real_t        e = blw_joint_innovation(self, i, j);
        sample_row(self, at, i, j, Y);
        for (size_t s = 0U; s < taken; s++) {
            const blw_real_t k = blw_la_dot(at->width, Y, &Q[s * at->width]);
            blw_la_axpy(at->width, -k, &Q[s * at->width], Y);
            e -= k * self->e[s];
        }
        const blw_real_t per_norm = BLW_R(1.0) / blw_la_norm(at->width, Y);
        for (size_t column = 0U; column < at->width; column++) {
            Y[column] *= per_norm;
        }
        self->e[taken] = e * per_norm;
        correct_rows(self, at, i, Y, self->e[taken]);
        taken++;
    }
    self->sd[i] =
        blw_la_norm(at->width, &self->X[((i * (self->plant.n + 2U)) + self->plant.n) * at->width]);
    keep_rows(self, at, i);
}

/* The rows of (5) to triangular form by Gram-Schmidt on their old columns. */
static void factor(blw_joint_t *self, const columns_t *at)
{
    const size_t n = self->plant.n;

    for (size_t row = 0U; row < at->rows; row++) {
        blw_real_t *const q     = &self->X[row * at->width];
        const blw_real_t  norm2 = blw_la_dot(at->now, q, q);
        const bool        some  = norm2 > SQUARE_MIN;
        const blw_real_t  norm  = some ? blw_la_sqrt(norm2) : BLW_R(0.0);
        const blw_real_t  per   = some ? (BLW_R(1.0) / norm) : BLW_R(0.0);

        self->c[row]                          = q[at->now + (row / (n + 2U))];
        self->L[blw_la_packed_row(row) + row] = norm;
        for (size_t column = 0U; column < at->now; column++) {
            q[column] *= per;
        }
        for (size_t below = row + 1U; below < at->rows; below++) {
            blw_real_t *const v                     = &self->X[below * at->width];
            const blw_real_t  k                     = blw_la_dot(at->now, v, q);
            self->L[blw_la_packed_row(below) + row] = k;
            blw_la_axpy(at->now, -k, q, v);
        }
    }
}

/* |.|^2 of a row of (5) */
static blw_real_t square_of(const blw_joint_t *self, size_t row)
{
    const blw_real_t *const Lr = &self->L[blw_la_packed_row(row)];

    return blw_la_dot(row + 1U, Lr, Lr) + (self->c[row] * self->c[row]);
}

/* The estimator with the least variance. */
static size_t best_local(const blw_joint_t *self)
{
    const size_t n     = self->plant.n;
    size_t       best  = 0U;
    blw_real_t   least = BLW_REAL_MAX;

    for (size_t i = 0U; i < self->model->r; i++) {
        blw_real_t trace = BLW_R(0.0);
        for (size_t a = 0U; a < n; a++) {
            trace += square_of(self, (i * (n + 2U)) + a);
        }
        if (trace < least) {
            least = trace;
            best  = i;
        }
    }
    return best;
}

/* A row of the fusion has R + r coefficients, then the estimate and the square below which what is
 * left of the row is rounding: BLW_REAL_EPS times that of the row or of x_ref. */
static void fusion_row(const blw_joint_t *self, const columns_t *at, size_t i, size_t ref, size_t a,
                       blw_real_t *row)
{
    const size_t n     = self->plant.n;
    const size_t value = at->w;

    blw_la_zero(value + 2U, row);
    add_row(self, at, i, (i * (n + 2U)) + a, BLW_R(1.0), row);
    row[value] = self->delta[(i * n) + a];
    if (i != ref) {
        add_row(self, at, ref, (ref * (n + 2U)) + a, BLW_R(-1.0), row);
        row[value] -= self->delta[(ref * n) + a];
    }
    row[value + 1U] =
        BLW_REAL_EPS
        * blw_la_max(blw_la_dot(value, row, row), square_of(self, (ref * (n + 2U)) + a));
}

/* Take what lies along row `row` out of those of x_ref and of the differences after it. */
static void project_out(blw_joint_t *self, const columns_t *at, size_t row)
{
    const size_t            n     = self->plant.n;
    const size_t            value = at->w;
    const blw_real_t *const v     = &self->X[row * at->width];
    const blw_real_t        norm2 = blw_la_dot(value, v, v);

    if (!(norm2 > blw_la_max(v[value + 1U], SQUARE_MIN))) {
        return;
    }
    const blw_real_t per = BLW_R(1.0) / norm2;
    for (size_t other = 0U; other < (self->model->r * n); other++) {
        blw_real_t *const w = &self->X[other * at->width];
        if ((other < n) || (other > row)) {
            blw_la_axpy(value + 1U, -(blw_la_dot(value, w, v) * per), v, w);
        }
    }
}

/* dx of (4): rows 0..n-1 are those of x_ref, the others differences to it. */
static void fuse(blw_joint_t *self, const columns_t *at)
{
    const size_t n    = self->plant.n;
    const size_t rows = self->model->r * n;
    const size_t ref  = best_local(self);

    for (size_t row = 0U; row < rows; row++) {
        const size_t turn = row / n;
        const size_t i    = (turn == 0U) ? ref : ((turn <= ref) ? (turn - 1U) : turn);
        fusion_row(self, at, i, ref, row % n, &self->X[row * at->width]);
    }
    for (size_t row = n; row < rows; row++) {
        project_out(self, at, row);
    }
    for (size_t a = 0U; a < n; a++) {
        self->dx[a] = self->X[(a * at->width) + at->w];
    }
}

bool blw_joint_recursive_correct(blw_joint_t *self, blw_mask_t heard)
{
    const columns_t at = columns_of(self);

    for (size_t i = 0U; i < self->model->r; i++) {
        predict_rows(self, &at, i);
        correct_local(self, &at, i, heard);
    }
    factor(self, &at);
    fuse(self, &at);
    return blw_la_bounded(blw_la_packed_row(at.rows), self->L) && blw_la_bounded(at.rows, self->c);
}
