/* SPDX-License-Identifier: MIT */
#include "blw_port_serial.h"
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <termios.h>
#include <unistd.h>

static int open_line(const char *path, int *fd)
{
    struct termios line;

    *fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (*fd < 0) {
        return errno;
    }
    if (tcgetattr(*fd, &line) == 0) { /* else it is no terminal, and raw already */
        cfmakeraw(&line);
        (void)tcsetattr(*fd, TCSANOW, &line);
    }
    return 0;
}

static int open_unix(const char *path, int *fd)
{
    struct sockaddr_un address;

    (void)memset(&address, 0, sizeof address);
    address.sun_family = AF_UNIX;
    if (strlen(path) >= sizeof address.sun_path) {
        return ENAMETOOLONG;
    }
    (void)strncpy(address.sun_path, path, sizeof address.sun_path - 1U);
    *fd = socket(AF_UNIX, SOCK_STREAM, 0);
    if (*fd < 0) {
        return errno;
    }
    return (connect(*fd, (const struct sockaddr *)&address, sizeof address) < 0) ? errno : 0;
}

static int open_tcp(const char *where, int *fd)
{
    const struct addrinfo hints = {.ai_family = AF_UNSPEC, .ai_socktype = SOCK_STREAM};
    const char *const     colon = strrchr(where, ':');
    char                  host[64];
    struct addrinfo      *found = NULL;

    if ((colon == NULL) || ((size_t)(colon - where) >= sizeof host)) {
        return EINVAL;
    }
    (void)memcpy(host, where, (size_t)(colon - where));
    host[colon - where] = '\0';
    if (getaddrinfo(host, &colon[1], &hints, &found) != 0) {
        return EHOSTUNREACH;
    }
    *fd       = socket(found->ai_family, found->ai_socktype, found->ai_protocol);
    int error = (*fd < 0) ? errno : 0;
    if ((error == 0) && (connect(*fd, found->ai_addr, found->ai_addrlen) < 0)) {
        error = errno;
    }
    freeaddrinfo(found);
    return error;
}

static int connect_place(const char *place, int *fd)
{
    if (strncmp(place, "unix:", 5U) == 0) {
        return open_unix(&place[5], fd);
    }
    if (strncmp(place, "tcp:", 4U) == 0) {
        return open_tcp(&place[4], fd);
    }
    return (place[0] == '/') ? open_line(place, fd) : EINVAL;
}

static int open_place(blw_port_serial_t *self)
{
    int fd    = -1;
    int error = connect_place(self->place, &fd);

    if (error == 0) {
        error = blw_posix_prepare(fd);
    }
    if (error != 0) {
        if (fd >= 0) {
            (void)close(fd);
        }
        return error;
    }
    self->fd      = fd;
    self->down    = false;
    self->in_next = 0U;
    self->in_len  = 0U;
    self->out_len = 0U;
    return 0;
}

static void lose(blw_port_serial_t *self)
{
    self->counters.lost++;
    self->down = true;
    (void)close(self->fd);
    self->fd       = -1;
    self->retry_us = blw_posix_now_us() + BLW_POSIX_RETRY_US;
}

static bool alive(blw_port_serial_t *self)
{
    if (self->fd >= 0) {
        return true;
    }
    const uint64_t now_us = blw_posix_now_us();
    if ((now_us < self->retry_us) || (self->place[0] == '\0')) {
        return false;
    }
    self->retry_us = now_us + BLW_POSIX_RETRY_US;
    return open_place(self) == 0;
}

static bool only_later(void)
{
    return (errno == EAGAIN) || (errno == EWOULDBLOCK) || (errno == EINTR);
}

/* A socket whose peer has gone must not raise SIGPIPE. */
static ssize_t put(int fd, const uint8_t *data, size_t len)
{
    const ssize_t sent = send(fd, data, len, MSG_NOSIGNAL);

    return ((sent < 0) && (errno == ENOTSOCK)) ? write(fd, data, len) : sent;
}

/* Send what waits, as far as the line takes it. */
static void flush(blw_port_serial_t *self)
{
    size_t done = 0U;

    while (done < self->out_len) {
        const ssize_t len = put(self->fd, &self->out[done], self->out_len - done);
        if (len < 0) {
            if (!only_later()) {
                lose(self);
                return;
            }
            break;
        }
        done += (size_t)len;
    }
    self->out_len -= done;
    (void)memmove(self->out, &self->out[done], self->out_len);
}

static bool fill(blw_port_serial_t *self)
{
    const ssize_t len = read(self->fd, self->in, sizeof self->in);

    if (len > 0) {
        self->in_next = 0U;
        self->in_len  = (size_t)len;
        return true;
    }
    if ((len == 0) || !only_later()) {
        lose(self);
    }
    return false;
}

static void answer(blw_port_serial_t *self)
{
    const bool command = self->slcan.len > 0U; /* an empty line is an answer itself */

    if (command && (self->out_len < sizeof self->out)) {
        self->out[self->out_len] = (uint8_t)'\r';
        self->out_len++;
    }
}

/* Push what has been read, up to the next frame. */
static bool next_frame(blw_port_serial_t *self, blw_frame_t *frame)
{
    while (self->in_next < self->in_len) {
        const uint8_t           byte  = self->in[self->in_next];
        const blw_slcan_event_t event = blw_slcan_push(&self->slcan, byte, frame);

        self->in_next++;
        if (event == BLW_SLCAN_FRAME) {
            return true;
        }
        if (event == BLW_SLCAN_COMMAND) {
            answer(self);
        } else if (event == BLW_SLCAN_ERROR) {
            self->counters.refused++;
        }
    }
    return false;
}

static bool serial_recv(blw_port_t *base, blw_frame_t *frame)
{
    blw_port_serial_t *const self = (blw_port_serial_t *)base;

    if (!alive(self)) {
        return false;
    }
    flush(self);
    while (self->fd >= 0) {
        if (next_frame(self, frame)) {
            self->counters.received++;
            frame->t_us = blw_posix_now_us();
            return true;
        }
        if (!fill(self)) {
            break;
        }
    }
    return false;
}

static bool serial_send(blw_port_t *base, const blw_frame_t *frame)
{
    blw_port_serial_t *const self = (blw_port_serial_t *)base;
    uint8_t                  line[BLW_SLCAN_LINE_MAX];
    const size_t             len = blw_slcan_write(frame, line);

    if (!alive(self)) {
        return false;
    }
    flush(self);
    if (self->fd < 0) {
        return false;
    }
    if ((self->out_len + len) > sizeof self->out) {
        self->counters.no_room++;
        return false;
    }
    (void)memcpy(&self->out[self->out_len], line, len);
    self->out_len += len;
    self->counters.sent++;
    flush(self);
    return true;
}

static uint64_t serial_now_us(blw_port_t *base)
{
    (void)base;
    return blw_posix_now_us();
}

static const blw_port_ops_t serial_ops = {
    .now_us = serial_now_us, .recv = serial_recv, .send = serial_send};

static void start(blw_port_serial_t *self)
{
    (void)memset(self, 0, sizeof *self);
    self->base.ops = &serial_ops;
    self->fd       = -1;
}

int blw_port_serial_open(blw_port_serial_t *self, const char *place)
{
    start(self);
    if (strlen(place) >= sizeof self->place) {
        return ENAMETOOLONG;
    }
    (void)strncpy(self->place, place, sizeof self->place - 1U);
    return open_place(self);
}

int blw_port_serial_adopt(blw_port_serial_t *self, int fd)
{
    start(self);
    self->fd = fd;
    return blw_posix_prepare(fd);
}

void blw_port_serial_close(blw_port_serial_t *self)
{
    if (self->fd >= 0) {
        (void)close(self->fd);
        self->fd = -1;
    }
}

int blw_port_serial_handle(const blw_port_serial_t *self)
{
    return self->fd;
}
