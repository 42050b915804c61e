/* SPDX-License-Identifier: MIT */
#include <float.h>
#include "blw_node_internal.h"

float blw_node_narrow(blw_real_t value)
{
    const blw_real_t most = (blw_real_t)FLT_MAX;

    if (value > most) {
        return FLT_MAX;
    }
    return (value < -most) ? -FLT_MAX : (float)value;
}

static size_t span_of(const blw_node_t *self)
{
    return blw_wire_span(BLW_WIRE_ESTIMATE, (blw_wire_format_t)self->config->format);
}

static size_t estimate_frames(const blw_node_t *self)
{
    const size_t span = span_of(self);

    return ((size_t)self->plant->n + span - 1U) / span;
}

static void make_estimate(const blw_node_t *self, size_t number, blw_frame_t *frame)
{
    const size_t      span   = span_of(self);
    const size_t      first  = number * span;
    const size_t      left   = (size_t)self->plant->n - first;
    blw_wire_values_t values = {.kind  = (uint8_t)BLW_WIRE_ESTIMATE,
                                .first = (uint8_t)first,
                                .count = (uint8_t)((left < span) ? left : span),
                                .seq   = (uint16_t)(self->report.k & UINT16_MAX)};

    values.valid = (uint16_t)((1U << values.count) - 1U);
    for (size_t j = 0U; j < values.count; j++) {
        values.value[j] = blw_node_narrow(self->report.out.x_hat[first + j]);
    }
    (void)blw_wire_put_values(&values, (blw_wire_format_t)self->config->format, frame);
}

static void make_status(const blw_node_t *self, blw_frame_t *frame)
{
    const blw_estimator_out_t *const out    = &self->report.out;
    blw_wire_status_t                status = {
                       .seq     = (uint16_t)(self->report.k & UINT16_MAX),
                       .outcome = out->outcome,
                       .flags   = out->flags,
                       .events  = self->report.events,
                       .iterations = (uint8_t)((out->iterations < UINT8_MAX) ? out->iterations : UINT8_MAX)};

    for (size_t j = 0U; j < self->plant->n; j++) {
        const float value = blw_node_narrow(out->x_hat[j]);
        status.estimate   = blw_wire_sum_values(status.estimate, &value, 1U);
    }
    blw_wire_put_status(&status, frame);
}

static uint8_t eight(blw_mask_t mask, size_t group)
{
    return (uint8_t)((mask >> (BLW_WIRE_SENSORS * group)) & UINT8_MAX);
}

static void make_sensors(const blw_node_t *self, size_t group, blw_frame_t *frame)
{
    const blw_node_report_t *const report     = &self->report;
    blw_mask_t                     suspicious = 0U;

    for (size_t i = 0U; i < self->plant->m; i++) {
        if (report->out.suspicion[i] > BLW_R(0.5)) {
            suspicious |= (blw_mask_t)1U << i;
        }
    }
    const blw_wire_sensors_t sensors = {.seq        = (uint16_t)(report->k & UINT16_MAX),
                                        .group      = (uint8_t)group,
                                        .excluded   = eight(report->out.excluded, group),
                                        .missing    = eight(report->missing, group),
                                        .rejected   = eight(report->rejected, group),
                                        .suspicious = eight(suspicious, group)};
    blw_wire_put_sensors(&sensors, frame);
}

static void make_frame(const blw_node_t *self, size_t number, blw_frame_t *frame)
{
    const size_t estimates = estimate_frames(self);

    if (number < estimates) {
        make_estimate(self, number, frame);
    } else if (number == estimates) {
        make_status(self, frame);
    } else {
        make_sensors(self, number - estimates - 1U, frame);
    }
}

void blw_node_announce(blw_node_t *self)
{
    const size_t groups = ((size_t)self->plant->m + BLW_WIRE_SENSORS - 1U) / BLW_WIRE_SENSORS;

    while (self->tx_next < self->tx_count) {
        blw_node_count(&self->counters.unsent);
        self->tx_next++;
    }
    self->tx_next  = 0U;
    self->tx_count = (uint16_t)(estimate_frames(self) + 1U + groups);
}

void blw_node_send(blw_node_t *self)
{
    blw_frame_t frame;

    while (self->tx_next < self->tx_count) {
        make_frame(self, self->tx_next, &frame);
        if (!blw_port_send(self->port, &frame)) {
            return;
        }
        self->tx_next++;
    }
}
