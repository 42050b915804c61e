/* SPDX-License-Identifier: MIT */
/** @file joint_model.h  The two models of the tests of blw_joint, on the plant of support.h.
 *
 *  With the schedule, pairs (0; 2) and (1; 2), all numbers are computed by hand.  With the
 *  recursion, pairs (0; 1, 2) and (1; 0, 2), sensor 2 strong,
 *      B Q B' = 1/4,  R = [.04 0 .02; 0 .09 0; .02 0 .16],  P0 = .64,  eta = (1, 4),
 *  the expected numbers are NumPy's, from the joint covariance of all errors and noises.
 */
#ifndef JOINT_MODEL_H
#define JOINT_MODEL_H
#include "blw/blw_joint.h"
#include "support.h"

#define MEM BLW_JOINT_MEM(1, 3, 2, 1)

static const uint16_t   first_of_two[3]    = {0U, 2U, 4U};
static const uint16_t   sensor_of_two[4]   = {0U, 2U, 1U, 2U};
static const uint16_t   first_of_three[3]  = {0U, 3U, 6U};
static const uint16_t   sensor_of_three[6] = {0U, 1U, 2U, 1U, 0U, 2U};
static const uint16_t   strong[3]          = {0U, 0U, 1U};
static const blw_real_t scale[2]           = {BLW_R(0.5), BLW_R(0.25)};
static const blw_real_t gains[24]          = {
             BLW_R(0.5),  BLW_R(0.25), BLW_R(0.5), BLW_R(-0.5), BLW_R(0.25), BLW_R(0.0),
             BLW_R(0.25), BLW_R(0.25), BLW_R(1.0), BLW_R(-1.0), BLW_R(0.5),  BLW_R(-0.5),
             BLW_R(0.25), BLW_R(0.25), BLW_R(0.5), BLW_R(-0.5), BLW_R(0.0),  BLW_R(0.0),
             BLW_R(0.25), BLW_R(0.25), BLW_R(0.5), BLW_R(-0.5), BLW_R(0.0),  BLW_R(0.0),
};
static const blw_real_t weights[2]  = {BLW_R(0.5), BLW_R(0.25)};
static const blw_real_t sds[4]      = {BLW_R(1.0), BLW_R(2.0), BLW_R(0.5), BLW_R(0.25)};
static const blw_real_t sds_gap[2]  = {BLW_R(3.0), BLW_R(4.0)};
static const blw_real_t root_W[1]   = {BLW_R(0.5)};
static const blw_real_t root_R[6]   = {BLW_R(0.2), BLW_R(0.0), BLW_R(0.3),
                                       BLW_R(0.1), BLW_R(0.0), BLW_R(0.38729833462074170)};
static const blw_real_t root_P0[1]  = {BLW_R(0.8)};
static const blw_real_t root_eta[2] = {BLW_R(1.0), BLW_R(2.0)};

static support_kalman_t      made; /* for its plant */
static blw_joint_schedule_t  schedule;
static blw_joint_recursive_t recursive;
static blw_joint_model_t     model;

static void seal(void)
{
    blw_table_check_t check;

    (void)blw_model_begin(&model.head, BLW_METHOD_JOINT, &check);
    blw_table_add(&check, model.scale, model.r);
    if (model.schedule != NULL) {
        const size_t steps = schedule.steps;
        blw_table_add(&check, schedule.K, steps * 3U * model.first[model.r]);
        blw_table_add(&check, schedule.G, steps * (model.r - 1U));
        blw_table_add(&check, schedule.sd, steps * model.r);
        blw_table_add(&check, schedule.sd_gap, model.r);
    } else {
        blw_table_add(&check, recursive.V, 1U);
        blw_table_add(&check, recursive.E, 6U);
        blw_table_add(&check, recursive.L0, 1U);
        blw_table_add(&check, recursive.theta_sd, model.r);
    }
    model.head.crc = check.crc;
}

static void make(bool own_gains)
{
    support_kalman_make(&made);
    schedule =
        (blw_joint_schedule_t){.steps = 2U, .K = gains, .G = weights, .sd = sds, .sd_gap = sds_gap};
    recursive =
        (blw_joint_recursive_t){.V = root_W, .E = root_R, .L0 = root_P0, .theta_sd = root_eta};
    model = (blw_joint_model_t){
        .head = {.abi = BLW_MODEL_ABI, .method = (uint8_t)BLW_METHOD_JOINT, .plant = &made.plant},
        .r    = 2U,
        .warm_up   = 1U,
        .first     = own_gains ? first_of_three : first_of_two,
        .sensor    = own_gains ? sensor_of_three : sensor_of_two,
        .strong    = strong,
        .scale     = scale,
        .schedule  = own_gains ? NULL : &schedule,
        .recursive = own_gains ? &recursive : NULL};
    seal();
}

#endif
