/* SPDX-License-Identifier: MIT */
/* Messages to frames.  The generated decoders trust the dimensions in a message, so these are
 * checked first: a message has exactly the length that the model gives it. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "bulwark_estimate_t.h"
#include "bulwark_input_t.h"
#include "bulwark_measurement_t.h"
#include "bulwark_sync_t.h"
#include "bulwark_zeta_t.h"
#include "blw_lcm_internal.h"

#define HEAD          24U /* hash, utime, seq */
#define SYNC_BYTES    28U
#define MAX_METHOD    64U
#define ESTIMATE_TAIL 36U   /* three int32, three double */
#define MESSAGES      10000 /* that may wait in one subscription */
#define BAD_FRAME_ID  0x090U

static blw_frame_t *slot(blw_port_lcm_t *self)
{
    blw_frame_t *const frame = &self->queue[(self->next + self->waiting) % BLW_LCM_QUEUE];

    self->waiting++;
    return frame;
}

/* recv() empties the queue before it takes another message, and no message fills it. */
static void queue_bad(blw_port_lcm_t *self)
{
    self->counters.malformed++;
    *slot(self) = (blw_frame_t){.id = BAD_FRAME_ID, .len = 0U};
}

static float narrow(double value)
{
    if (value > (double)FLT_MAX) {
        return INFINITY;
    }
    return (value < -(double)FLT_MAX) ? -INFINITY : (float)value;
}

/* As many FD frames as it takes; valid may be NULL. */
static void queue_values(blw_port_lcm_t *self, blw_wire_values_t values, const double *value,
                         const int8_t *valid, size_t count)
{
    self->counters.received++;
    for (size_t first = 0U; first < count; first += BLW_WIRE_VALUES) {
        const size_t left = count - first;

        values.first = (uint8_t)first;
        values.count = (uint8_t)((left < BLW_WIRE_VALUES) ? left : BLW_WIRE_VALUES);
        values.valid = 0U;
        for (size_t j = 0U; j < values.count; j++) {
            const bool is_sample = (valid == NULL) || (valid[first + j] != 0);
            values.value[j]      = narrow(value[first + j]);
            values.valid         = (uint16_t)(values.valid | (is_sample ? (1U << j) : 0U));
        }
        (void)blw_wire_put_values(&values, BLW_WIRE_FD, slot(self));
    }
}

/* Big-endian, as LCM has it. */
static uint32_t word(const lcm_recv_buf_t *buffer, size_t at)
{
    const uint8_t *const data = buffer->data;

    return ((uint32_t)data[at] << 24) | ((uint32_t)data[at + 1U] << 16)
           | ((uint32_t)data[at + 2U] << 8) | data[at + 3U];
}

static void on_sync(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    blw_port_lcm_t *const self = user;
    bulwark_sync_t        message;

    (void)channel;
    if ((buffer->data_size != SYNC_BYTES)
        || (bulwark_sync_t_decode(buffer->data, 0, (int)SYNC_BYTES, &message) < 0)
        || (message.k < 0) || (message.k > (int64_t)UINT32_MAX)) {
        queue_bad(self);
        return;
    }
    const blw_wire_sync_t sync = {.k = (uint32_t)message.k, .model = (uint32_t)message.model};
    self->counters.received++;
    self->k = sync.k;
    blw_wire_put_sync(&sync, slot(self));
}

static void on_measurement(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    blw_port_lcm_t *const self = user;
    const uint32_t        m    = self->plant->m;
    const uint32_t        len  = HEAD + 4U + (9U * m);
    bulwark_measurement_t message;

    (void)channel;
    if ((buffer->data_size != len) || (word(buffer, HEAD) != m)
        || (bulwark_measurement_t_decode(buffer->data, 0, (int)len, &message) < 0)) {
        queue_bad(self);
        return;
    }
    const blw_wire_values_t values = {.kind = (uint8_t)BLW_WIRE_MEASUREMENT,
                                      .seq  = (uint16_t)((uint64_t)message.seq & UINT16_MAX)};
    queue_values(self, values, message.y, message.valid, m);
    (void)bulwark_measurement_t_decode_cleanup(&message);
}

static void on_input(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    blw_port_lcm_t *const self = user;
    const uint32_t        l    = self->plant->l;
    const uint32_t        len  = HEAD + 4U + (8U * l);
    bulwark_input_t       message;

    (void)channel;
    if ((buffer->data_size != len) || (word(buffer, HEAD) != l)
        || (bulwark_input_t_decode(buffer->data, 0, (int)len, &message) < 0)) {
        queue_bad(self);
        return;
    }
    const blw_wire_values_t values = {.kind = (uint8_t)BLW_WIRE_INPUT,
                                      .seq = (uint16_t)(((uint64_t)message.seq + 1U) & UINT16_MAX)};
    queue_values(self, values, message.u, NULL, l);
    (void)bulwark_input_t_decode_cleanup(&message);
}

static void on_zeta(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    blw_port_lcm_t *const self = user;
    const uint32_t        r    = self->width;
    const uint32_t        len  = HEAD + 9U + (8U * r);
    bulwark_zeta_t        message;

    (void)channel;
    if ((buffer->data_size != len) || (word(buffer, HEAD + 5U) != r)
        || (word(buffer, HEAD) >= BLW_WIRE_MAX_SENSORS)
        || (bulwark_zeta_t_decode(buffer->data, 0, (int)len, &message) < 0)) {
        queue_bad(self);
        return;
    }
    const blw_wire_values_t values = {.kind   = (uint8_t)BLW_WIRE_ZETA,
                                      .sensor = (uint8_t)message.sensor,
                                      .seq    = (uint16_t)((uint64_t)message.seq & UINT16_MAX)};
    int8_t                  all[BLW_WIRE_MAX_ZETA];
    (void)memset(all, (message.valid != 0) ? 1 : 0, sizeof all);
    queue_values(self, values, message.zeta, all, r);
    (void)bulwark_zeta_t_decode_cleanup(&message);
}

static bool estimate_ok(const lcm_recv_buf_t *buffer, const blw_plant_t *plant)
{
    const size_t n = plant->n;
    const size_t m = plant->m;

    if (buffer->data_size < (HEAD + 4U)) {
        return false;
    }
    const size_t name = word(buffer, HEAD); /* bytes of the method's name, \0 included */
    const size_t at_n = HEAD + 4U + name;
    const size_t at_m = at_n + 4U + (8U * n);
    return (name >= 1U) && (name <= MAX_METHOD)
           && (buffer->data_size == (at_m + 4U + (9U * m) + ESTIMATE_TAIL))
           && (word(buffer, at_n) == n) && (word(buffer, at_m) == m)
           && (((const uint8_t *)buffer->data)[at_n - 1U] == 0U);
}

static void on_estimate(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    blw_port_lcm_t *const self = user;
    const size_t          n    = self->plant->n;
    bulwark_estimate_t    message;

    (void)channel;
    if (!estimate_ok(buffer, self->plant)
        || (bulwark_estimate_t_decode(buffer->data, 0, (int)buffer->data_size, &message) < 0)) {
        queue_bad(self);
        return;
    }
    const uint16_t          seq    = (uint16_t)((uint64_t)message.seq & UINT16_MAX);
    const blw_wire_values_t values = {.kind = (uint8_t)BLW_WIRE_ESTIMATE, .seq = seq};
    blw_wire_status_t       status = {.seq     = seq,
                                      .outcome = (uint8_t)((uint32_t)message.outcome & UINT8_MAX),
                                      .flags   = (uint8_t)((uint32_t)message.flags & UINT8_MAX)};

    for (size_t j = 0U; j < n; j++) {
        const float value = narrow(message.x_hat[j]);
        status.estimate   = blw_wire_sum_values(status.estimate, &value, 1U);
    }
    queue_values(self, values, message.x_hat, NULL, n);
    blw_wire_put_status(&status, slot(self));
    (void)bulwark_estimate_t_decode_cleanup(&message);
}

bool blw_lcm_listen(blw_port_lcm_t *self)
{
    static const struct {
        const char       *channel;
        lcm_msg_handler_t handler;
    } ours[] = {{"BLW_SYNC", on_sync},
                {"BLW_MEASUREMENT", on_measurement},
                {"BLW_INPUT", on_input},
                {"BLW_ZETA", on_zeta},
                {"BLW_ESTIMATE", on_estimate}};

    self->waiting = 0U;
    for (size_t i = 0U; i < (sizeof ours / sizeof ours[0]); i++) {
        lcm_subscription_t *const one =
            lcm_subscribe(self->lcm, ours[i].channel, ours[i].handler, self);
        if ((one == NULL) || (lcm_subscription_set_queue_capacity(one, MESSAGES) < 0)) {
            return false;
        }
    }
    return true;
}
