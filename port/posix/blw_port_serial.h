/* SPDX-License-Identifier: MIT */
/** @file blw_port_serial.h  SLCAN text over a serial line or a stream socket, as a port.
 *
 *  Places:  /dev/ttyUSB0          a serial line: raw, at its present speed
 *           unix:PATH             a stream socket that somebody listens on (QEMU's -chardev socket)
 *           tcp:HOST:PORT
 *  Commands of the other side (C, S6, O, ...) are answered with "\r", as an adapter does.  Sending
 *  is buffered: what the line does not take yet waits, and send() says when the buffer is full.
 */
#ifndef BLW_PORT_SERIAL_H
#define BLW_PORT_SERIAL_H
#include "blw/blw_slcan.h"
#include "blw_posix.h"
#ifdef __cplusplus
extern "C" {
#endif

#define BLW_SERIAL_BUFFER 4096U

/** Since open(); never reset. */
typedef struct blw_serial_counters {
    uint64_t sent;
    uint64_t received;
    uint64_t no_room; /**< sends refused because the buffer was full */
    uint64_t refused; /**< the other side's BEL */
    uint64_t lost;    /**< times that the link was lost */
} blw_serial_counters_t;

/** The caller owns it; to be read: counters, down, slcan.malformed. */
typedef struct blw_port_serial {
    blw_port_t            base;
    char                  place[128];
    int                   fd;   /* -1 while the link is lost */
    bool                  down; /**< the line is closed or gone */
    uint64_t              retry_us;
    blw_slcan_t           slcan;
    size_t                in_next; /* bytes of `in` pushed so far */
    size_t                in_len;
    size_t                out_len;
    uint8_t               in[BLW_SERIAL_BUFFER];
    uint8_t               out[BLW_SERIAL_BUFFER];
    blw_serial_counters_t counters;
} blw_port_serial_t;

/** Open a place.  @return 0, or errno with nothing left open; EINVAL if it has no such form. */
int blw_port_serial_open(blw_port_serial_t *self, const char *place);
/** Take an open stream over, such as one end of a socket pair.  It is not opened again. */
int  blw_port_serial_adopt(blw_port_serial_t *self, int fd);
void blw_port_serial_close(blw_port_serial_t *self);
/** For poll(); -1 while there is none. */
int blw_port_serial_handle(const blw_port_serial_t *self);
#ifdef __cplusplus
}
#endif
#endif
