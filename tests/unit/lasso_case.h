/* SPDX-License-Identifier: MIT */
/* The small lasso that its tests share.  Included once in a test. */
#ifndef LASSO_CASE_H
#define LASSO_CASE_H
#include "support.h"

#define MEM   BLW_LASSO_MEM(1, 3, 3, 2, 3, 0)
#define MEM_P BLW_LASSO_MEM(1, 3, 3, 2, 3, 1)

/* From x0 = 4 with u = 1: x_bar = 3 and zeta_i = 8/4 + (y_i - offset_i) + 1. */
static const blw_real_t u[1]        = {BLW_R(1.0)};
static const blw_real_t benign[3]   = {BLW_R(4.5), BLW_R(5.0), BLW_R(5.5)};  /* zeta 6.5 6 5.5 */
static const blw_real_t attacked[3] = {BLW_R(14.0), BLW_R(5.0), BLW_R(6.0)}; /* zeta 16 6 6 */

static support_lasso_t     made;
static blw_real_t          mem[MEM_P];
static blw_lasso_t         filter;
static blw_estimator_out_t out;

static void start(blw_method_t method)
{
    support_lasso_make(&made, method);
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_init(&filter, &made.model, mem, MEM_P));
}

void setUp(void)
{
    start(BLW_METHOD_LASSO);
}

void tearDown(void) {}

static void step(const blw_real_t *y, blw_mask_t valid)
{
    TEST_ASSERT_EQUAL_INT(BLW_OK, blw_lasso_step(&filter, u, y, valid, &out));
}

#endif
