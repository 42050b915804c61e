/* SPDX-License-Identifier: MIT */
#include "blw/blw_node.h"
#include <string.h>
#include "blw_node_internal.h"

static bool config_ok(const blw_node_config_t *config)
{
    return (config->deadline_us > 0U) && (config->babbling >= 2U) && (config->width >= 1U)
           && (config->width <= BLW_WIRE_MAX_ZETA)
           && ((config->collects == (uint8_t)BLW_WIRE_ZETA)
               || ((config->collects == (uint8_t)BLW_WIRE_MEASUREMENT) && (config->width == 1U)))
           && (config->format <= (uint8_t)BLW_WIRE_FD);
}

blw_status_t blw_node_init(blw_node_t *self, const blw_node_config_t *config,
                           const blw_plant_t *plant, blw_estimator_t *estimator, blw_port_t *port,
                           blw_real_t *mem, size_t mem_len)
{
    if ((self == NULL) || (config == NULL) || (plant == NULL) || (estimator == NULL)
        || (port == NULL) || (mem == NULL) || !config_ok(config)
        || (plant->l > BLW_WIRE_MAX_INPUTS)) {
        return BLW_ERR_ARG;
    }
    const size_t len = (size_t)plant->m * config->width;
    if (mem_len < BLW_NODE_MEM(plant->m, config->width, plant->l)) {
        return BLW_ERR_MEM;
    }
    (void)memset(self, 0, sizeof *self);
    self->config    = config;
    self->plant     = plant;
    self->estimator = estimator;
    self->port      = port;
    self->y         = mem;
    self->y_last    = &mem[len];
    self->u         = &mem[2U * len];
    self->u_next    = &mem[(2U * len) + plant->l];
    for (size_t i = 0U; i < plant->l; i++) {
        self->u[i] = BLW_R(0.0);
    }
    blw_node_clear(self);
    return BLW_OK;
}

static void begin_step(blw_node_t *self, uint64_t t_us)
{
    self->open         = true;
    self->opened_us    = t_us;
    self->completed_us = t_us;
    self->doubting     = false;
    self->ended        = false;
}

/* Make step k with what is there, and go on to k + 1. */
static void make_step(blw_node_t *self)
{
    const blw_mask_t        usable = blw_node_settle(self);
    const blw_real_t *const u      = (self->plant->l > 0U) ? self->u : NULL;

    /* Cannot fail: the inputs were checked when they came, and the mask has the plant's sensors. */
    (void)blw_estimator_step(self->estimator, u, self->y, usable, &self->report.out);
    blw_node_count(&self->counters.steps);
    if (self->report.out.used == 0U) {
        blw_node_count(&self->counters.blind);
    }
    self->report.k       = self->k;
    self->report.missing = BLW_MASK_ALL(self->plant->m) & ~self->report.out.used;
    self->report.events  = self->events;

    blw_real_t *const made = self->y;
    self->y                = self->y_last;
    self->y_last           = made;
    self->complete_last    = self->complete;
    self->k++;
    self->open   = false;
    self->events = 0U;
    blw_node_clear(self);
    blw_node_announce(self);
}

static void restart(blw_node_t *self)
{
    (void)blw_estimator_reset(self->estimator, NULL);
    blw_node_count(&self->counters.restarts);
    self->events |= BLW_NODE_EVENT_RESTART;
    self->behind        = 0U;
    self->complete_last = 0U;
}

/* Contact, for the first time or again, at step k. */
static void join(blw_node_t *self, uint32_t k, uint64_t t_us)
{
    const bool     first = !self->joined;
    const uint32_t gap   = k - self->k;

    if (!first && (k >= self->k) && (gap <= self->config->max_gap)) {
        self->behind = (uint16_t)gap;
    } else {
        blw_node_clear(self);
        self->k = k;
        restart(self);
    }
    self->joined = true;
    begin_step(self, t_us);
    if (k == 0U) { /* the initial state: the first step is the next one */
        self->k    = 1U;
        self->open = false;
    }
}

static bool too_early(const blw_node_t *self, uint64_t t_us)
{
    return self->joined && (self->config->period_us > 0U)
           && ((t_us - self->opened_us) < (self->config->period_us / 2U));
}

/* A sync out of turn counts only if most sensors followed it, and the next one confirms it. */
static void doubt(blw_node_t *self, uint32_t k, uint64_t t_us)
{
    const bool followed = (2U * blw_mask_count(self->followers)) > self->plant->m;

    if (self->doubting && followed && (k == (self->candidate + 1U))) {
        join(self, k, t_us);
        return;
    }
    self->followers = 0U;
    blw_node_count(&self->counters.bad_sync);
    self->events |= BLW_NODE_EVENT_TIME;
    self->candidate = k;
    self->doubting  = true;
}

/* @return whether a step was made. */
static bool follow(blw_node_t *self, uint32_t k, uint64_t t_us)
{
    if (!self->joined || (self->ended && (k != self->k))) {
        self->joined = false;
        join(self, k, t_us);
        return false;
    }
    if ((k == self->k) && !self->open) {
        begin_step(self, t_us);
        return false;
    }
    if ((k == (self->k + 1U)) && (self->open || blw_node_complete(self))) {
        make_step(self);
        begin_step(self, t_us);
        return true;
    }
    doubt(self, k, t_us);
    return false;
}

/* @return whether a step was made. */
static bool take_sync(blw_node_t *self, const blw_frame_t *frame)
{
    blw_wire_sync_t         sync;
    const blw_wire_result_t result = blw_wire_get_sync(frame, &sync);

    if (result != BLW_WIRE_OK) {
        blw_node_refuse(self, result);
        return false;
    }
    if (sync.model != (self->config->model & BLW_WIRE_MODEL_BITS)) {
        blw_node_count(&self->counters.wrong_model);
        self->events |= BLW_NODE_EVENT_TIME;
        return false;
    }
    if (sync.k == BLW_WIRE_K_END) {
        self->ended = true;
        return false;
    }
    if (too_early(self, frame->t_us)) {
        blw_node_count(&self->counters.bad_sync);
        self->events |= BLW_NODE_EVENT_TIME;
        return false;
    }
    return follow(self, sync.k, frame->t_us);
}

static void take_values(blw_node_t *self, const blw_frame_t *frame)
{
    const bool before = blw_node_complete(self);

    blw_node_take_values(self, frame);
    if (!before && blw_node_complete(self)) {
        self->completed_us = frame->t_us;
    }
}

/* @return whether a step was made. */
static bool take(blw_node_t *self, const blw_frame_t *frame)
{
    const blw_wire_kind_t kind = blw_wire_kind(frame);

    if (kind == BLW_WIRE_SYNC) {
        return take_sync(self, frame);
    }
    if ((kind == BLW_WIRE_INPUT) || (kind == (blw_wire_kind_t)self->config->collects)) {
        take_values(self, frame);
    }
    return false;
}

/* The step that has begun may be made. */
static bool due(const blw_node_t *self, uint64_t now_us)
{
    if (!self->open) {
        return false;
    }
    return (blw_node_complete(self) && (now_us >= (self->completed_us + self->config->settle_us)))
           || (now_us >= (self->opened_us + self->config->deadline_us));
}

/* No sync has come: begin the step by our own clock. */
static void mind_the_clock(blw_node_t *self, uint64_t now_us)
{
    const uint64_t period_us = self->config->period_us;
    const bool     running   = self->joined && !self->open && !self->ended && (period_us > 0U);

    if (running && (now_us >= (self->opened_us + period_us + self->config->deadline_us))) {
        self->open = true;
        self->opened_us += period_us;
        self->events |= BLW_NODE_EVENT_TIME;
        blw_node_count(&self->counters.no_sync);
    }
}

/* One of the steps that were missed; the last one opens the step of the sync. */
static void catch_up(blw_node_t *self)
{
    make_step(self);
    self->behind--;
    self->open = self->behind == 0U;
}

/* Take what waits, but nothing beyond a step that is due.  @return whether a step was made. */
static bool listen(blw_node_t *self)
{
    blw_frame_t frame;

    for (unsigned count = 0U; count < BLW_NODE_BURST; count++) {
        if ((self->behind > 0U) || due(self, blw_port_now_us(self->port))
            || !blw_port_recv(self->port, &frame)) {
            break;
        }
        if (take(self, &frame)) {
            return true;
        }
        if (self->ended && !self->open) {
            break; /* the owner shall see it before anybody begins a new run */
        }
    }
    return false;
}

/* @return whether a step was made. */
static bool advance(blw_node_t *self)
{
    if (listen(self)) {
        return true;
    }
    if (self->behind > 0U) {
        catch_up(self);
        return true;
    }
    const uint64_t now_us = blw_port_now_us(self->port);
    mind_the_clock(self, now_us);
    if (!due(self, now_us)) {
        return false;
    }
    make_step(self);
    return true;
}

const blw_node_report_t *blw_node_poll(blw_node_t *self)
{
    const bool made = advance(self);

    blw_node_send(self);
    return made ? &self->report : NULL;
}

bool blw_node_done(const blw_node_t *self)
{
    return self->ended && !self->open && (self->behind == 0U) && (self->tx_next == self->tx_count);
}
