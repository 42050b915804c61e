/* SPDX-License-Identifier: MIT */
/** @file blw_node.h  One estimator on a bus: collects the frames of a step, steps, sends the
 *  result.
 *
 *  Time.  A sync frame with k begins step k; the node then takes the measurements y(k) and the
 *  inputs u(k-1) until all are there (and settle_us more have passed) or deadline_us after the
 *  sync.  What is missing then is missing for the estimator; a missing input keeps its last value,
 *  as its actuator does.  If no sync comes for a period, the node goes on by its own clock.  A sync
 *  out of turn is believed only when most sensors follow it and the next sync confirms it: then the
 *  node steps blind over a gap of at most max_gap steps, and resets its estimator for anything
 *  else.
 *
 *  Several frames of one sensor for one step.  Equal values are counted (duplicate) and harmless.
 *  Different values are a contradiction: nobody can tell which is true, so neither is used, the
 *  sensor is rejected for that step and `quarantine` more, and the status frame says so.  The same
 *  holds if the contradiction comes after the step was made; with settle_us > 0 the node waits for
 *  it.  Whoever can send a sensor's frames can therefore silence that sensor, but not speak for it
 *  for more than one step.  Contradicting inputs keep the last value.
 *
 *  Frames with a wrong CRC or layout, of past or future steps, and beyond the number that
 *  `babbling` allows are counted, told in the status, and otherwise ignored.
 *
 *  A sensor may say that it has no sample (flag of the measurement): it is missing, but not counted
 *  as lost.  The node waits for the deadline all the same, since somebody else may have said so.
 *
 *  In a split deployment the node collects the r local states (zeta) of every sensor instead of its
 *  sample, for an estimator that takes those for y; they have to come in their order.
 *
 *  Reentrant: all that changes is in *self, its memory, the estimator and the port.
 */
#ifndef BLW_NODE_H
#define BLW_NODE_H
#include "blw/blw_estimator.h"
#include "blw/blw_port.h"
#include "blw/blw_wire.h"
#ifdef __cplusplus
extern "C" {
#endif

/** What happened since the last step; blw_node_report_t.events and the status frame. */
#define BLW_NODE_EVENT_LOST      0x01U /**< a sample or an input was not there in time */
#define BLW_NODE_EVENT_CORRUPT   0x02U /**< a frame with a wrong CRC, layout or value */
#define BLW_NODE_EVENT_ORDER     0x04U /**< a frame of a past or a future step */
#define BLW_NODE_EVENT_DUPLICATE 0x08U /**< the same value twice */
#define BLW_NODE_EVENT_CONFLICT  0x10U /**< two values for one step */
#define BLW_NODE_EVENT_BABBLING  0x20U /**< too many frames */
#define BLW_NODE_EVENT_TIME      0x40U /**< no sync, or one out of turn or of another model */
#define BLW_NODE_EVENT_RESTART   0x80U /**< the estimator was reset: first or renewed contact */

/** Design constants of a node; const, may be shared. */
typedef struct blw_node_config {
    uint32_t model;       /**< the model's id; syncs of another model are refused */
    uint32_t period_us;   /**< time between steps; 0: no clock, only syncs begin steps */
    uint32_t deadline_us; /**< from the sync to the step at the latest, > 0 */
    uint32_t settle_us;   /**< wait for contradictions once all is there; 0: step at once */
    uint16_t quarantine;  /**< steps that a sensor is rejected after a contradiction */
    uint16_t max_gap;     /**< steps that are made up for blindly after a loss of contact */
    uint8_t  babbling;    /**< frames of one sensor in one step that are too many, >= 2 */
    uint8_t  collects;    /**< BLW_WIRE_MEASUREMENT, or BLW_WIRE_ZETA in a split deployment */
    uint8_t  width;       /**< values per sensor: 1 sample, or the r local states */
    uint8_t  format;      /**< blw_wire_format_t of the estimate */
} blw_node_config_t;

/** Frames and steps since init(); nothing resets them, each stays at UINT32_MAX. */
typedef struct blw_node_counters {
    uint32_t steps;        /**< made, blind ones included */
    uint32_t blind;        /**< made without any sample */
    uint32_t taken;        /**< values that were new */
    uint32_t lost;         /**< samples and inputs missing at their step */
    uint32_t bad_crc;      /**< frames */
    uint32_t bad_layout;   /**< frames of ours with a wrong length, index or reserved bits */
    uint32_t bad_value;    /**< inputs that are not finite or beyond BLW_SIGNAL_MAX */
    uint32_t stale;        /**< values of a past step */
    uint32_t out_of_order; /**< values of a future step, local states out of order */
    uint32_t duplicate;    /**< values received before */
    uint32_t conflict;     /**< values that contradict one received before */
    uint32_t babbling;     /**< frames beyond config.babbling */
    uint32_t bad_sync;     /**< syncs out of turn or too early */
    uint32_t wrong_model;  /**< syncs of another model */
    uint32_t no_sync;      /**< steps begun by the node's own clock */
    uint32_t restarts;     /**< resets of the estimator */
    uint32_t unsent;       /**< frames that the link did not take before the next step */
} blw_node_counters_t;

/** One step that was made. */
typedef struct blw_node_report {
    uint32_t            k;
    blw_mask_t          rejected; /**< sensors whose frames contradict each other */
    blw_mask_t          missing;  /**< sensors without a usable sample */
    uint8_t             events;   /**< BLW_NODE_EVENT_... */
    blw_estimator_out_t out;      /**< holds until the next step */
} blw_node_report_t;

/** Node state.  The caller owns it; the members are private but for the counters. */
typedef struct blw_node {
    const blw_node_config_t *config;
    const blw_plant_t       *plant;
    blw_estimator_t         *estimator;
    blw_port_t              *port;
    blw_node_counters_t      counters;                         /**< to be read at any time */
    blw_node_report_t        report;                           /* of the last step */
    blw_real_t              *y;                                /* [m width] of step k */
    blw_real_t              *y_last;                           /* [m width] of the last step */
    blw_real_t              *u;                                /* [l] in force */
    blw_real_t              *u_next;                           /* [l] for step k */
    blw_mask_t               complete;                         /* sensors of which all is here */
    blw_mask_t               complete_last;                    /* the same for the last step */
    blw_mask_t               absent;                           /* that said they have no sample */
    blw_mask_t               followers;                        /* sensors that follow a candidate */
    blw_mask_t               conflict;                         /* sensors in contradiction */
    uint8_t                  parts[BLW_MAX_SENSORS];           /* values here, <= width */
    uint8_t                  frames[BLW_MAX_SENSORS];          /* values heard in this step */
    uint16_t                 quarantine[BLW_MAX_SENSORS];      /* steps left */
    uint8_t                  u_seen[BLW_WIRE_MAX_INPUTS / 8U]; /* bit set: in u_next */
    uint8_t                  u_conflict[BLW_WIRE_MAX_INPUTS / 8U];
    uint64_t                 opened_us;    /* begin of step k, or of the last one */
    uint64_t                 completed_us; /* when the last value came */
    uint32_t                 k;            /* step being collected */
    uint32_t                 candidate;    /* a sync out of turn, waiting for its successor */
    uint16_t                 behind;       /* steps to be made blind */
    uint16_t                 tx_next;      /* next frame of the report to be sent */
    uint16_t                 tx_count;     /* frames of the report */
    uint16_t                 inputs;       /* number of bits in u_seen */
    uint8_t                  events;       /* since the last step */
    bool                     joined;       /* k is known */
    bool                     open;         /* step k has begun */
    bool                     doubting;     /* there is a candidate */
    bool                     ended;        /* the last sync said so */
} blw_node_t;

/** Number of blw_real_t that init() needs. */
#define BLW_NODE_MEM(m, width, l) ((2U * (size_t)(m) * (size_t)(width)) + (2U * (size_t)(l)))

/** Bind everything.  The estimator is initialised already, with a model of that plant.
 *  @return BLW_OK; or BLW_ERR_ARG (a pointer is NULL, a constant out of range, more sensors, states
 *  or inputs than have identifiers) or BLW_ERR_MEM, with *self untouched. */
blw_status_t blw_node_init(blw_node_t *self, const blw_node_config_t *config,
                           const blw_plant_t *plant, blw_estimator_t *estimator, blw_port_t *port,
                           blw_real_t *mem, size_t mem_len);

/** Take waiting frames, make a step if one is due, send what the link takes.  Call it often; it
 *  makes at most one step and takes at most BLW_NODE_BURST frames.
 *  @return the report of the step, or NULL if none was made. */
const blw_node_report_t *blw_node_poll(blw_node_t *self);

/** Frames that one poll() takes at most, so that a flood cannot keep it from its deadline. */
#define BLW_NODE_BURST 256U

/** The last sync said that there will be no more steps, and everything has been sent. */
bool blw_node_done(const blw_node_t *self);
#ifdef __cplusplus
}
#endif
#endif
