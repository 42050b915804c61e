/* SPDX-License-Identifier: MIT */
#include <string.h>
#include "blw_node_internal.h"

#define HALF_OF_SEQ 0x8000U

void blw_node_count(uint32_t *counter)
{
    if (*counter < UINT32_MAX) {
        (*counter)++;
    }
}

static void note(blw_node_t *self, uint32_t *counter, uint8_t event)
{
    blw_node_count(counter);
    self->events |= event;
}

void blw_node_refuse(blw_node_t *self, blw_wire_result_t result)
{
    if (result == BLW_WIRE_ERR_CRC) {
        note(self, &self->counters.bad_crc, BLW_NODE_EVENT_CORRUPT);
    } else {
        note(self, &self->counters.bad_layout, BLW_NODE_EVENT_CORRUPT);
    }
}

void blw_node_clear(blw_node_t *self)
{
    const size_t len = (size_t)self->plant->m * self->config->width;

    for (size_t i = 0U; i < len; i++) {
        self->y[i] = BLW_R(0.0);
    }
    self->complete = 0U;
    self->absent   = 0U;
    self->conflict = 0U;
    self->inputs   = 0U;
    (void)memset(self->parts, 0, sizeof self->parts);
    (void)memset(self->frames, 0, sizeof self->frames);
    (void)memset(self->u_seen, 0, sizeof self->u_seen);
    (void)memset(self->u_conflict, 0, sizeof self->u_conflict);
}

/* A NaN differs from everything, from itself too. */
static bool same(blw_real_t a, blw_real_t b)
{
    return (a <= b) && (a >= b);
}

static void contradict(blw_node_t *self, size_t sensor)
{
    note(self, &self->counters.conflict, BLW_NODE_EVENT_CONFLICT);
    self->quarantine[sensor] = self->config->quarantine;
}

/* A value that was received before: the same again, or another one. */
static bool repeat(blw_node_t *self, size_t sensor, blw_real_t before, blw_real_t value)
{
    if (same(before, value)) {
        note(self, &self->counters.duplicate, BLW_NODE_EVENT_DUPLICATE);
        return true;
    }
    contradict(self, sensor);
    return false;
}

static void hear(blw_node_t *self, size_t sensor)
{
    if (self->frames[sensor] < UINT8_MAX) {
        self->frames[sensor]++;
    }
    if (self->frames[sensor] > self->config->babbling) {
        note(self, &self->counters.babbling, BLW_NODE_EVENT_BABBLING);
    }
}

/* Value number part of a sensor for step k. */
static void take_sample(blw_node_t *self, size_t sensor, size_t part, bool valid, blw_real_t value)
{
    const size_t at = (sensor * self->config->width) + part;

    if (part < self->parts[sensor]) {
        if (!repeat(self, sensor, self->y[at], value)) {
            self->conflict |= (blw_mask_t)1U << sensor;
        }
        return;
    }
    if (!valid) {
        self->absent |= (blw_mask_t)1U << sensor;
        return;
    }
    if (part > self->parts[sensor]) {
        note(self, &self->counters.out_of_order, BLW_NODE_EVENT_ORDER);
        return;
    }
    self->y[at] = value;
    self->parts[sensor]++;
    blw_node_count(&self->counters.taken);
    if (self->parts[sensor] == self->config->width) {
        self->complete |= (blw_mask_t)1U << sensor;
    }
}

/* Value of the step that was made last: too late, a repetition or a contradiction. */
static void take_late(blw_node_t *self, size_t sensor, size_t part, blw_real_t value)
{
    const size_t at = (sensor * self->config->width) + part;

    if (((self->complete_last >> sensor) & 1U) != 0U) {
        (void)repeat(self, sensor, self->y_last[at], value);
    } else {
        note(self, &self->counters.stale, BLW_NODE_EVENT_ORDER);
    }
}

/* 0 = the step being collected, < 0 = a past one, > 0 = a future one. */
static int32_t age(uint16_t seq, uint32_t k)
{
    const uint16_t ahead = (uint16_t)(seq - (uint16_t)(k & UINT16_MAX));

    return (ahead < HALF_OF_SEQ) ? (int32_t)ahead : ((int32_t)ahead - 65536);
}

static void misplaced(blw_node_t *self, int32_t steps)
{
    if (steps < 0) {
        note(self, &self->counters.stale, BLW_NODE_EVENT_ORDER);
    } else {
        note(self, &self->counters.out_of_order, BLW_NODE_EVENT_ORDER);
    }
}

static void take_sensor(blw_node_t *self, const blw_wire_values_t *values, size_t sensor,
                        size_t part, size_t j)
{
    const int32_t    steps = age(values->seq, self->k);
    const bool       valid = (((unsigned)values->valid >> j) & 1U) != 0U;
    const blw_real_t value = (blw_real_t)values->value[j];

    if (part == 0U) {
        hear(self, sensor);
    }
    if (self->doubting && (age(values->seq, self->candidate) == 0)) {
        self->followers |= (blw_mask_t)1U << sensor;
    }
    if (steps == 0) {
        take_sample(self, sensor, part, valid, value);
    } else if ((steps == -1) && valid) {
        take_late(self, sensor, part, value);
    } else {
        misplaced(self, steps);
    }
}

static bool bit(const uint8_t *bits, size_t i)
{
    return (((unsigned)bits[i / 8U] >> (i % 8U)) & 1U) != 0U;
}

static void set_bit(uint8_t *bits, size_t i)
{
    bits[i / 8U] = (uint8_t)(bits[i / 8U] | (1U << (i % 8U)));
}

static void take_input(blw_node_t *self, size_t i, blw_real_t value)
{
    if (!((value <= BLW_SIGNAL_MAX) && (value >= -BLW_SIGNAL_MAX))) {
        note(self, &self->counters.bad_value, BLW_NODE_EVENT_CORRUPT);
        return;
    }
    if (!bit(self->u_seen, i)) {
        self->u_next[i] = value;
        set_bit(self->u_seen, i);
        self->inputs++;
        blw_node_count(&self->counters.taken);
    } else if (same(self->u_next[i], value)) {
        note(self, &self->counters.duplicate, BLW_NODE_EVENT_DUPLICATE);
    } else {
        set_bit(self->u_conflict, i);
        note(self, &self->counters.conflict, BLW_NODE_EVENT_CONFLICT);
    }
}

static void take_inputs(blw_node_t *self, const blw_wire_values_t *values)
{
    const int32_t steps = age(values->seq, self->k);

    if (steps != 0) {
        misplaced(self, steps);
        return;
    }
    for (size_t j = 0U; j < values->count; j++) {
        if ((((unsigned)values->valid >> j) & 1U) != 0U) {
            take_input(self, (size_t)values->first + j, (blw_real_t)values->value[j]);
        }
    }
}

static void take_samples(blw_node_t *self, const blw_wire_values_t *values)
{
    const bool zeta = values->kind == (uint8_t)BLW_WIRE_ZETA;

    for (size_t j = 0U; j < values->count; j++) {
        const size_t at = (size_t)values->first + j;
        take_sensor(self, values, zeta ? values->sensor : at, zeta ? at : 0U, j);
    }
}

/* The model has sensors, local states or inputs of these numbers. */
static bool in_model(const blw_node_t *self, const blw_wire_values_t *values)
{
    const size_t end = (size_t)values->first + values->count;

    if (values->kind == (uint8_t)BLW_WIRE_INPUT) {
        return end <= self->plant->l;
    }
    if (values->kind == (uint8_t)BLW_WIRE_ZETA) {
        return (values->sensor < self->plant->m) && (end <= self->config->width);
    }
    return end <= self->plant->m;
}

void blw_node_take_values(blw_node_t *self, const blw_frame_t *frame)
{
    blw_wire_values_t       values;
    const blw_wire_result_t result = blw_wire_get_values(frame, &values);

    if (result != BLW_WIRE_OK) {
        blw_node_refuse(self, result);
        return;
    }
    if (!in_model(self, &values)) {
        blw_node_refuse(self, BLW_WIRE_ERR_LAYOUT);
        return;
    }
    if (!self->joined) {
        return; /* nobody has said yet which step it is */
    }
    if (values.kind == (uint8_t)BLW_WIRE_INPUT) {
        take_inputs(self, &values);
    } else {
        take_samples(self, &values);
    }
}

bool blw_node_complete(const blw_node_t *self)
{
    return (self->complete == BLW_MASK_ALL(self->plant->m)) && (self->inputs == self->plant->l);
}

static void settle_inputs(blw_node_t *self)
{
    for (size_t i = 0U; i < self->plant->l; i++) {
        if (!bit(self->u_seen, i)) {
            note(self, &self->counters.lost, BLW_NODE_EVENT_LOST);
        } else if (!bit(self->u_conflict, i)) {
            self->u[i] = self->u_next[i];
        }
    }
}

blw_mask_t blw_node_settle(blw_node_t *self)
{
    blw_mask_t rejected = self->conflict;

    settle_inputs(self);
    for (size_t i = 0U; i < self->plant->m; i++) {
        const blw_mask_t sensor = (blw_mask_t)1U << i;

        if (((self->complete | self->absent) & sensor) == 0U) {
            note(self, &self->counters.lost, BLW_NODE_EVENT_LOST);
        }
        if (((self->conflict & sensor) == 0U) && (self->quarantine[i] > 0U)) {
            rejected |= sensor;
            self->quarantine[i]--;
        }
    }
    self->report.rejected = rejected;
    return self->complete & ~rejected;
}
