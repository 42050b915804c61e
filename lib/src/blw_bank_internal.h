/* SPDX-License-Identifier: MIT */
/** @file blw_bank_internal.h  Private: the parts of blw_bank.c that stand in files of their own. */
#ifndef BLW_BANK_INTERNAL_H
#define BLW_BANK_INTERNAL_H
#include "blw/blw_bank.h"

/** In past_e with max_gap: there was no sample. */
#define BLW_BANK_NO_SAMPLE BLW_REAL_MAX

static inline bool blw_bank_has(unsigned mask, size_t i)
{
    return ((mask >> i) & 1U) != 0U;
}

/** y = y + alpha a, a = the column of a matrix with n rows that starts at *A; in place */
static inline void blw_bank_add_column(size_t n, size_t columns, const blw_real_t *A,
                                       blw_real_t alpha, blw_real_t *y)
{
    for (size_t i = 0U; i < n; i++) {
        y[i] += A[i * columns] * alpha;
    }
}

/** Check sizes, masks, signs and all tables. */
blw_status_t blw_bank_check(const blw_bank_model_t *model);
/** Forget all averages and decisions. */
void blw_bank_judge_reset(blw_bank_t *self);
/** (2) to (5) for the block that ends in the newest slot. */
void blw_bank_judge(blw_bank_t *self);

#endif
