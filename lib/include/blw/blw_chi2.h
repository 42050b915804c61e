/* SPDX-License-Identifier: MIT */
/** @file blw_chi2.h  Windowed chi-square attack detector on the innovations r(k) of one filter.
 *
 *  Without attack r(k) ~ N(0, S), white.  With S = L L' and g(k) = |L^-1 r(k)|^2,
 *      G(k) = g(k-w+1) + ... + g(k)  ~  chi2(p w),   w = min(k, W),                           (1)
 *  and the detector alarms unless  G(k) <= thr[w-1] = F^-1(1 - alpha; p w).                   (2)
 *
 *  tools/bulwark design computes L^-1 and thr[] for several rates alpha, so a step needs no
 *  division and no libm.  It emits a detector for the innovations of the Kalman filter,
 *  r = y - offset - C x_bar with x_bar of blw_plant_predict().  A NaN fails (2): bad data alarm.
 *  Reentrant: all that changes is in *self and mem.
 */
#ifndef BLW_CHI2_H
#define BLW_CHI2_H
#include "blw/blw_model.h"
#ifdef __cplusplus
extern "C" {
#endif

/** Design constants: generated, const, in flash, shared by any number of detectors. */
typedef struct blw_chi2_model {
    uint16_t          abi;     /**< BLW_MODEL_ABI */
    uint32_t          crc;     /**< CRC-32 of the tables in their order */
    uint8_t           p;       /**< residual dimension, >= 1 */
    uint8_t           W;       /**< window length in samples, >= 1 */
    uint8_t           n_rates; /**< false-alarm rates to choose from, >= 1 */
    const blw_real_t *Linv;    /**< [p (p + 1) / 2] L^-1, lower triangle, packed by rows */
    const blw_real_t *rate;    /**< [n_rates] alpha, in (0, 1); the first is the default */
    const blw_real_t *thr;     /**< [n_rates x W] thresholds for w = 1..W; positive, growing in w */
} blw_chi2_model_t;

/** Detector state.  The caller owns it; the members are private. */
typedef struct blw_chi2 {
    const blw_chi2_model_t *model;
    const blw_real_t       *thr;  /* [W] of the rate in use */
    blw_real_t             *g;    /* [W] ring of the last g(k) */
    uint8_t                 head; /* slot of the next g(k) */
    uint8_t                 fill; /* w of (1) */
} blw_chi2_t;

typedef struct blw_chi2_out {
    blw_real_t g;     /**< g(k), dimensionless */
    blw_real_t G;     /**< G(k) of (1) */
    blw_real_t thr;   /**< the threshold G(k) was held against */
    bool       alarm; /**< outcome of (2) */
} blw_chi2_out_t;

/** Number of blw_real_t that init() needs; a constant expression if W is one. */
#define BLW_CHI2_MEM(W) ((size_t)(W))

/** Bind model and memory, take the default rate, reset.  Checks every table entry once, so that
 *  step() need not.
 *  @return BLW_OK; or BLW_ERR_ARG, BLW_ERR_MODEL, BLW_ERR_MEM with *self untouched. */
blw_status_t blw_chi2_init(blw_chi2_t *self, const blw_chi2_model_t *model, blw_real_t *mem,
                           size_t mem_len);
/** Hold against the thresholds of another rate of the model; the window stays.
 *  @return BLW_OK, or BLW_ERR_ARG with nothing changed if there is no such rate. */
blw_status_t blw_chi2_select(blw_chi2_t *self, size_t rate);
/** Forget the window; the next step is k = 1.  The rate stays. */
void blw_chi2_reset(blw_chi2_t *self);
/** Take r(k) [p].  Cannot fail.  p (p + 3) / 2 multiply-adds and W adds, whatever the data. */
void blw_chi2_step(blw_chi2_t *self, const blw_real_t *r, blw_chi2_out_t *out);
#ifdef __cplusplus
}
#endif
#endif
