/* SPDX-License-Identifier: MIT */
/** @file blw_model.h  What every generated model has in common: the plant and a checked head.
 *
 *      x(k+1) = A x(k) + Bu u(k) + B w(k),    y(k) = C x(k) + offset + v(k) + a(k)            (1)
 *
 *  tools/bulwark design writes these tables; they are const, live in flash and may be shared by any
 *  number of estimators.  Matrices are dense and row-major.  Sensors are counted from 0.
 */
#ifndef BLW_MODEL_H
#define BLW_MODEL_H
#include "blw/blw_real.h"
#include "blw/blw_status.h"
#ifdef __cplusplus
extern "C" {
#endif

/** A set of sensors, bit i for sensor i. */
typedef uint64_t blw_mask_t;

/** Most sensors a plant may have: the width of blw_mask_t. */
#define BLW_MAX_SENSORS 64U

/** The mask of all m sensors, 1 <= m <= BLW_MAX_SENSORS. */
#define BLW_MASK_ALL(m) (~(blw_mask_t)0 >> (BLW_MAX_SENSORS - (m)))

/** Layout version of the tables and width of blw_real_t: a float library refuses a double table. */
#define BLW_MODEL_ABI ((uint16_t)(0x0200U + sizeof(blw_real_t)))

/** One of two checksums, for tables that are compiled as float or as double. */
#ifdef BLW_REAL_DOUBLE
#define BLW_CRC(f32, f64) (f64)
#else
#define BLW_CRC(f32, f64) (f32)
#endif

typedef enum blw_method {
    BLW_METHOD_KALMAN    = 1,
    BLW_METHOD_LASSO     = 2,
    BLW_METHOD_CANONICAL = 3,
    BLW_METHOD_JOINT     = 4,
    BLW_METHOD_DECENTRAL = 5,
    BLW_METHOD_BANK      = 6,
    BLW_METHOD_GUARD     = 7
} blw_method_t;

/** The plant (1), as far as an estimator needs it. */
typedef struct blw_plant {
    uint8_t           n;      /**< states, >= 1 */
    uint8_t           m;      /**< sensors, 1..BLW_MAX_SENSORS */
    uint8_t           l;      /**< known inputs, may be 0 */
    uint8_t           p;      /**< sensors that may be attacked, < m */
    const blw_real_t *A;      /**< [n x n] */
    const blw_real_t *Bu;     /**< [n x l], NULL if l = 0 */
    const blw_real_t *C;      /**< [m x n] */
    const blw_real_t *offset; /**< [m] constant part of y */
    const blw_real_t *y_min;  /**< [m] a sample below is missing; may be -BLW_REAL_MAX */
    const blw_real_t *y_max;  /**< [m] a sample above is missing; > y_min */
    const blw_real_t *x0;     /**< [n] x_hat(0), within BLW_SIGNAL_MAX */
} blw_plant_t;

/** First member of the model of every method. */
typedef struct blw_model {
    uint16_t           abi;    /**< BLW_MODEL_ABI */
    uint8_t            method; /**< blw_method_t: whose tables follow */
    uint32_t           crc;    /**< CRC-32 of the plant's and the method's real tables, in the order
                                    in which the structures declare them */
    const blw_plant_t *plant;
} blw_model_t;

/** The real tables of one model while init() walks through them: checked and summed up. */
typedef struct blw_table_check {
    uint32_t crc; /**< CRC-32 so far */
    bool     ok;  /**< no table so far was NULL or held a NaN or an infinity */
} blw_table_check_t;

/** Start a walk. */
void blw_table_begin(blw_table_check_t *check);
/** Add a table of len numbers; len = 0 adds nothing, and table may then be NULL. */
void blw_table_add(blw_table_check_t *check, const blw_real_t *table, size_t len);
/** Add one number that a structure holds itself. */
void blw_table_add_real(blw_table_check_t *check, blw_real_t value);

/** Check abi, method, plant dimensions and ranges, and add the plant's tables to a fresh walk.
 *  @return BLW_OK, BLW_ERR_ARG (model is NULL) or BLW_ERR_MODEL. */
blw_status_t blw_model_begin(const blw_model_t *model, blw_method_t method,
                             blw_table_check_t *check);
/** End the walk: every table was sound and the sum is model->crc. */
blw_status_t blw_model_end(const blw_model_t *model, const blw_table_check_t *check);

/** u [l] is within BLW_SIGNAL_MAX.  u may be NULL, which means 0. */
bool blw_plant_input_ok(const blw_plant_t *plant, const blw_real_t *u);
/** The samples that can be used: those in valid that are inside their range and, whatever the range
 *  says, within BLW_SIGNAL_MAX. */
blw_mask_t blw_plant_screen(const blw_plant_t *plant, const blw_real_t *y, blw_mask_t valid);
/** x_bar = A x + Bu u, [n].  u may be NULL.  x_bar must not be x.  n (n + l) multiply-adds.
 *  An x_bar beyond BLW_SIGNAL_MAX (an unstable plant predicted without samples for long) is
 *  replaced by x0, so that the estimate recovers when samples come back. */
void blw_plant_predict(const blw_plant_t *plant, const blw_real_t *x, const blw_real_t *u,
                       blw_real_t *x_bar);
/** Innovations about a prediction: e_i = y_i - offset_i - C_i x_bar, and 0 for a sample that is not
 *  in valid, which amounts to taking its prediction for it.  m n multiply-adds.
 *  @param e [m], may not be y. */
void blw_plant_innovate(const blw_plant_t *plant, const blw_real_t *y, blw_mask_t valid,
                        const blw_real_t *x_bar, blw_real_t *e);
/** Number of sensors in a set. */
unsigned blw_mask_count(blw_mask_t mask);
#ifdef __cplusplus
}
#endif
#endif
