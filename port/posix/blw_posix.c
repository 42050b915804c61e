/* SPDX-License-Identifier: MIT */
#include "blw_posix.h"
#include <errno.h>
#include <fcntl.h>
#include <time.h>

uint64_t blw_posix_now_us(void)
{
    struct timespec now;

    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return ((uint64_t)now.tv_sec * 1000000U) + ((uint64_t)now.tv_nsec / 1000U);
}

int blw_posix_prepare(int fd)
{
    const int flags = fcntl(fd, F_GETFL);

    if ((flags < 0) || (fcntl(fd, F_SETFL, flags | O_NONBLOCK) < 0)
        || (fcntl(fd, F_SETFD, FD_CLOEXEC) < 0)) {
        return errno;
    }
    return 0;
}
