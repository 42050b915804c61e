/* SPDX-License-Identifier: MIT */
#include "blw/blw_slcan.h"

#define BEL         0x07U
#define ID_DIGITS   3U
#define HEAD        (1U + ID_DIGITS + 1U) /* letter, identifier, length */
#define ID_MAX      0x7FFU
#define STAMP       4U
#define NOT_HEX     16U
#define CLASSIC_DLC 8U

/* Bytes of a frame by its length code. */
static const uint8_t length_of[16] = {0U, 1U,  2U,  3U,  4U,  5U,  6U,  7U,
                                      8U, 12U, 16U, 20U, 24U, 32U, 48U, 64U};

static unsigned hex_value(uint8_t letter)
{
    if ((letter >= (uint8_t)'0') && (letter <= (uint8_t)'9')) {
        return (unsigned)letter - (unsigned)'0';
    }
    if ((letter >= (uint8_t)'A') && (letter <= (uint8_t)'F')) {
        return ((unsigned)letter - (unsigned)'A') + 10U;
    }
    if ((letter >= (uint8_t)'a') && (letter <= (uint8_t)'f')) {
        return ((unsigned)letter - (unsigned)'a') + 10U;
    }
    return NOT_HEX;
}

static uint8_t hex_letter(unsigned value)
{
    return (uint8_t)((value < 10U) ? ((unsigned)'0' + value) : ((unsigned)'A' + (value - 10U)));
}

static bool all_hex(const uint8_t *text, size_t len)
{
    for (size_t i = 0U; i < len; i++) {
        if (hex_value(text[i]) == NOT_HEX) {
            return false;
        }
    }
    return true;
}

/* The line is a frame. */
static bool read_frame(const uint8_t *line, size_t len, blw_frame_t *frame)
{
    if ((len < HEAD) || !all_hex(&line[1], len - 1U)) {
        return false;
    }
    const unsigned code  = hex_value(line[HEAD - 1U]) & 0xFU; /* it is a digit */
    const size_t   bytes = length_of[code];
    const unsigned id = (hex_value(line[1]) << 8) | (hex_value(line[2]) << 4) | hex_value(line[3]);
    const bool     whole = (len == (HEAD + (2U * bytes))) || (len == (HEAD + (2U * bytes) + STAMP));
    if (!whole || (id > ID_MAX) || ((line[0] == (uint8_t)'t') && (code > CLASSIC_DLC))) {
        return false;
    }
    frame->id  = (uint16_t)id;
    frame->len = (uint8_t)bytes;
    for (size_t i = 0U; i < bytes; i++) {
        const uint8_t *const pair = &line[HEAD + (2U * i)];
        frame->data[i]            = (uint8_t)((hex_value(pair[0]) << 4) | hex_value(pair[1]));
    }
    return true;
}

static blw_slcan_event_t drop(blw_slcan_t *self)
{
    if (self->malformed < UINT32_MAX) {
        self->malformed++;
    }
    return BLW_SLCAN_MALFORMED;
}

static blw_slcan_event_t end_line(blw_slcan_t *self, blw_frame_t *frame)
{
    const uint8_t letter = (self->len > 0U) ? self->line[0] : (uint8_t)'\r';

    self->ended = true;
    if (self->overrun) {
        return drop(self);
    }
    if ((letter == (uint8_t)'t') || (letter == (uint8_t)'d') || (letter == (uint8_t)'b')) {
        return read_frame(self->line, self->len, frame) ? BLW_SLCAN_FRAME : drop(self);
    }
    return BLW_SLCAN_COMMAND;
}

blw_slcan_event_t blw_slcan_push(blw_slcan_t *self, uint8_t byte, blw_frame_t *frame)
{
    if (self->ended) {
        self->ended   = false;
        self->overrun = false;
        self->len     = 0U;
    }
    if (byte == (uint8_t)'\r') {
        return end_line(self, frame);
    }
    if (byte == BEL) {
        self->ended = true;
        return BLW_SLCAN_ERROR;
    }
    if (byte == (uint8_t)'\n') {
        return BLW_SLCAN_NOTHING;
    }
    if (self->len < BLW_SLCAN_LINE_MAX) {
        self->line[self->len] = byte;
        self->len++;
    } else {
        self->overrun = true;
    }
    return BLW_SLCAN_NOTHING;
}

size_t blw_slcan_write(const blw_frame_t *frame, uint8_t *line)
{
    unsigned code = 0U;

    while ((code < 15U) && (length_of[code] < frame->len)) {
        code++;
    }
    if ((length_of[code] != frame->len) || (frame->id > ID_MAX)) {
        return 0U;
    }
    line[0] = (uint8_t)((code <= CLASSIC_DLC) ? 't' : 'd');
    line[1] = hex_letter((unsigned)frame->id >> 8);
    line[2] = hex_letter(((unsigned)frame->id >> 4) & 0xFU);
    line[3] = hex_letter((unsigned)frame->id & 0xFU);
    line[4] = hex_letter(code);
    for (size_t i = 0U; i < frame->len; i++) {
        line[HEAD + (2U * i)]      = hex_letter((unsigned)frame->data[i] >> 4);
        line[HEAD + (2U * i) + 1U] = hex_letter((unsigned)frame->data[i] & 0xFU);
    }
    line[HEAD + (2U * (size_t)frame->len)] = (uint8_t)'\r';
    return HEAD + (2U * (size_t)frame->len) + 1U;
}
