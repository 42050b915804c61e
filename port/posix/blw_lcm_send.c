/* SPDX-License-Identifier: MIT */
/* Frames to messages. */
#include <string.h>
#include <time.h>
#include "bulwark_alarm_t.h"
#include "bulwark_estimate_t.h"
#include "bulwark_health_t.h"
#include "bulwark_input_t.h"
#include "bulwark_measurement_t.h"
#include "bulwark_sync_t.h"
#include "bulwark_zeta_t.h"
#include "blw_lcm_internal.h"

/* Microseconds since the epoch, as other LCM users have it. */
static int64_t utime(void)
{
    struct timespec now;

    (void)clock_gettime(CLOCK_REALTIME, &now);
    return ((int64_t)now.tv_sec * 1000000) + ((int64_t)now.tv_nsec / 1000);
}

/* The step nearest to the last sync whose low 16 bits are seq. */
static int64_t step_of(const blw_port_lcm_t *self, uint16_t seq)
{
    const uint16_t ahead = (uint16_t)(seq - (uint16_t)(self->k & UINT16_MAX));

    return (int64_t)self->k + ((ahead < 0x8000U) ? (int64_t)ahead : ((int64_t)ahead - 65536));
}

static bool count(blw_port_lcm_t *self, int result)
{
    self->counters.sent += (result >= 0) ? 1U : 0U;
    return result >= 0;
}

static bool publish_sync(blw_port_lcm_t *self, const blw_frame_t *frame)
{
    blw_wire_sync_t sync;

    if (blw_wire_get_sync(frame, &sync) != BLW_WIRE_OK) {
        return true; /* nothing that a message could say */
    }
    const bulwark_sync_t message = {
        .utime = utime(), .k = (int64_t)sync.k, .model = (int32_t)sync.model};
    self->k = sync.k;
    return count(self, bulwark_sync_t_publish(self->lcm, "BLW_SYNC", &message));
}

static bool publish_measurement(blw_port_lcm_t *self)
{
    const bulwark_measurement_t message = {.utime = utime(),
                                           .seq   = step_of(self, self->batch.seq),
                                           .m     = self->plant->m,
                                           .y     = self->batch.value,
                                           .valid = self->batch.valid};

    return count(self, bulwark_measurement_t_publish(self->lcm, "BLW_MEASUREMENT", &message));
}

static bool publish_input(blw_port_lcm_t *self)
{
    const bulwark_input_t message = {.utime = utime(),
                                     .seq   = step_of(self, self->batch.seq) - 1,
                                     .l     = self->plant->l,
                                     .u     = self->batch.value};

    return count(self, bulwark_input_t_publish(self->lcm, "BLW_INPUT", &message));
}

static bool publish_zeta(blw_port_lcm_t *self, uint8_t sensor)
{
    const bulwark_zeta_t message = {.utime  = utime(),
                                    .seq    = step_of(self, self->batch.seq),
                                    .sensor = sensor,
                                    .valid  = self->batch.valid[0],
                                    .r      = self->width,
                                    .zeta   = self->batch.value};

    return count(self, bulwark_zeta_t_publish(self->lcm, "BLW_ZETA", &message));
}

static bool publish_values(blw_port_lcm_t *self, const blw_frame_t *frame)
{
    blw_wire_values_t      values;
    blw_lcm_batch_t *const batch = &self->batch;

    if (blw_wire_get_values(frame, &values) != BLW_WIRE_OK) {
        return true;
    }
    const bool   measurement = values.kind == (uint8_t)BLW_WIRE_MEASUREMENT;
    const bool   zeta        = values.kind == (uint8_t)BLW_WIRE_ZETA;
    const bool   single      = measurement && (frame->len == BLW_FRAME_CLASSIC_MAX);
    const size_t end         = (size_t)values.first + values.count;
    const size_t all         = zeta ? self->width : (measurement ? self->plant->m : self->plant->l);
    if ((values.first == 0U) || single) {
        (void)memset(batch, 0, sizeof *batch);
    }
    batch->seq = values.seq;
    for (size_t j = 0U; j < values.count; j++) {
        batch->value[values.first + j] = (double)values.value[j];
        batch->valid[values.first + j] = (int8_t)(((unsigned)values.valid >> j) & 1U);
    }
    if ((end != all) && !single) {
        return true;
    }
    if (zeta) {
        return publish_zeta(self, values.sensor);
    }
    return measurement ? publish_measurement(self) : publish_input(self);
}

static void spread(blw_mask_t mask, size_t m, int8_t *flags)
{
    for (size_t i = 0U; i < m; i++) {
        flags[i] = (int8_t)((mask >> i) & 1U);
    }
}

/* What the messages of a report have in common; LCM's structs are not const. */
typedef struct verdict {
    char   method[32];
    int8_t excluded[BLW_MAX_SENSORS];
} verdict_t;

static bool publish_estimate(blw_port_lcm_t *self, verdict_t *verdict)
{
    const blw_node_report_t *const   report = self->report;
    const blw_estimator_out_t *const out    = &report->out;
    double                           x_hat[BLW_WIRE_MAX_STATES];
    double                           suspicion[BLW_MAX_SENSORS];

    for (size_t j = 0U; j < self->plant->n; j++) {
        x_hat[j] = (double)out->x_hat[j];
    }
    for (size_t i = 0U; i < self->plant->m; i++) {
        suspicion[i] = (double)out->suspicion[i];
    }
    const bulwark_estimate_t message = {.utime      = utime(),
                                        .seq        = (int64_t)report->k,
                                        .method     = verdict->method,
                                        .n          = self->plant->n,
                                        .x_hat      = x_hat,
                                        .m          = self->plant->m,
                                        .suspicion  = suspicion,
                                        .excluded   = verdict->excluded,
                                        .outcome    = out->outcome,
                                        .flags      = out->flags,
                                        .iterations = out->iterations,
                                        .statistic  = (double)out->statistic,
                                        .threshold  = (double)out->threshold,
                                        .bound      = (double)out->bound};
    return count(self, bulwark_estimate_t_publish(self->lcm, "BLW_ESTIMATE", &message));
}

static bool publish_alarm(blw_port_lcm_t *self, verdict_t *verdict)
{
    const blw_node_report_t *const report  = self->report;
    const bulwark_alarm_t          message = {.utime     = utime(),
                                              .seq       = (int64_t)report->k,
                                              .method    = verdict->method,
                                              .m         = self->plant->m,
                                              .excluded  = verdict->excluded,
                                              .statistic = (double)report->out.statistic,
                                              .threshold = (double)report->out.threshold};

    self->excluded = report->out.excluded;
    return count(self, bulwark_alarm_t_publish(self->lcm, "BLW_ALARM", &message));
}

static bool publish_health(blw_port_lcm_t *self)
{
    const blw_node_report_t *const report = self->report;
    int8_t                         missing[BLW_MAX_SENSORS];
    int8_t                         rejected[BLW_MAX_SENSORS];

    spread(report->missing, self->plant->m, missing);
    spread(report->rejected, self->plant->m, rejected);
    const bulwark_health_t message = {.utime    = utime(),
                                      .seq      = (int64_t)report->k,
                                      .events   = report->events,
                                      .m        = self->plant->m,
                                      .missing  = missing,
                                      .rejected = rejected};
    return count(self, bulwark_health_t_publish(self->lcm, "BLW_HEALTH", &message));
}

/* A status that is passed on: frames say less than a report. */
static bool publish_passed_on(blw_port_lcm_t *self, const blw_frame_t *frame)
{
    blw_wire_status_t status;
    char              method[1]                  = "";
    double            suspicion[BLW_MAX_SENSORS] = {0.0};
    int8_t            excluded[BLW_MAX_SENSORS]  = {0};

    if (blw_wire_get_status(frame, &status) != BLW_WIRE_OK) {
        return true;
    }
    const bulwark_estimate_t message = {.utime      = utime(),
                                        .seq        = step_of(self, status.seq),
                                        .method     = method,
                                        .n          = self->plant->n,
                                        .x_hat      = self->estimate,
                                        .m          = self->plant->m,
                                        .suspicion  = suspicion,
                                        .excluded   = excluded,
                                        .outcome    = status.outcome,
                                        .flags      = status.flags,
                                        .iterations = status.iterations};
    return count(self, bulwark_estimate_t_publish(self->lcm, "BLW_ESTIMATE", &message));
}

static void take_estimate(blw_port_lcm_t *self, const blw_frame_t *frame)
{
    blw_wire_values_t values;

    if (blw_wire_get_values(frame, &values) != BLW_WIRE_OK) {
        return;
    }
    for (size_t j = 0U; j < values.count; j++) {
        self->estimate[values.first + j] = (double)values.value[j];
    }
}

static bool publish_report(blw_port_lcm_t *self)
{
    const blw_node_report_t *const report = self->report;
    verdict_t                      verdict;

    const bool alarm = (report->out.excluded != self->excluded)
                       || ((report->out.threshold > BLW_R(0.0))
                           && (report->out.statistic > report->out.threshold));
    (void)strncpy(verdict.method, self->method, sizeof verdict.method - 1U);
    verdict.method[sizeof verdict.method - 1U] = '\0';
    spread(report->out.excluded, self->plant->m, verdict.excluded);
    if (((report->events != 0U) || (report->rejected != 0U)) && !publish_health(self)) {
        return false;
    }
    if (alarm && !publish_alarm(self, &verdict)) {
        return false;
    }
    return publish_estimate(self, &verdict);
}

bool blw_lcm_publish(blw_port_lcm_t *self, const blw_frame_t *frame)
{
    switch (blw_wire_kind(frame)) {
    case BLW_WIRE_SYNC:
        return publish_sync(self, frame);
    case BLW_WIRE_MEASUREMENT:
    case BLW_WIRE_INPUT:
    case BLW_WIRE_ZETA:
        return publish_values(self, frame);
    case BLW_WIRE_STATUS:
        return (self->report != NULL) ? publish_report(self) : publish_passed_on(self, frame);
    case BLW_WIRE_ESTIMATE:
        take_estimate(self, frame);
        return true;
    case BLW_WIRE_FOREIGN:
    case BLW_WIRE_SENSOR_BITS:
    default:
        return true; /* a status says it all */
    }
}
