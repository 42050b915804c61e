/* SPDX-License-Identifier: MIT */
#include "blw_port_socketcan.h"
#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#define RECEIVE_BUFFER 4194304 /* a second of a full bus and more */

static int configure(int fd, bool can_fd)
{
    const can_err_mask_t errors = CAN_ERR_MASK;
    const int            on     = 1;
    const int            buffer = RECEIVE_BUFFER;

    if (can_fd && (setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) < 0)) {
        return errno;
    }
    if ((setsockopt(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) < 0)
        || (setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on) < 0)) {
        return errno;
    }
    if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &buffer, sizeof buffer) < 0) {
        (void)setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &buffer, sizeof buffer); /* what is allowed */
    }
    return blw_posix_prepare(fd);
}

static int attach(int fd, const char *interface)
{
    struct ifreq        request;
    struct sockaddr_can address;

    (void)memset(&request, 0, sizeof request);
    (void)memcpy(request.ifr_name, interface, strlen(interface) + 1U); /* at most 16 bytes */
    if (ioctl(fd, SIOCGIFINDEX, &request) < 0) {
        return errno;
    }
    (void)memset(&address, 0, sizeof address);
    address.can_family  = AF_CAN;
    address.can_ifindex = request.ifr_ifindex;
    return (bind(fd, (const struct sockaddr *)&address, sizeof address) < 0) ? errno : 0;
}

static int open_socket(blw_port_socketcan_t *self)
{
    const int fd = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    if (fd < 0) {
        return errno;
    }
    int error = configure(fd, self->can_fd);
    if (error == 0) {
        error = attach(fd, self->name);
    }
    if (error != 0) {
        (void)close(fd);
        return error;
    }
    self->fd            = fd;
    self->overruns_seen = 0U;
    self->bus_off       = false;
    return 0;
}

/* The interface is down (the socket stays) or gone (it is opened again later). */
static void lose(blw_port_socketcan_t *self, int error)
{
    if (!self->down) {
        self->counters.lost++;
    }
    self->down = true;
    if (error != ENETDOWN) {
        (void)close(self->fd);
        self->fd       = -1;
        self->retry_us = blw_posix_now_us() + BLW_POSIX_RETRY_US;
    }
}

static bool alive(blw_port_socketcan_t *self)
{
    if (self->fd >= 0) {
        return true;
    }
    const uint64_t now_us = blw_posix_now_us();
    if ((now_us < self->retry_us) || (self->name[0] == '\0')) {
        return false;
    }
    self->retry_us = now_us + BLW_POSIX_RETRY_US;
    return open_socket(self) == 0;
}

/* A controller that is off the bus may say so more than once. */
static void take_error_frame(blw_port_socketcan_t *self, uint32_t id)
{
    if ((id & CAN_ERR_BUSOFF) != 0U) {
        self->counters.bus_off += self->bus_off ? 0U : 1U;
        self->bus_off = true;
    } else if ((id & CAN_ERR_RESTARTED) != 0U) {
        self->bus_off = false;
    } else {
        self->counters.errors++;
    }
}

/* The kernel's count of dropped frames comes with a message, if any were dropped. */
static void take_overruns(blw_port_socketcan_t *self, struct msghdr *message)
{
    for (struct cmsghdr *c = CMSG_FIRSTHDR(message); c != NULL; c = CMSG_NXTHDR(message, c)) {
        if ((c->cmsg_level == SOL_SOCKET) && (c->cmsg_type == SO_RXQ_OVFL)) {
            uint32_t dropped;
            (void)memcpy(&dropped, CMSG_DATA(c), sizeof dropped);
            self->counters.overruns += dropped - self->overruns_seen;
            self->overruns_seen = dropped;
        }
    }
}

/* @return whether there was a frame, ours or not. */
static bool read_frame(blw_port_socketcan_t *self, struct canfd_frame *raw)
{
    union {
        struct cmsghdr align;
        char           bytes[CMSG_SPACE(sizeof(uint32_t))];
    } control;
    struct iovec  part    = {.iov_base = raw, .iov_len = sizeof *raw};
    struct msghdr message = {.msg_iov        = &part,
                             .msg_iovlen     = 1U,
                             .msg_control    = control.bytes,
                             .msg_controllen = sizeof control.bytes};
    const ssize_t len     = recvmsg(self->fd, &message, 0);

    if (len < 0) {
        if ((errno != EAGAIN) && (errno != EWOULDBLOCK) && (errno != EINTR)) {
            lose(self, errno);
        }
        return false;
    }
    self->down = false;
    take_overruns(self, &message);
    return (len == (ssize_t)CAN_MTU) || (len == (ssize_t)CANFD_MTU);
}

static bool socketcan_recv(blw_port_t *base, blw_frame_t *frame)
{
    blw_port_socketcan_t *const self = (blw_port_socketcan_t *)base;
    struct canfd_frame          raw;

    while (alive(self) && read_frame(self, &raw)) {
        if ((raw.can_id & CAN_ERR_FLAG) != 0U) {
            take_error_frame(self, raw.can_id);
            continue;
        }
        self->bus_off = false; /* whoever hears a frame is on the bus, restarted or set up again */
        if (((raw.can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG)) != 0U) || (raw.len > BLW_FRAME_MAX)) {
            self->counters.foreign++;
            continue;
        }
        self->counters.received++;
        frame->t_us = blw_posix_now_us();
        frame->id   = (uint16_t)(raw.can_id & CAN_SFF_MASK);
        frame->len  = raw.len;
        (void)memcpy(frame->data, raw.data, raw.len);
        return true;
    }
    return false;
}

static bool socketcan_send(blw_port_t *base, const blw_frame_t *frame)
{
    blw_port_socketcan_t *const self = (blw_port_socketcan_t *)base;
    const bool                  fd   = frame->len > BLW_FRAME_CLASSIC_MAX;
    struct canfd_frame          raw;

    if (!alive(self) || (fd && !self->can_fd)) {
        return false;
    }
    (void)memset(&raw, 0, sizeof raw);
    raw.can_id = frame->id;
    raw.len    = frame->len;
    (void)memcpy(raw.data, frame->data, frame->len);
    if (write(self->fd, &raw, fd ? CANFD_MTU : CAN_MTU) >= 0) {
        self->down = false;
        self->counters.sent++;
        return true;
    }
    if ((errno == ENOBUFS) || (errno == EAGAIN) || (errno == EWOULDBLOCK)) {
        self->counters.no_room++;
    } else if (errno != EINTR) {
        lose(self, errno);
    }
    return false;
}

static uint64_t socketcan_now_us(blw_port_t *base)
{
    (void)base;
    return blw_posix_now_us();
}

static const blw_port_ops_t socketcan_ops = {
    .now_us = socketcan_now_us, .recv = socketcan_recv, .send = socketcan_send};

static void start(blw_port_socketcan_t *self, bool can_fd)
{
    (void)memset(self, 0, sizeof *self);
    self->base.ops = &socketcan_ops;
    self->fd       = -1;
    self->can_fd   = can_fd;
}

int blw_port_socketcan_open(blw_port_socketcan_t *self, const char *interface, bool can_fd)
{
    start(self, can_fd);
    if (strlen(interface) >= sizeof self->name) {
        return ENODEV;
    }
    (void)strncpy(self->name, interface, sizeof self->name - 1U);
    return open_socket(self);
}

int blw_port_socketcan_adopt(blw_port_socketcan_t *self, int fd, bool can_fd)
{
    start(self, can_fd);
    self->fd = fd;
    return blw_posix_prepare(fd);
}

void blw_port_socketcan_close(blw_port_socketcan_t *self)
{
    if (self->fd >= 0) {
        (void)close(self->fd);
        self->fd = -1;
    }
}

int blw_port_socketcan_handle(const blw_port_socketcan_t *self)
{
    return self->fd;
}
