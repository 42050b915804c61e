/* SPDX-License-Identifier: MIT */
/* Secure fusion of local estimates: certificate, choice of engine, exit report.  See blw_l1.h for
 * the problem and its equation numbers.  The gap at nu with multipliers l = Z z is, for any t in
 * [0, 1] that makes t l feasible for the dual,
 *     gap = sum_g (c_g |nu_g| - t l_g' nu_g) + (1 - t)^2 |z|^2 / 2,                          (5)
 * and since (2) is strongly convex in z,  |z - z*| <= e = sqrt(2 gap).  The minimisers differ by
 *     G (x* - x) = (nu - nu*) - W Z (z* - z)  with  sum_g c_g |nu*_g| <= f - (|z| - e)^2 / 2,
 * so with the two constants of the model
 *     |x* - x| <= kappa_G (sum_g c_g (|nu_g| + |nu*_g|) + kappa_W e).                        (6)
 * (6) holds always and is coarse under a large attack; a verified optimum gives a sharp bound. */
#include "blw/blw_l1_survey.h"
#include "blw_cold.h"
#include "blw_l1_internal.h"

bool blw_l1_has_pairs(const blw_l1_model_t *m)
{
    return m->n_groups != m->N;
}

blw_real_t blw_l1_norm(const blw_l1_model_t *m, size_t g, const blw_real_t *v)
{
    const size_t i = m->first[g];

    return (blw_l1_size(m, g) == 1U) ? blw_la_abs(v[i]) : blw_la_norm(2U, &v[i]);
}

blw_real_t blw_l1_nu_norm(const blw_l1_t *self, const blw_real_t *zeta, size_t g)
{
    const size_t i     = self->model->first[g];
    blw_real_t   nu[2] = {zeta[i] - self->tau[i], BLW_R(0.0)};

    if (blw_l1_size(self->model, g) == 1U) {
        return blw_la_abs(nu[0]);
    }
    nu[1] = zeta[i + 1U] - self->tau[i + 1U];
    return blw_la_norm(2U, nu);
}

blw_real_t blw_l1_aim(blw_l1_t *self, const blw_real_t *zeta, size_t g)
{
    const size_t     i    = self->model->first[g];
    const size_t     size = blw_l1_size(self->model, g);
    const blw_real_t norm = blw_l1_nu_norm(self, zeta, g);

    for (size_t j = i; (norm > BLW_R(0.0)) && (j < (i + size)); j++) {
        self->dir[j] = (zeta[j] - self->tau[j]) / norm;
    }
    return norm;
}

void blw_l1_project(const blw_l1_model_t *m, const blw_real_t *v, blw_real_t *out)
{
    blw_la_trapv_t(m->N, m->d, m->Z, v, out);
}

void blw_l1_multiply_Z(blw_l1_t *self, const blw_real_t *zeta)
{
    blw_l1_project(self->model, zeta, self->z);
    blw_l1_multipliers(self);
}

void blw_l1_multipliers(blw_l1_t *self)
{
    blw_la_trapv(self->model->N, self->model->d, self->model->Z, self->z, self->l);
}

blw_real_t blw_l1_statistic(const blw_l1_t *self)
{
    const blw_l1_model_t *const m    = self->model;
    const bool                  one  = !blw_l1_has_pairs(m); /* row g is group g */
    blw_real_t                  most = BLW_R(0.0);

    for (size_t g = 0U; g < m->n_groups; g++) {
        const blw_real_t norm = one ? blw_la_abs(self->l[g]) : blw_l1_norm(m, g, self->l);

        most = blw_l1_larger(most, norm, m->c[g]);
    }
    return most;
}

bool blw_l1_in_support(const blw_l1_t *self, size_t g)
{
    bool found = false;

    for (size_t k = 0U; (k < self->n_A) && !found; k++) {
        found = (blw_l1_member(self, k) == g);
    }
    return found;
}

size_t blw_l1_worst(const blw_l1_t *self, blw_real_t widen)
{
    const blw_l1_model_t *const m     = self->model;
    const blw_real_t            z     = blw_la_norm(m->d, self->z);
    const blw_real_t            tau   = blw_la_norm(m->N, self->tau);
    blw_real_t                  worst = BLW_R(1.0);
    size_t                      found = m->n_groups;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const blw_real_t slack = (BLW_L1_SLACK_Z * (m->c[g] + z)) + (BLW_L1_SLACK_TAU * tau);
        const blw_real_t ratio = blw_l1_norm(m, g, self->l) / (m->c[g] + (widen * slack));
        if ((ratio > worst) && !blw_l1_in_support(self, g)) {
            worst = ratio;
            found = g;
        }
    }
    return found;
}

/* |z| = |Z' tau|, where there is no Z from tau' S tau = tau' l. */
static blw_real_t norm_of_z(const blw_l1_t *self)
{
    const blw_l1_model_t *const m = self->model;

    return (m->Z != NULL)
               ? blw_la_norm(m->d, self->z)
               : blw_la_sqrt(blw_la_max(blw_la_dot(m->N, self->tau, self->l), BLW_R(0.0)));
}

/* The gap (5) and the bound (6). */
static BLW_APART void report_gap(const blw_l1_t *self, const blw_real_t *zeta, blw_l1_info_t *info)
{
    const blw_l1_model_t *const m   = self->model;
    const blw_real_t            z   = norm_of_z(self);
    const blw_real_t            t   = BLW_R(1.0) / blw_la_max(BLW_R(1.0), blw_l1_statistic(self));
    blw_real_t                  sum = BLW_R(0.0); /* sum_g c_g |nu_g| */
    blw_real_t                  gap = BLW_R(0.5) * (BLW_R(1.0) - t) * (BLW_R(1.0) - t) * z * z;

    for (size_t g = 0U; g < m->n_groups; g++) {
        const blw_real_t penalty = m->c[g] * blw_l1_nu_norm(self, zeta, g);
        sum += penalty;
        gap += penalty;
        for (size_t i = m->first[g]; i < m->first[g + 1U]; i++) {
            gap -= t * self->l[i] * (zeta[i] - self->tau[i]);
        }
    }
    info->gap                = blw_la_max(gap, BLW_R(0.0));
    const blw_real_t e       = blw_la_sqrt(BLW_R(2.0) * info->gap);
    const blw_real_t z_least = blw_la_max(z - e, BLW_R(0.0));
    const blw_real_t best    = sum + (BLW_R(0.5) * ((z * z) - (z_least * z_least)));
    const blw_real_t bound   = m->kappa_G * (sum + best + (m->kappa_W * e));
    info->bound              = (bound <= BLW_REAL_MAX) ? bound : BLW_REAL_MAX;
}

blw_real_t blw_l1_objective(const blw_l1_t *self, const blw_real_t *zeta)
{
    const blw_l1_model_t *const m   = self->model;
    blw_real_t                  sum = blw_la_max(blw_la_dot(m->N, self->tau, self->l), BLW_R(0.0));

    sum *= BLW_R(0.5);
    for (size_t g = 0U; g < m->n_groups; g++) {
        sum += m->c[g] * blw_l1_nu_norm(self, zeta, g);
    }
    return sum;
}

/* Objective (1) for tau = 0, x = 0: all of zeta is attack. */
static BLW_COLD blw_real_t objective_of_none(const blw_l1_model_t *m, const blw_real_t *zeta)
{
    blw_real_t sum = BLW_R(0.0);

    for (size_t g = 0U; g < m->n_groups; g++) {
        sum += m->c[g] * blw_l1_norm(m, g, zeta);
    }
    return sum;
}

/* An engine that was cut short may have been led astray by rounding, and where an attack is large
 * it is: what it leaves counts only if it is better than nu = 0, the Kalman estimate, and than
 * tau = 0, which keeps the reference that zeta is relative to. */
static BLW_COLD void moderate(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x)
{
    const blw_l1_model_t *const m    = self->model;
    const blw_real_t            none = objective_of_none(m, zeta);

    m->engine->multiply(self, zeta);
    const blw_real_t all = BLW_R(0.5) * blw_la_dot(m->N, zeta, self->l);
    m->engine->multiply(self, self->tau);
    const blw_real_t found = blw_l1_objective(self, zeta);
    if (!((found < all) && (found < none))) {
        if (all <= none) {
            blw_la_copy(m->N, zeta, self->tau);
        } else {
            blw_la_zero(m->N, self->tau);
        }
        m->engine->multiply(self, self->tau);
    }
    blw_la_gemv(m->n, m->N, m->F, self->tau, x);
}

BLW_COLD void blw_l1_init(blw_l1_t *self, const blw_l1_model_t *model, blw_real_t *mem)
{
    *self = (blw_l1_t){.model = model};

    self->tau = blw_la_take(&mem, model->N);
    self->l   = blw_la_take(&mem, model->N);
    self->dir = blw_la_take(&mem, model->N);
    model->engine->lay_out(self, mem);
    blw_l1_reset(self);
}

BLW_COLD void blw_l1_lay_out_Z(blw_l1_t *self, blw_real_t *mem)
{
    const blw_l1_model_t *const m = self->model;

    self->step = blw_la_take(&mem, m->N);
    self->z    = blw_la_take(&mem, m->d);
    self->dz   = blw_la_take(&mem, m->d);
    self->A    = blw_la_take(&mem, m->n_groups);
    self->L    = mem;
}

BLW_COLD void blw_l1_reset(blw_l1_t *self)
{
    blw_la_zero(self->model->N, self->tau);
    blw_la_zero(self->model->N, self->dir);
    self->n_A    = 0U;
    self->rows   = 0U;
    self->solved = true;
}

/* The estimate for nu = 0. */
static void take_all(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x)
{
    const blw_l1_model_t *const m = self->model;

    blw_la_copy(m->N, zeta, self->tau);
    blw_la_gemv(m->n, m->N, m->F, self->tau, x);
}

void blw_l1_solve(blw_l1_t *self, const blw_real_t *zeta, blw_real_t *x_hat, blw_l1_info_t *info)
{
    const blw_l1_model_t *const m = self->model;

    *info = (blw_l1_info_t){.kalman = false};
    if (m->fast != NULL) {
        info->statistic = m->fast->certify(self, zeta, x_hat);
    } else {
        m->engine->multiply(self, zeta);
        info->statistic = blw_l1_statistic(self);
    }
    if ((info->statistic > BLW_R(1.0)) && (info->statistic <= BLW_REAL_MAX)) {
        m->engine->solve(self, zeta, x_hat, info);
        if (!info->converged) {
            moderate(self, zeta, x_hat);
        }
    } else { /* the certificate, or a NaN, of which nothing can be said */
        info->kalman    = (info->statistic <= BLW_R(1.0));
        info->converged = info->kalman;
        self->n_A       = 0U;
        self->rows      = 0U;
        if (m->fast == NULL) {
            take_all(self, zeta, x_hat);
        }
    }
    self->solved = info->converged;
    if (!info->converged) {
        report_gap(self, zeta, info);
    }
}

/* blw_l1_excess() where row g is group g. */
static blw_real_t excess_of_rows(const blw_l1_t *self, const blw_real_t *zeta, size_t first,
                                 size_t count)
{
    blw_real_t max = BLW_R(0.0);

    for (size_t i = first; i < (first + count); i++) {
        const blw_real_t h = blw_la_abs(self->l[i]) + blw_la_abs(zeta[i] - self->tau[i]);
        max                = blw_la_max(max, h / self->model->c[i]);
    }
    return max;
}

blw_real_t blw_l1_excess(const blw_l1_t *self, const blw_real_t *zeta, size_t first, size_t count)
{
    const blw_l1_model_t *const m   = self->model;
    blw_real_t                  max = BLW_R(0.0);

    if (!blw_l1_has_pairs(m)) {
        return excess_of_rows(self, zeta, first, count);
    }
    for (size_t g = 0U; g < m->n_groups; g++) {
        if ((m->first[g] >= first) && (m->first[g] < (first + count))) {
            const blw_real_t h = blw_l1_norm(m, g, self->l) + blw_l1_nu_norm(self, zeta, g);
            max                = blw_la_max(max, h / m->c[g]);
        }
    }
    return max;
}

/* Length of a table that some engines do without. */
static size_t length_of(const blw_real_t *table, size_t length)
{
    return (table != NULL) ? length : 0U;
}

/* Groups of one or two rows that cover 0..N-1 in order. */
static bool groups_ok(const blw_l1_model_t *m)
{
    bool ok = (m->first != NULL) && (m->n_groups >= 1U) && (m->first[0] == 0U);

    for (size_t g = 0U; ok && (g < m->n_groups); g++) {
        ok = (m->first[g + 1U] > m->first[g]) && (blw_l1_size(m, g) <= 2U);
    }
    return ok && (m->first[m->n_groups] == m->N);
}

/* Thresholds and constants are positive. */
static bool numbers_ok(const blw_l1_model_t *m)
{
    bool ok = (m->kappa_G > BLW_R(0.0)) && (m->kappa_W > BLW_R(0.0));

    for (size_t g = 0U; ok && (g < m->n_groups); g++) {
        ok = (m->c[g] > BLW_R(0.0));
    }
    return ok;
}

BLW_COLD blw_status_t blw_l1_check(const blw_l1_model_t *m, blw_table_check_t *check)
{
    if ((m == NULL) || (m->d == 0U) || (m->N != (m->d + m->n)) || !groups_ok(m)
        || (m->max_iterations == 0U) || (m->engine == NULL) || !m->engine->fits(m)) {
        return BLW_ERR_MODEL;
    }
    const size_t N      = m->N;
    const size_t packed = blw_la_packed_row(N);

    blw_table_add(check, m->Z, length_of(m->Z, BLW_L1_Z_LEN(N, m->d)));
    blw_table_add(check, m->F, (size_t)m->n * N);
    blw_table_add(check, m->c, m->n_groups);
    blw_table_add(check, m->M, length_of(m->M, packed));
    blw_table_add(check, m->S, length_of(m->S, packed));
    blw_table_add(check, m->W, length_of(m->W, packed));
    blw_table_add(check, m->G, length_of(m->G, N * m->n));
    blw_table_add(check, m->P, length_of(m->P, blw_la_packed_row(m->n)));
    blw_table_add_real(check, m->rho);
    blw_table_add_real(check, m->kappa_G);
    blw_table_add_real(check, m->kappa_W);
    return (check->ok && numbers_ok(m)) ? BLW_OK : BLW_ERR_MODEL;
}
