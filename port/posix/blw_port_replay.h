/* SPDX-License-Identifier: MIT */
/** @file blw_port_replay.h  A candump -L log as a port: its frames, and its time.
 *
 *  The port's time is that of the next frame in the log, so a node on it meets its deadlines as it
 *  did on the bus.  What is sent goes nowhere.  Lines that are no frame of ours (extended
 *  identifiers, remote and error frames, other text) are skipped and counted.
 */
#ifndef BLW_PORT_REPLAY_H
#define BLW_PORT_REPLAY_H
#include <stdio.h>
#include "blw/blw_port.h"
#ifdef __cplusplus
extern "C" {
#endif

typedef struct blw_port_replay {
    blw_port_t  base;
    FILE       *file;
    blw_frame_t next;    /* the frame that will be received */
    bool        ended;   /**< there is none: the log has been received */
    uint64_t    skipped; /**< lines that are no frame of ours */
    uint64_t    now_us;
} blw_port_replay_t;

/** Open a log.  @return 0, or errno. */
int  blw_port_replay_open(blw_port_replay_t *self, const char *path);
void blw_port_replay_close(blw_port_replay_t *self);
#ifdef __cplusplus
}
#endif
#endif
