/* SPDX-License-Identifier: MIT */
/** @file blw_port_socketcan.h  Linux SocketCAN, classic and FD, as a port.
 *
 *  Frames of more than 8 bytes go out as CAN FD, shorter ones as classic CAN.  Extended
 *  identifiers and remote frames are foreign.  A full queue (ENOBUFS) is no error: send() says that
 *  there is no room.  Bus off comes as an error frame.  It ends with the controller's restart
 *  (`restart-ms` of the interface), or when the interface is set down and up: the next frame shows.
 */
#ifndef BLW_PORT_SOCKETCAN_H
#define BLW_PORT_SOCKETCAN_H
#include "blw_posix.h"
#ifdef __cplusplus
extern "C" {
#endif

/** Since open(); never reset. */
typedef struct blw_socketcan_counters {
    uint64_t sent;
    uint64_t received;
    uint64_t foreign;  /**< frames with extended identifiers, remote frames */
    uint64_t no_room;  /**< sends refused because the queue was full */
    uint64_t overruns; /**< frames that the kernel dropped because they were not read in time */
    uint64_t bus_off;  /**< times */
    uint64_t errors;   /**< error frames but bus off and restart */
    uint64_t lost;     /**< times that the link was lost: interface down or gone */
} blw_socketcan_counters_t;

/** The caller owns it; to be read: counters, down, bus_off. */
typedef struct blw_port_socketcan {
    blw_port_t               base;
    char                     name[16]; /* of the interface */
    int                      fd;       /* -1 while the link is lost */
    bool                     can_fd;
    bool                     down;          /**< the interface is down or gone */
    bool                     bus_off;       /**< the controller is off the bus */
    uint32_t                 overruns_seen; /* the kernel's counter of this socket */
    uint64_t                 retry_us;
    blw_socketcan_counters_t counters;
} blw_port_socketcan_t;

/** Open an interface.  @param can_fd also CAN FD frames
 *  @return 0, or errno with nothing left open. */
int blw_port_socketcan_open(blw_port_socketcan_t *self, const char *interface, bool can_fd);
/** Take an open socket over, such as one end of a pair that carries struct can_frame and
 *  canfd_frame.  It is not opened again. */
int  blw_port_socketcan_adopt(blw_port_socketcan_t *self, int fd, bool can_fd);
void blw_port_socketcan_close(blw_port_socketcan_t *self);
/** For poll(); -1 while there is none. */
int blw_port_socketcan_handle(const blw_port_socketcan_t *self);
#ifdef __cplusplus
}
#endif
#endif
