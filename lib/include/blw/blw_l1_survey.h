/* SPDX-License-Identifier: MIT */
/** @file blw_l1_survey.h  One row of a pass over the multipliers or the tableau of the l1 fusion
 *  (blw_l1.c, blw_l1_tableau.c): the loop of the library and the straight-line code of a model share
 *  it, and so decide alike. */
#ifndef BLW_L1_SURVEY_H
#define BLW_L1_SURVEY_H
#include <math.h>
#include "blw/blw_l1.h"
#ifdef __cplusplus
extern "C" {
#endif

/** The larger of `most` and size / c, without a division where that is `most`; once it is not
 *  finite, a NaN included, it stays. */
static inline blw_real_t blw_l1_larger(blw_real_t most, blw_real_t size, blw_real_t c)
{
    if (size <= (most * c)) {
        return most;
    }
    return (most <= BLW_REAL_MAX) ? (size / c) : most;
}

/** Least diagonal element of the tableau to divide by: that of S is about 1.  Below it a row
 *  depends on those that are in. */
#define BLW_L1_PIVOT_MIN (BLW_R(64.0) * BLW_REAL_EPS)

/** A nu that has turned round comes first: its gain counts so many times. */
#define BLW_L1_TURNED BLW_R(1e12)

/** Row j has v = l_j or, with one end of low..high at 0, nu_j.  What a sweep on it gains where v is
 *  outside: the square of the way back / |T_jj|. */
static inline void blw_l1_look(blw_l1_survey_t *seen, size_t j, blw_real_t v, blw_real_t low,
                               blw_real_t high, blw_real_t T_jj)
{
    if ((v > high) || (v < low)) {
        const blw_real_t excess = (v > high) ? (v - high) : (low - v);
        const blw_real_t gain   = excess * excess;
        if ((gain * seen->over) > (seen->gain * T_jj)) { /* always where T_jj < 0 */
            const bool       turned = !((low < BLW_R(0.0)) && (high > BLW_R(0.0)));
            const blw_real_t size   = turned ? -T_jj : T_jj;
            const blw_real_t over   = (size < BLW_L1_PIVOT_MIN) ? BLW_L1_PIVOT_MIN : size;
            const blw_real_t counts = turned ? (BLW_L1_TURNED * gain) : gain;
            if ((counts * seen->over) > (seen->gain * over)) {
                seen->best = j;
                seen->gain = counts;
                seen->over = over;
            }
        }
    }
}
#ifdef __cplusplus
}
#endif
#endif
