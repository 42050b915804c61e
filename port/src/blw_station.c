/* SPDX-License-Identifier: MIT */
#include "blw/blw_station.h"
#include <string.h>
#include "blw_node_internal.h"

static const blw_plant_t *plant_of(const blw_station_t *self)
{
    return self->filter->model->head.plant;
}

blw_status_t blw_station_init(blw_station_t *self, uint32_t model, blw_wire_format_t format,
                              blw_local_t *filter, blw_port_t *port, blw_real_t *mem,
                              size_t mem_len)
{
    if ((self == NULL) || (filter == NULL) || (port == NULL) || (mem == NULL)) {
        return BLW_ERR_ARG;
    }
    const blw_plant_t *const plant = filter->model->head.plant;
    if ((plant->l > BLW_WIRE_MAX_INPUTS) || (filter->model->jordan->r > BLW_WIRE_MAX_ZETA)) {
        return BLW_ERR_ARG;
    }
    if (mem_len < BLW_STATION_MEM(plant->n, plant->l)) {
        return BLW_ERR_MEM;
    }
    (void)memset(self, 0, sizeof *self);
    (void)memset(mem, 0, sizeof(blw_real_t) * BLW_STATION_MEM(plant->n, plant->l));
    self->filter   = filter;
    self->port     = port;
    self->model    = model & BLW_WIRE_MODEL_BITS;
    self->format   = (uint8_t)format;
    self->estimate = mem;
    self->u        = &mem[plant->n];
    self->u_next   = &mem[(size_t)plant->n + plant->l];
    return BLW_OK;
}

static bool seen(const blw_station_t *self, size_t i)
{
    return (((unsigned)self->u_seen[i / 8U] >> (i % 8U)) & 1U) != 0U;
}

static void settle_inputs(blw_station_t *self)
{
    for (size_t i = 0U; i < plant_of(self)->l; i++) {
        if (seen(self, i)) {
            self->u[i] = self->u_next[i];
        } else {
            blw_node_count(&self->counters.no_input);
        }
    }
}

static void send_zeta(blw_station_t *self, bool used)
{
    const blw_wire_format_t format = (blw_wire_format_t)self->format;
    const size_t            span   = blw_wire_span(BLW_WIRE_ZETA, format);
    const size_t            r      = self->filter->model->jordan->r;
    blw_frame_t             frame;

    for (size_t first = 0U; first < r; first += span) {
        const size_t      left   = r - first;
        blw_wire_values_t values = {.kind   = (uint8_t)BLW_WIRE_ZETA,
                                    .sensor = self->filter->sensor,
                                    .first  = (uint8_t)first,
                                    .count  = (uint8_t)((left < span) ? left : span),
                                    .seq    = (uint16_t)(self->k & UINT16_MAX)};
        for (size_t j = 0U; j < values.count; j++) {
            values.value[j] = blw_node_narrow(self->filter->zeta[first + j]);
            values.valid    = (uint16_t)(values.valid | (used ? (1U << j) : 0U));
        }
        if (!blw_wire_put_values(&values, format, &frame) || !blw_port_send(self->port, &frame)) {
            blw_node_count(&self->counters.unsent);
        }
    }
}

/* Step k with what is there. */
static void make_step(blw_station_t *self)
{
    const blw_real_t *const u = (plant_of(self)->l > 0U) ? self->u : NULL;

    settle_inputs(self);
    const bool used = blw_local_step(self->filter, u, self->y, self->sampled && self->valid);
    self->made      = true;
    if (!used) {
        blw_node_count(&self->counters.no_sample);
    }
    send_zeta(self, used);
    blw_node_count(&self->counters.steps);
}

static bool make_step_if_complete(blw_station_t *self)
{
    const bool ready = self->joined && !self->made && self->referenced && self->sampled
                       && (self->inputs == plant_of(self)->l);

    if (ready) {
        make_step(self);
    }
    return ready;
}

static void begin_step(blw_station_t *self, uint32_t k)
{
    const bool next = self->joined && (k == (self->k + 1U));

    if (next && !self->made && self->referenced) {
        make_step(self); /* too late to be of use, but the filter stays in step */
    }
    const bool kept = next && self->made && self->corrected;
    if (!kept && (k == 1U)) {
        (void)blw_local_reset(self->filter, NULL);
    }
    if (self->joined && !kept && (k != 1U)) {
        blw_node_count(&self->counters.restarts);
    }
    self->referenced = kept || (k == 1U);
    self->joined     = true;
    self->k          = k;
    self->made       = false;
    self->sampled    = false;
    self->corrected  = false;
    self->inputs     = 0U;
    (void)memset(self->u_seen, 0, sizeof self->u_seen);
}

static void take_sync(blw_station_t *self, const blw_frame_t *frame)
{
    blw_wire_sync_t sync;

    if (blw_wire_get_sync(frame, &sync) != BLW_WIRE_OK) {
        blw_node_count(&self->counters.bad_frame);
    } else if (sync.model != self->model) {
        blw_node_count(&self->counters.wrong_model);
    } else if ((sync.k != BLW_WIRE_K_END) && !(self->joined && (sync.k == self->k))) {
        begin_step(self, sync.k);
    } else {
        /* the end, or the same again: nothing to begin */
    }
}

static void take_input(blw_station_t *self, size_t i, blw_real_t value)
{
    if (!((value <= BLW_SIGNAL_MAX) && (value >= -BLW_SIGNAL_MAX))) {
        blw_node_count(&self->counters.bad_frame);
    } else if (!seen(self, i)) {
        self->u_next[i]      = value;
        self->u_seen[i / 8U] = (uint8_t)(self->u_seen[i / 8U] | (1U << (i % 8U)));
        self->inputs++;
    } else if ((self->u_next[i] < value) || (self->u_next[i] > value)) {
        blw_node_count(&self->counters.conflict);
        self->u_next[i] = self->u[i];
    } else {
        /* the same again */
    }
}

static void take_inputs(blw_station_t *self, const blw_frame_t *frame)
{
    blw_wire_values_t values;

    if ((blw_wire_get_values(frame, &values) != BLW_WIRE_OK)
        || (((size_t)values.first + values.count) > plant_of(self)->l)) {
        blw_node_count(&self->counters.bad_frame);
        return;
    }
    if (!self->joined || self->made || (values.seq != (uint16_t)(self->k & UINT16_MAX))) {
        return;
    }
    for (size_t j = 0U; j < values.count; j++) {
        if ((((unsigned)values.valid >> j) & 1U) != 0U) {
            take_input(self, (size_t)values.first + j, (blw_real_t)values.value[j]);
        }
    }
}

static void take_estimate(blw_station_t *self, const blw_frame_t *frame)
{
    blw_wire_values_t values;

    if ((blw_wire_get_values(frame, &values) != BLW_WIRE_OK)
        || (((size_t)values.first + values.count) > plant_of(self)->n)) {
        blw_node_count(&self->counters.bad_frame);
        return;
    }
    for (size_t j = 0U; j < values.count; j++) {
        self->estimate[values.first + j] = (blw_real_t)values.value[j];
    }
}

static uint8_t sum_of(const blw_station_t *self)
{
    uint8_t sum = 0U;

    for (size_t j = 0U; j < plant_of(self)->n; j++) {
        const float value = blw_node_narrow(self->estimate[j]);
        sum               = blw_wire_sum_values(sum, &value, 1U);
    }
    return sum;
}

/* x_hat(k): the reference of the next step, of a filter that has made step k or starts here. */
static void take_status(blw_station_t *self, const blw_frame_t *frame)
{
    blw_wire_status_t status;

    if ((blw_wire_get_status(frame, &status) != BLW_WIRE_OK) || (status.estimate != sum_of(self))) {
        blw_node_count(&self->counters.bad_frame);
        return;
    }
    if (!self->joined || self->corrected || (status.seq != (uint16_t)(self->k & UINT16_MAX))) {
        return;
    }
    const blw_status_t taken = self->made ? blw_local_correct(self->filter, self->estimate)
                                          : blw_local_reset(self->filter, self->estimate);
    self->made               = true; /* one that was not made begins with the next step */
    self->corrected          = taken == BLW_OK;
}

void blw_station_sample(blw_station_t *self, uint16_t seq, blw_real_t y, bool valid)
{
    if (!self->joined || self->made || (seq != (uint16_t)(self->k & UINT16_MAX))) {
        return;
    }
    if (!self->sampled) {
        self->y       = y;
        self->valid   = valid;
        self->sampled = true;
    } else if (!((self->y <= y) && (self->y >= y))) {
        blw_node_count(&self->counters.conflict);
        self->valid = false;
    } else {
        /* the same again */
    }
}

bool blw_station_take(blw_station_t *self, const blw_frame_t *frame)
{
    const blw_wire_kind_t kind = blw_wire_kind(frame);

    if (kind == BLW_WIRE_SYNC) {
        take_sync(self, frame);
    } else if (kind == BLW_WIRE_INPUT) {
        take_inputs(self, frame);
    } else if (kind == BLW_WIRE_ESTIMATE) {
        take_estimate(self, frame);
    } else if (kind == BLW_WIRE_STATUS) {
        take_status(self, frame);
    } else {
        /* measurements come from the owner; nothing else is for us */
    }
    return make_step_if_complete(self);
}
