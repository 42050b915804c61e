/* SPDX-License-Identifier: MIT */
/* One sensor beside the excluded one, both at once.
 *
 * With sensor j excluded, l_j = 0 and S_jj = diag(I, 0), nu_j can be eliminated: what is left for
 * sensor i has S_ii - S_ij S_ji = V' diag(s) V in the place of S_ii.  In the coordinates V nu_i,
 * with g = V l_i + s V nu_i,
 *     nu_c = g_c / (s_c + mu),   mu |nu| = k,   or nu = 0 if |g| <= k.                       (10)
 * psi(mu) = 1 / |nu| - mu / k is concave, s <= 1, so Newton's method on it decreases monotonically
 * from mu = k / (|g| - k) to the root, two or three steps as a rule. */
#include "blw_cold.h"
#include "blw_guard_internal.h"
#include "blw_la.h"

/* |1 - mu |nu| / k| that ends the search for mu. */
#define CLOSE (BLW_R(64.0) * BLW_REAL_EPS)

/* Steps of Newton's method at most; what they leave is left to the next update of the sensor. */
#define MOST_STEPS 5U

/* mu of (10) from g [r] and s [r]; gamma = |g| > k. */
static blw_real_t solve_secular(size_t r, blw_real_t k, blw_real_t gamma, const blw_real_t *s,
                                const blw_real_t *g)
{
    blw_real_t mu = k / (gamma - k);

    for (size_t step = 0U; step < MOST_STEPS; step++) {
        blw_real_t total = BLW_R(0.0); /* |nu|^2 */
        blw_real_t bent  = BLW_R(0.0); /* nu' (diag(s) + mu I)^-1 nu */

        for (size_t c = 0U; c < r; c++) {
            const blw_real_t inverse = BLW_R(1.0) / (s[c] + mu);
            const blw_real_t nu      = g[c] * inverse;
            const blw_real_t square  = nu * nu;
            total += square;
            bent += square * inverse;
        }
        const blw_real_t length = blw_la_sqrt(total);
        const blw_real_t slope  = (length / k) - (bent / total);
        const blw_real_t miss   = BLW_R(1.0) - ((mu / k) * length);
        if (!(blw_la_abs(miss) > CLOSE) || !(slope > BLW_R(0.0))) {
            break;
        }
        mu += miss / slope;
    }
    return mu;
}

/* V and s of S_ii without sensor j. */
static const blw_real_t *spectrum(const blw_guard_model_t *model, size_t i, size_t j,
                                  const blw_real_t **s)
{
    const size_t r  = model->r;
    const size_t at = (i * ((size_t)model->head.plant->m - 1U)) + ((j < i) ? j : (j - 1U));

    *s = &model->s[at * r];
    return &model->V[at * r * r];
}

/* v_x = V x and v_z = V z, all [r]. */
static void turn(size_t r, const blw_real_t *V, const blw_real_t *x, const blw_real_t *z,
                 blw_real_t *v_x, blw_real_t *v_z)
{
    for (size_t c = 0U; c < r; c++) {
        blw_real_t sum_x = BLW_R(0.0);
        blw_real_t sum_z = BLW_R(0.0);

        for (size_t a = 0U; a < r; a++) {
            sum_x += V[a] * x[a];
            sum_z += V[a] * z[a];
        }
        v_x[c] = sum_x;
        v_z[c] = sum_z;
        V += r;
    }
}

/* x = V' v, all [r]. */
static void turn_back(size_t r, const blw_real_t *V, const blw_real_t *v, blw_real_t *x)
{
    for (size_t a = 0U; a < r; a++) {
        blw_real_t sum = BLW_R(0.0);

        for (size_t c = 0U; c < r; c++) {
            sum += V[(c * r) + a] * v[c];
        }
        x[a] = sum;
    }
}

/* The step [r] of tau_i to (10), where l_j = 0.  @return whether nu_i /= 0 then. */
static BLW_APART bool step_beside(blw_guard_t *self, size_t i, size_t j, blw_real_t *step)
{
    const size_t            r      = self->model->r;
    const blw_real_t        k      = self->model->k;
    const blw_real_t       *s      = NULL;
    const blw_real_t *const V      = spectrum(self->model, i, j, &s);
    const blw_real_t *const e      = &self->e[i * r];
    const blw_real_t *const tau    = &self->eta[i * r];
    blw_real_t *const       before = &self->turned[r];      /* V nu_i */
    blw_real_t *const       turned = &self->turned[2U * r]; /* V l_i */
    blw_real_t *const       g      = &self->turned[3U * r];
    blw_real_t              square = BLW_R(0.0);

    for (size_t a = 0U; a < r; a++) {
        step[a] = e[a] - tau[a];
    }
    turn(r, V, &self->l[i * r], step, turned, before);
    for (size_t c = 0U; c < r; c++) {
        g[c] = turned[c] + (s[c] * before[c]);
        square += g[c] * g[c];
    }
    const blw_real_t gamma    = blw_la_sqrt(square);
    const bool       attacked = gamma > k;
    const blw_real_t mu       = attacked ? solve_secular(r, k, gamma, s, g) : BLW_R(0.0);
    for (size_t c = 0U; c < r; c++) { /* the change of nu, exact for large nu too, less its sign */
        before[c] = attacked ? (((mu * before[c]) - turned[c]) / (s[c] + mu)) : before[c];
    }
    turn_back(r, V, before, step);
    return attacked;
}

void blw_guard_move_beside(blw_guard_t *self, size_t i, size_t j)
{
    const size_t            r    = self->model->r;
    const blw_real_t *const l    = &self->l[j * r];
    blw_real_t *const       step = self->turned;

    const bool attacked = step_beside(self, i, j, step);
    blw_guard_move_to(self, i, step, attacked);
    for (size_t a = 0U; a < r; a++) {
        step[a] = -l[a];
    }
    blw_guard_move_to(self, j, step, true);
}

void blw_guard_divide(const blw_guard_model_t *model, size_t i, size_t j, const blw_real_t *x,
                      blw_real_t *turned, blw_real_t *y)
{
    const size_t            r = model->r;
    const blw_real_t       *s = NULL;
    const blw_real_t *const V = spectrum(model, i, j, &s);

    for (size_t c = 0U; c < r; c++) {
        const blw_real_t v = blw_la_dot(r, &V[c * r], x);

        turned[c] = (s[c] > GUARD_PIVOT_MIN) ? (v / s[c]) : BLW_R(0.0);
    }
    turn_back(r, V, turned, y);
}
