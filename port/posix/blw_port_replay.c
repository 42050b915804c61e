/* SPDX-License-Identifier: MIT */
#include "blw_port_replay.h"
#include <errno.h>
#include <string.h>

#define LINE_MAX_BYTES   512U
#define AFTER_THE_END_US 1000000U /* so that the last step meets its deadline */

static unsigned digit_of(char letter)
{
    static const char digits[] = "0123456789abcdef0123456789ABCDEF";
    const char *const found    = (letter != '\0') ? strchr(digits, letter) : NULL;

    return (found != NULL) ? ((unsigned)(found - digits) % 16U) : 16U;
}

/* A number of least to most digits; *text goes behind it. */
static bool take_number(const char **text, unsigned base, size_t least, size_t most,
                        uint64_t *value)
{
    size_t count = 0U;

    *value = 0U;
    while ((count < most) && (digit_of(**text) < base)) {
        *value = (*value * base) + digit_of(**text);
        (*text)++;
        count++;
    }
    return count >= least;
}

static bool take_letter(const char **text, char letter)
{
    const bool there = **text == letter;

    *text += there ? 1 : 0;
    return there;
}

/* Nothing more on the line but the direction that some programs write: " R" or " T". */
static bool is_end(const char *text)
{
    const size_t spaces = strspn(text, " ");

    text += spaces;
    if ((spaces > 0U) && ((*text == 'R') || (*text == 'T'))) {
        text++;
    }
    return strspn(text, " \r\n") == strlen(text);
}

/* "2A36": classic; "#12A36": FD with its flags. */
static bool read_data(const char *text, blw_frame_t *frame)
{
    const size_t most  = (*text == '#') ? BLW_FRAME_MAX : BLW_FRAME_CLASSIC_MAX;
    uint64_t     value = 0U;
    size_t       count = 0U;

    if (take_letter(&text, '#') && !take_number(&text, 16U, 1U, 1U, &value)) {
        return false;
    }
    while ((count < most) && (digit_of(*text) < 16U)) {
        if (!take_number(&text, 16U, 2U, 2U, &value)) {
            return false;
        }
        frame->data[count] = (uint8_t)value;
        count++;
    }
    frame->len = (uint8_t)count;
    return is_end(text);
}

/* "(1436509052.249713) vcan0 101#..." */
static bool read_line(const char *line, blw_frame_t *frame)
{
    uint64_t seconds      = 0U;
    uint64_t microseconds = 0U;
    uint64_t id           = 0U;

    if (!take_letter(&line, '(') || !take_number(&line, 10U, 1U, 12U, &seconds)
        || !take_letter(&line, '.') || !take_number(&line, 10U, 6U, 6U, &microseconds)
        || !take_letter(&line, ')')) {
        return false;
    }
    line += strspn(line, " ");
    line += strcspn(line, " "); /* the interface */
    line += strspn(line, " ");
    if (!take_number(&line, 16U, 3U, 3U, &id) || (id > 0x7FFU) || !take_letter(&line, '#')) {
        return false;
    }
    frame->t_us = (seconds * 1000000U) + microseconds;
    frame->id   = (uint16_t)id;
    return read_data(line, frame);
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
