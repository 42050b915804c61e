/* SPDX-License-Identifier: MIT */
/* A Kalman filter for one state and one sensor, in the common subset of C99 and C++11. */
#include <blw/blw_kalman.h>

static const blw_real_t one[1]     = {1};
static const blw_real_t half[1]    = {BLW_R(0.5)};
static const blw_real_t nothing[1] = {0};
static const blw_real_t lowest[1]  = {-100};
static const blw_real_t highest[1] = {100};

/* x(k+1) = x(k), y = x */
static const blw_plant_t plant = {1, 1, 0, 0, one, NULL, one, nothing, lowest, highest, nothing};

static uint32_t checksum(blw_kalman_model_t model)
{
    blw_table_check_t check;

    (void)blw_model_begin(&model.head, BLW_METHOD_KALMAN, &check);
    blw_table_add(&check, model.K, 1U);
    return check.crc;
}

int main(void)
{
    blw_kalman_model_t model = {
        {BLW_MODEL_ABI, (uint8_t)BLW_METHOD_KALMAN, 0U, &plant}, half, NULL, NULL, NULL};
    blw_real_t          mem[BLW_KALMAN_MEM(1, 1)];
    blw_kalman_t        filter;
    blw_estimator_out_t out;
    const blw_real_t    y[1] = {8};

    model.head.crc = checksum(model);
    if (blw_kalman_init(&filter, &model, mem, sizeof mem / sizeof mem[0]) != BLW_OK) {
        return 1;
    }
    if (blw_estimator_step(&filter.base, NULL, y, BLW_MASK_ALL(1), &out) != BLW_OK) {
        return 2;
    }
    return ((out.x_hat[0] > BLW_R(3.9)) && (out.x_hat[0] < BLW_R(4.1))) ? 0 : 3;
}
