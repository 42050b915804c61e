/* SPDX-License-Identifier: MIT */
/* One sensor beside the excluded one, both at once.
 *
 * With sensor j excluded, l_j = 0 and S_jj = diag(I, 0), nu_j can be eliminated: what is left for
 * sensor i has S_ii - S_ij S_ji = V' diag(s) V in the place of S_ii.  In the coordinates V nu_i, with
 * g = V l_i + s V nu_i,
 *     nu_c = g_c / (s_c + mu),   mu |nu| = k,   or nu = 0 if |g| <= k.                       (10)
 * psi(mu) = 1 / |nu| - mu / k is concave, s <= 1, so Newton's method on it decreases monotonically
 * from mu = k / (|g| - k) to the root, two or three steps as a rule. */
#include "blw_guard_internal.h"
#include "blw_guard_strips.h"
#include "blw_la.h"

/* |1 - mu |nu| / k| that ends the search for mu. */
#define CLOSE (BLW_R(64.0) * BLW_REAL_EPS)

/* Steps of Newton's method at most; what they leave is left to the next update of the sensor. */
#define MOST_STEPS 5U

/* nu [r] of (10) from g [r] and s [r]; gamma = |g| > k. */
static void solve_secular(size_t r, blw_real_t k, blw_real_t gamma, const blw_real_t *s,
                          const blw_real_t *g, blw_real_t *nu)
{
    blw_real_t mu = k / (gamma - k);

    for (size_t step = 0U; step < MOST_STEPS; step++) {
        blw_real_t total = BLW_R(0.0);
        blw_real_t bent  = BLW_R(0.0); /* nu' (diag(s) + mu I)^-1 nu */

        for (size_t c = 0U; c < r; c++) {
            const blw_real_t inverse = BLW_R(1.0) / (s[c] + mu);
            nu[c]                    = g[c] * inverse;
            const blw_real_t square  = nu[c] * nu[c];
            total += square;
            bent += square * inverse;
        }
        const blw_real_t length = blw_la_sqrt(total);
        const blw_real_t slope  = (length / k) - (bent / total);
        const blw_real_t miss   = BLW_R(1.0) - ((mu / k) * length);
        if (!(blw_la_abs(miss) > CLOSE) || !(slope > BLW_R(0.0))) {
            return;
        }
        mu += miss / slope;
    }
}

/* V nu_i and g of (10). */
static void turn(blw_guard_t *self, size_t i, const blw_real_t *V, const blw_real_t *s,
                 blw_real_t *before, blw_real_t *g)
{
    const size_t r = self->model->r;

    blw_la_fill(r, BLW_R(0.0), before);
    blw_la_fill(r, BLW_R(0.0), g);
    guard_mul(r, r, 0U, r, V, &self->l[i * r], g);
    if (!guard_has(self->attacked, i)) {
        return;
    }
    for (size_t a = 0U; a < r; a++) {
        self->step[a] = self->e[(i * r) + a] - self->eta[(i * r) + a];
    }
    guard_mul(r, r, 0U, r, V, self->step, before);
    for (size_t c = 0U; c < r; c++) {
        g[c] += s[c] * before[c];
    }
}

void blw_guard_update_beside(blw_guard_t *self, size_t i, size_t j)
{
    const blw_guard_model_t *const model = self->model;
    const size_t                   r     = model->r;
    const size_t      at     = (i * ((size_t)model->head.plant->m - 1U)) + ((j < i) ? j : (j - 1U));
    const blw_real_t *V      = &model->V[at * r * r];
    const blw_real_t *s      = &model->s[at * r];
    blw_real_t *const before = self->turned;
    blw_real_t *const g      = &self->turned[r];
    blw_real_t *const after  = &self->turned[2U * r];

    turn(self, i, V, s, before, g);
    blw_la_fill(r, BLW_R(0.0), after);
    const blw_real_t gamma = blw_la_norm(r, g);
    self->attacked &= ~guard_bit(i);
    if (gamma > model->k) {
        solve_secular(r, model->k, gamma, s, g, after);
        self->attacked |= guard_bit(i);
    }
    for (size_t c = 0U; c < r; c++) { /* tau = e - nu */
        before[c] -= after[c];
    }
    blw_la_fill(r, BLW_R(0.0), self->step);
    guard_mul_t(r, r, 0U, r, V, before, self->step, self->step);
    blw_guard_couple(model, j, i, self->step, g);
    for (size_t c = 0U; c < r; c++) {
        g[c] = -g[c];
    }
    blw_guard_move(self, i, self->step);
    blw_guard_move(self, j, g);
    if (!guard_has(self->attacked, i)) {
        blw_la_copy(r, &self->e[i * r], &self->eta[i * r]);
    }
}
