/* SPDX-License-Identifier: MIT */
/** @file blw_station.h  A sensor node of a split deployment: one local filter on a bus.
 *
 *  For step k a station needs the sync, its own sample (from its owner), the inputs u(k-1), and the
 *  fusion node's estimate x_hat(k-1), sealed by its status frame.  When all are there it steps and
 *  sends its local states (zeta frames).  The next sync ends a step that lacks the sample: the
 *  filter then goes on without it, as the fusion node does.  Without the estimate of the step
 *  before the filter has no reference: the station says nothing until an estimate comes, and starts
 *  again about that one.  At its first step the reference is the model's x0 if that step is 1;
 *  otherwise it waits for an estimate too.
 *
 *  Missing or contradicting inputs keep their last value, as in blw_node.h.
 */
#ifndef BLW_STATION_H
#define BLW_STATION_H
#include "blw/blw_local.h"
#include "blw/blw_port.h"
#include "blw/blw_wire.h"
#ifdef __cplusplus
extern "C" {
#endif

/** Since init(); nothing resets them, each stays at UINT32_MAX. */
typedef struct blw_station_counters {
    uint32_t steps;       /**< local states sent */
    uint32_t no_sample;   /**< steps made without a sample */
    uint32_t no_input;    /**< inputs that kept their last value */
    uint32_t restarts;    /**< times that the reference was lost */
    uint32_t bad_frame;   /**< wrong CRC, layout or value */
    uint32_t conflict;    /**< two values for one step: inputs, samples */
    uint32_t wrong_model; /**< syncs of another model */
    uint32_t unsent;      /**< frames that the link did not take */
} blw_station_counters_t;

/** Station state.  The caller owns it; the members are private but for the counters. */
typedef struct blw_station {
    blw_local_t           *filter;
    blw_port_t            *port;
    blw_real_t            *u;        /* [l] in force */
    blw_real_t            *u_next;   /* [l] for step k */
    blw_real_t            *estimate; /* [n] as its frames come in */
    blw_station_counters_t counters; /**< to be read at any time */
    uint8_t                u_seen[BLW_WIRE_MAX_INPUTS / 8U];
    uint32_t               model;
    uint32_t               k; /* the last sync */
    blw_real_t             y;
    uint16_t               inputs; /* number of bits in u_seen */
    uint8_t                format; /* blw_wire_format_t */
    bool                   joined;
    bool                   made;       /* step k */
    bool                   sampled;    /* y is that of step k */
    bool                   valid;      /* and can be used */
    bool                   referenced; /* the filter is about x_hat(k-1) */
    bool                   corrected;  /* x_hat(k) has come */
} blw_station_t;

/** Number of blw_real_t that init() needs. */
#define BLW_STATION_MEM(n, l) ((size_t)(n) + (2U * (size_t)(l)))

/** Bind everything.  @param filter initialised already  @param model the model's id
 *  @return BLW_OK; or BLW_ERR_ARG or BLW_ERR_MEM with *self untouched. */
blw_status_t blw_station_init(blw_station_t *self, uint32_t model, blw_wire_format_t format,
                              blw_local_t *filter, blw_port_t *port, blw_real_t *mem,
                              size_t mem_len);

/** The sensor's sample of step seq (modulo 65536); another value for the same step is a
 *  contradiction, and then there is no sample. */
void blw_station_sample(blw_station_t *self, uint16_t seq, blw_real_t y, bool valid);

/** Take one frame of those the owner's port receives.  @return whether a step was made and sent. */
bool blw_station_take(blw_station_t *self, const blw_frame_t *frame);
#ifdef __cplusplus
}
#endif
#endif
