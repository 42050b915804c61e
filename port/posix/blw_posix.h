/* SPDX-License-Identifier: MIT */
/** @file blw_posix.h  What the POSIX back ends share.
 *
 *  Every back end may lose its link (interface down or gone, peer closed, socket error).  It then
 *  says so in its `down` member, counts, and tries to open it again every BLW_POSIX_RETRY_US; the
 *  node meanwhile hears nothing and goes on predicting.
 */
#ifndef BLW_POSIX_H
#define BLW_POSIX_H
#include "blw/blw_port.h"
#ifdef __cplusplus
extern "C" {
#endif

#define BLW_POSIX_RETRY_US 100000U

/** CLOCK_MONOTONIC. */
uint64_t blw_posix_now_us(void);
/** Do not block and do not survive exec.  @return 0 or errno. */
int blw_posix_prepare(int fd);
#ifdef __cplusplus
}
#endif
#endif
