/* SPDX-License-Identifier: MIT */
/* What is left where the descent is cut off.
 *
 * With |t l_i| <= k, t = min(1, min k / |l_i|), the duality gap of (2) is
 *     gap = (1 - t)^2 l' S^+ l / 2 + sum_i (k |nu_i| - t l_i' nu_i),                         (8)
 * the minimiser is within |nu - nu*|_S^2 <= 2 gap, and with Gu x + W z = nu - nu*,
 * x = Fu (nu - nu*):
 *     |x_hat - x*| <= kappa (2 f / k + omega (2 gap)^(1/2)) + sigma (2 gap)^(1/2),           (9)
 * because sum_i k |nu_i| and sum_i k |nu_i*| are both at most the objective f. */
#include "blw_cold.h"
#include "blw_guard_internal.h"
#include "blw_la.h"

/* sum_i k |nu_i| over the sensors with a penalty; *l_nu: sum_i l_i' nu_i. */
static BLW_COLD blw_real_t penalty_of(const blw_guard_t *self, blw_real_t *l_nu)
{
    const size_t r     = self->model->r;
    blw_real_t   total = BLW_R(0.0);
    size_t       row   = 0U;

    *l_nu = BLW_R(0.0);
    for (blw_mask_t rest = self->attacked & ~self->excluded; rest != 0U; rest >>= 1) {
        blw_real_t square = BLW_R(0.0);

        for (size_t a = row; ((rest & 1U) != 0U) && (a < (row + r)); a++) {
            const blw_real_t nu = self->e[a] - self->eta[a];

            square += nu * nu;
            *l_nu += self->l[a] * nu;
        }
        total += blw_la_sqrt(square);
        row += r;
    }
    return self->model->k * total;
}

BLW_COLD blw_real_t blw_guard_bound(const blw_guard_t *self, blw_real_t largest)
{
    const blw_guard_model_t *const model   = self->model;
    const size_t                   m       = model->head.plant->m;
    blw_real_t                     l_nu    = BLW_R(0.0);
    const blw_real_t               t       = model->k / blw_la_max(model->k, largest);
    const blw_real_t               penalty = penalty_of(self, &l_nu);
    const blw_real_t               product = blw_la_dot(m * model->r, self->l, self->eta);
    const blw_real_t               energy  = BLW_R(0.5) * blw_la_max(BLW_R(0.0), product);
    const blw_real_t               rest    = BLW_R(1.0) - t;
    const blw_real_t               gap     = (rest * rest * energy) + (penalty - (t * l_nu));
    const blw_real_t               root    = blw_la_sqrt(BLW_R(2.0) * blw_la_max(BLW_R(0.0), gap));
    const blw_real_t               size    = (BLW_R(2.0) * (energy + penalty)) / model->k;
    const blw_real_t most = (model->kappa * (size + (model->omega * root))) + (model->sigma * root);
    const bool       none = (model->n_u > 0U) && !(model->kappa > BLW_R(0.0));
    return none ? BLW_REAL_MAX : most;
}
