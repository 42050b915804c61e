/* SPDX-License-Identifier: MIT */
#include "blw_port_replay.h"
#include <errno.h>
#include <inttypes.h>
#include <string.h>

#define LINE_MAX_BYTES   512U
#define AFTER_THE_END_US 1000000U /* so that the last step meets its deadline */

static bool read_byte(const char *hex, uint8_t *byte)
{
    unsigned value = 0U;
    int      used  = 0;

    if ((sscanf(hex, "%2x%n", &value, &used) != 1) || (used != 2)) {
        return false;
    }
    *byte = (uint8_t)value;
    return true;
}

/* "#2A36": classic; "##12A36": FD with its flags. */
static bool read_data(const char *text, blw_frame_t *frame)
{
    const bool   fd     = text[1] == '#';
    const char  *hex    = (fd && (text[2] != '\0')) ? &text[3] : &text[1];
    const size_t digits = strlen(hex);
    const size_t bytes  = digits / 2U;

    if (((digits % 2U) != 0U) || (bytes > (fd ? BLW_FRAME_MAX : BLW_FRAME_CLASSIC_MAX))) {
        return false;
    }
    frame->len = (uint8_t)bytes;
    for (size_t i = 0U; i < bytes; i++) {
        if (!read_byte(&hex[2U * i], &frame->data[i])) {
            return false;
        }
    }
    return true;
}

/* "(1436509052.249713) vcan0 101#..." */
static bool read_line(const char *line, blw_frame_t *frame)
{
    char     id[16];
    char     data[160];
    uint64_t seconds      = 0U;
    uint64_t microseconds = 0U;
    unsigned number       = 0U;

    if ((sscanf(line, "(%" SCNu64 ".%6" SCNu64 ") %*31s %15[0-9A-Fa-f]%159s", &seconds,
                &microseconds, id, data)
         != 4)
        || (strlen(id) != 3U) || (data[0] != '#') || (sscanf(id, "%x", &number) != 1)
        || (number > 0x7FFU)) {
        return false;
    }
    frame->t_us = (seconds * 1000000U) + microseconds;
    frame->id   = (uint16_t)number;
    return read_data(data, frame);
}

static void advance(blw_port_replay_t *self)
{
    char line[LINE_MAX_BYTES];

    while (fgets(line, (int)sizeof line, self->file) != NULL) {
        if (read_line(line, &self->next)) {
            if (self->next.t_us > self->now_us) {
                self->now_us = self->next.t_us;
            }
            self->next.t_us = self->now_us; /* time never goes back */
            return;
        }
        self->skipped++;
    }
    self->ended = true;
    self->now_us += AFTER_THE_END_US;
}

static uint64_t replay_now_us(blw_port_t *base)
{
    return ((const blw_port_replay_t *)base)->now_us;
}

static bool replay_recv(blw_port_t *base, blw_frame_t *frame)
{
    blw_port_replay_t *const self = (blw_port_replay_t *)base;

    if (self->ended) {
        return false;
    }
    *frame = self->next;
    advance(self);
    return true;
}

static bool replay_send(blw_port_t *base, const blw_frame_t *frame)
{
    (void)base;
    (void)frame;
    return true;
}

static const blw_port_ops_t replay_ops = {
    .now_us = replay_now_us, .recv = replay_recv, .send = replay_send};

int blw_port_replay_open(blw_port_replay_t *self, const char *path)
{
    (void)memset(self, 0, sizeof *self);
    self->base.ops = &replay_ops;
    self->file     = fopen(path, "r");
    if (self->file == NULL) {
        return errno;
    }
    advance(self);
    return 0;
}

void blw_port_replay_close(blw_port_replay_t *self)
{
    if (self->file != NULL) {
        (void)fclose(self->file);
        self->file = NULL;
    }
}
