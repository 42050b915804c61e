/* SPDX-License-Identifier: MIT */
/** @file blw_status.h  What a function reports: an error (< 0, nothing changed) or success (0). */
#ifndef BLW_STATUS_H
#define BLW_STATUS_H

typedef enum blw_status {
    BLW_OK        = 0,
    BLW_ERR_ARG   = -1, /**< a pointer is NULL, or a size or mask is out of range */
    BLW_ERR_MODEL = -2, /**< a table is missing, not finite, inconsistent, or of another ABI */
    BLW_ERR_MEM   = -3, /**< the memory handed over is too small */
    BLW_ERR_INPUT = -4  /**< a known input u is NaN, infinite or beyond BLW_SIGNAL_MAX */
} blw_status_t;

#endif
