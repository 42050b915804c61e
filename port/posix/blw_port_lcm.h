/* SPDX-License-Identifier: MIT */
/** @file blw_port_lcm.h  LCM as a port: messages of host_sim/lcm/bulwark.lcm to frames and back.
 *
 *  A message on BLW_SYNC, BLW_MEASUREMENT, BLW_INPUT, BLW_ZETA or BLW_ESTIMATE becomes the CAN FD
 *  frames of the same content; numbers are rounded to float32, as on CAN.  A message that does not
 *  decode, or has other dimensions than the model, becomes one frame with a wrong layout, so that
 *  the node counts it and says so.
 *
 *  Frames that are sent are collected until all values of their kind are there and published as one
 *  message; a classic measurement at once, as a message in which only that sensor is valid.  A
 *  status frame publishes the report behind it: BLW_ESTIMATE, BLW_ALARM when the excluded sensors
 *  change, and BLW_HEALTH when something happened on the bus; without a report (a gateway), the
 *  estimate of the frames before it.
 *
 *  input_t.seq is the step from which u acts; the frame's seq is one more, see blw_wire.h.  LCM
 *  hears its own messages: the owner of the port does not listen to what it sends.
 */
#ifndef BLW_PORT_LCM_H
#define BLW_PORT_LCM_H
#include <lcm/lcm.h>
#include "blw/blw_node.h"
#include "blw_posix.h"
#ifdef __cplusplus
extern "C" {
#endif

/** Frames that one message may become, with room for a step. */
#define BLW_LCM_QUEUE 64U

/** Since open(); never reset. */
typedef struct blw_lcm_counters {
    uint64_t sent;      /**< messages */
    uint64_t received;  /**< messages of ours */
    uint64_t malformed; /**< messages that do not decode or do not fit the model */
    uint64_t lost;      /**< times that the socket was lost */
} blw_lcm_counters_t;

/** What is sent: values of one kind until all are there. */
typedef struct blw_lcm_batch {
    double   value[BLW_WIRE_MAX_STATES + 1U];
    int8_t   valid[BLW_WIRE_MAX_STATES + 1U];
    uint16_t seq;
} blw_lcm_batch_t;

/** The caller owns it; to be read: counters, down. */
typedef struct blw_port_lcm {
    blw_port_t               base;
    lcm_t                   *lcm; /* NULL while the socket is lost */
    const char              *url;
    const blw_plant_t       *plant;
    const blw_node_report_t *report; /* behind a status frame; may be NULL */
    const char              *method; /* of the report */
    uint8_t                  width;  /* local states per sensor */
    bool                     down;   /**< there is no socket */
    uint64_t                 retry_us;
    blw_mask_t               excluded; /* in the last alarm */
    uint32_t                 k;        /* of the last sync sent or received */
    size_t                   next;     /* of the queue */
    size_t                   waiting;
    blw_frame_t              queue[BLW_LCM_QUEUE];
    double                   estimate[BLW_WIRE_MAX_STATES + 1U]; /* passed on, until its status */
    blw_lcm_batch_t          batch;
    blw_lcm_counters_t       counters;
} blw_port_lcm_t;

/** Open a provider, such as "udpm://239.255.76.67:7667?ttl=0" or "memq://"; NULL takes
 *  LCM_DEFAULT_URL.
 *  @param url, plant outlive the port
 *  @param width local states per sensor in a zeta; 1 if there are none
 *  @return false if LCM refuses it. */
bool blw_port_lcm_open(blw_port_lcm_t *self, const char *url, const blw_plant_t *plant,
                       uint8_t width);
/** Whose report status frames stand for.  Both outlive the port. */
void blw_port_lcm_describe(blw_port_lcm_t *self, const char *method,
                           const blw_node_report_t *report);
void blw_port_lcm_close(blw_port_lcm_t *self);
/** For poll(); -1 while there is none. */
int blw_port_lcm_handle(const blw_port_lcm_t *self);
#ifdef __cplusplus
}
#endif
#endif
