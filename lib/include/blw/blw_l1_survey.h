/* SPDX-License-Identifier: MIT */
/** @file blw_l1_survey.h  One row of a pass over the tableau of the l1 fusion (blw_l1_tableau.c): the
 *  loop of the library and the straight-line code of a model share it, and so decide alike. */
#ifndef BLW_L1_SURVEY_H
#define BLW_L1_SURVEY_H
#include <math.h>
#include "blw/blw_l1.h"
#ifdef __cplusplus
extern "C" {
#endif

/** Least diagonal element of the tableau to divide by: that of S is about 1.  Below it a row depends on
 *  those that are in. */
#define BLW_L1_PIVOT_MIN (BLW_R(64.0) * BLW_REAL_EPS)

/** Row j has |l_j| = |v| and the limit for it, which is that of no number where v is nu_j.  Its
 *  entry would gain (|v| - limit)^2 / T_jj. */
static inline void blw_l1_look(blw_l1_survey_t *seen, size_t j, blw_real_t v, blw_real_t limit,
                               blw_real_t T_jj)
{
#ifdef BLW_REAL_DOUBLE
    const blw_real_t excess = fabs(v) - limit;
#else
    const blw_real_t excess = fabsf(v) - limit;
#endif
    if (excess > BLW_R(0.0)) {
        const blw_real_t gain = excess * excess;
        if ((gain * seen->over) > (seen->gain * T_jj)) {
            const blw_real_t over = (T_jj < BLW_L1_PIVOT_MIN) ? BLW_L1_PIVOT_MIN : T_jj;
            if ((gain * seen->over) > (seen->gain * over)) {
                seen->gain = gain;
                seen->over = over;
                seen->best = j;
            }
        }
    }
}
#ifdef __cplusplus
}
#endif
#endif
