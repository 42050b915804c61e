/* SPDX-License-Identifier: MIT */
/** @file blw_wire.h  Frames to numbers and back: the layout of everything a node sends or hears.
 *
 *  docs/wire.md has the same as a table.  All numbers are little-endian, values are IEEE 754
 *  float32.  seq = k mod 65536 is the step a frame belongs to.  The identifier fixes the layout:
 *
 *    0x080        sync        0..3 k, 4..6 low 24 bits of the model's id, 7 CRC
 *    0x100 + i    measurement 0..3 y_i, 4..5 seq, 6 flags, 7 CRC
 *    0x140 + i    zeta        as measurement, one frame per local state of sensor i
 *    0x180 + i    input       as measurement, u_i that acted from step seq - 1 to seq
 *    0x200 + j    estimate    0..3 x_hat_2j, 4..7 x_hat_2j+1 (if there is one); see status
 *    0x280        status      0..1 seq, 2 outcome, 3 flags, 4 events, 5 iterations (255 = or more),
 *                             6 CRC of the estimate's 4 n bytes, 7 CRC; sent after the estimate
 *    0x281 + g    sensors     0..1 seq, then one bit for each of the sensors 8 g .. 8 g + 7:
 *                             2 excluded, 3 missing, 4 rejected, 5 suspicious; 6 zero, 7 CRC
 *  and on CAN FD, up to 14 values in a frame, block b starting at value 14 b:
 *    0x090 + b    measurement 0..1 seq, 2..3 valid (bit j: value j is a sample), 4 count, 5..6
 *    0x0a0 + b    input       zero, 7 CRC, from 8 on the values, zeros up to the next length that
 *    0x0c0 + b    estimate    CAN FD has
 *    0x300 + 64 b + i  zeta of sensor i
 *
 *  flags: bit 0 = the value is a sample; bits 1..7 = number of the local state (zeta), else 0.
 *  CRC: CRC-8 SAE J1850 (polynomial 0x1D, start and final xor 0xFF) over the identifier's two bytes
 *  and all bytes of the frame but byte 7; the estimate's over its values alone.
 *
 *  Nothing here keeps state.  Decoding takes any bytes and never reads outside them.
 */
#ifndef BLW_WIRE_H
#define BLW_WIRE_H
#include "blw/blw_port.h"
#ifdef __cplusplus
extern "C" {
#endif

#define BLW_WIRE_VALUES      14U         /**< most values in a frame */
#define BLW_WIRE_MAX_SENSORS 64U         /**< as BLW_MAX_SENSORS */
#define BLW_WIRE_MAX_INPUTS  128U        /**< that have an identifier */
#define BLW_WIRE_MAX_STATES  255U        /**< that have an identifier */
#define BLW_WIRE_MAX_ZETA    64U         /**< local states of one sensor */
#define BLW_WIRE_K_END       UINT32_MAX  /**< k of a sync that says: there will be no more steps */
#define BLW_WIRE_MODEL_BITS  0x00FFFFFFU /**< what a sync carries of the model's id */
#define BLW_WIRE_SENSORS     8U          /**< sensors in one sensors frame */

typedef enum blw_wire_kind {
    BLW_WIRE_FOREIGN     = 0, /**< no identifier of ours */
    BLW_WIRE_SYNC        = 1,
    BLW_WIRE_MEASUREMENT = 2,
    BLW_WIRE_INPUT       = 3,
    BLW_WIRE_ESTIMATE    = 4,
    BLW_WIRE_ZETA        = 5,
    BLW_WIRE_STATUS      = 6,
    BLW_WIRE_SENSOR_BITS = 7
} blw_wire_kind_t;

typedef enum blw_wire_result {
    BLW_WIRE_OK         = 0,
    BLW_WIRE_ERR_KIND   = -1, /**< the identifier is of another kind */
    BLW_WIRE_ERR_LAYOUT = -2, /**< wrong length, or bits set that have to be zero */
    BLW_WIRE_ERR_CRC    = -3
} blw_wire_result_t;

typedef enum blw_wire_format { BLW_WIRE_CLASSIC = 0, BLW_WIRE_FD = 1 } blw_wire_format_t;

typedef struct blw_wire_sync {
    uint32_t k;     /**< step that begins, or BLW_WIRE_K_END */
    uint32_t model; /**< low 24 bits of the model's id */
} blw_wire_sync_t;

/** Consecutive values of one kind: y, u, x_hat, or zeta of one sensor. */
typedef struct blw_wire_values {
    uint8_t  kind;   /**< blw_wire_kind_t */
    uint8_t  sensor; /**< zeta: whose; else 0 */
    uint8_t  first;  /**< index of value[0] */
    uint8_t  count;  /**< 1..BLW_WIRE_VALUES */
    uint16_t seq;    /**< 0 in a classic estimate, which has none */
    uint16_t valid;  /**< bit j: value[j] is a sample */
    float    value[BLW_WIRE_VALUES];
} blw_wire_values_t;

typedef struct blw_wire_status {
    uint16_t seq;
    uint8_t  outcome;    /**< blw_outcome_t */
    uint8_t  flags;      /**< BLW_FLAG_... */
    uint8_t  events;     /**< BLW_NODE_EVENT_... of blw_node.h */
    uint8_t  iterations; /**< 255 = 255 or more */
    uint8_t  estimate;   /**< CRC of the estimate, blw_wire_sum_values() */
} blw_wire_status_t;

/** One bit for each of the sensors 8 group .. 8 group + 7. */
typedef struct blw_wire_sensors {
    uint16_t seq;
    uint8_t  group;      /**< 0..7 */
    uint8_t  excluded;   /**< the estimator does not use them */
    uint8_t  missing;    /**< no sample of this step was taken in */
    uint8_t  rejected;   /**< their frames contradict each other */
    uint8_t  suspicious; /**< suspicion above 1/2 */
} blw_wire_sensors_t;

/** Kind of a frame, by its identifier alone. */
blw_wire_kind_t blw_wire_kind(const blw_frame_t *frame);

/** Decode.  *out is written only with BLW_WIRE_OK. */
blw_wire_result_t blw_wire_get_sync(const blw_frame_t *frame, blw_wire_sync_t *out);
/** Decode a measurement, an input, an estimate or a zeta, classic or FD. */
blw_wire_result_t blw_wire_get_values(const blw_frame_t *frame, blw_wire_values_t *out);
blw_wire_result_t blw_wire_get_status(const blw_frame_t *frame, blw_wire_status_t *out);
blw_wire_result_t blw_wire_get_sensors(const blw_frame_t *frame, blw_wire_sensors_t *out);

/** Encode.  Writes id, len and data. */
void blw_wire_put_sync(const blw_wire_sync_t *sync, blw_frame_t *frame);
/** @return false, with nothing written, for values that no frame of the format can hold: a kind
 *  without values, first not a multiple of blw_wire_span(), count above it, or an index too
 *  large. */
bool blw_wire_put_values(const blw_wire_values_t *values, blw_wire_format_t format,
                         blw_frame_t *frame);
void blw_wire_put_status(const blw_wire_status_t *status, blw_frame_t *frame);
/** @param sensors group <= 7 */
void blw_wire_put_sensors(const blw_wire_sensors_t *sensors, blw_frame_t *frame);

/** Most values of that kind in one frame; 0 for a kind without values. */
size_t blw_wire_span(blw_wire_kind_t kind, blw_wire_format_t format);

/** Running CRC-8 over float32 values as they are sent; start with 0. */
uint8_t blw_wire_sum_values(uint8_t sum, const float *value, size_t count);
#ifdef __cplusplus
}
#endif
#endif
