/* SPDX-License-Identifier: MIT */
/** @file blw_lasso_internal.h  Private: what the central estimator and a local filter share. */
#ifndef BLW_LASSO_INTERNAL_H
#define BLW_LASSO_INTERNAL_H
#include "blw/blw_lasso.h"

/** Check every table.  @return BLW_OK or BLW_ERR_MODEL. */
blw_status_t blw_lasso_check(const blw_lasso_model_t *model);

#endif
