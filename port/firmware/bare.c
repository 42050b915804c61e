/* SPDX-License-Identifier: MIT */
/* Example firmware without a bus: sampling, estimating and acting in one loop, the library alone.
 *
 * read_sensors() and drive() stand for the board's converter and actuator; here they are a plant at
 * rest whose angle sensor lies from the step ATTACK on.  The run ends after STEPS, with status 0 if
 * the estimate stayed with the plant.
 */
#include "pendulum_physical_model.h"

enum { STEPS = 200, ATTACK = 100 };

#define LIE_RAD   BLW_R(1.5)
#define CLOSE_RAD BLW_R(0.05)

BLW_PENDULUM_PHYSICAL_CANONICAL_STORAGE(estimator);

static blw_real_t force_N[PENDULUM_PHYSICAL_L];

/* @return the set of sensors that delivered a sample */
static blw_mask_t read_sensors(unsigned k, blw_real_t *y)
{
    for (unsigned i = 0U; i < PENDULUM_PHYSICAL_M; i++) {
        y[i] = BLW_R(0.0);
    }
    y[PENDULUM_PHYSICAL_Y_ANGLE] = (k < (unsigned)ATTACK) ? BLW_R(0.0) : LIE_RAD;
    return BLW_MASK_ALL(PENDULUM_PHYSICAL_M);
}

static void drive(const blw_real_t *x_hat)
{
    (void)x_hat; /* a controller would compute the force from it */
    force_N[PENDULUM_PHYSICAL_U_FORCE_N] = BLW_R(0.0);
}

int main(void)
{
    blw_real_t          y[PENDULUM_PHYSICAL_M];
    blw_estimator_out_t out;
    bool                close = true;

    if (blw_lasso_init(&estimator, &blw_pendulum_physical_canonical, estimator_mem,
                       BLW_PENDULUM_PHYSICAL_CANONICAL_MEM)
        != BLW_OK) {
        return 1;
    }
    for (unsigned k = 1U; k <= (unsigned)STEPS; k++) {
        const blw_mask_t valid = read_sensors(k, y);

        if (blw_lasso_step(&estimator, force_N, y, valid, &out) != BLW_OK) {
            return 2;
        }
        drive(out.x_hat);
        close = close && (out.x_hat[PENDULUM_PHYSICAL_X_CART_M] < CLOSE_RAD)
                && (out.x_hat[PENDULUM_PHYSICAL_X_CART_M] > -CLOSE_RAD);
    }
    return close ? 0 : 3;
}
