/* SPDX-License-Identifier: MIT */
#include "blw_port_lcm.h"
#include <string.h>
#include "blw_lcm_internal.h"

static bool open_lcm(blw_port_lcm_t *self)
{
    self->lcm = lcm_create(self->url);
    if (self->lcm == NULL) {
        return false;
    }
    if (!blw_lcm_listen(self)) {
        lcm_destroy(self->lcm);
        self->lcm = NULL;
        return false;
    }
    self->down = false;
    return true;
}

static void lose(blw_port_lcm_t *self)
{
    self->counters.lost++;
    self->down = true;
    lcm_destroy(self->lcm);
    self->lcm      = NULL;
    self->retry_us = blw_posix_now_us() + BLW_POSIX_RETRY_US;
}

static bool alive(blw_port_lcm_t *self)
{
    if (self->lcm != NULL) {
        return true;
    }
    const uint64_t now_us = blw_posix_now_us();
    if (now_us < self->retry_us) {
        return false;
    }
    self->retry_us = now_us + BLW_POSIX_RETRY_US;
    return open_lcm(self);
}

static bool lcm_port_recv(blw_port_t *base, blw_frame_t *frame)
{
    blw_port_lcm_t *const self = (blw_port_lcm_t *)base;

    while (self->waiting == 0U) {
        const int handled = alive(self) ? lcm_handle_timeout(self->lcm, 0) : 0;
        if (handled < 0) {
            lose(self);
        }
        if (handled <= 0) {
            return false;
        }
    }
    *frame      = self->queue[self->next];
    frame->t_us = blw_posix_now_us();
    self->next  = (self->next + 1U) % BLW_LCM_QUEUE;
    self->waiting--;
    return true;
}

static bool lcm_port_send(blw_port_t *base, const blw_frame_t *frame)
{
    blw_port_lcm_t *const self = (blw_port_lcm_t *)base;

    if (!alive(self)) {
        return false;
    }
    if (!blw_lcm_publish(self, frame)) {
        lose(self);
        return false;
    }
    return true;
}

static uint64_t lcm_port_now_us(blw_port_t *base)
{
    (void)base;
    return blw_posix_now_us();
}

static const blw_port_ops_t lcm_ops = {
    .now_us = lcm_port_now_us, .recv = lcm_port_recv, .send = lcm_port_send};

bool blw_port_lcm_open(blw_port_lcm_t *self, const char *url, const blw_plant_t *plant,
                       uint8_t width)
{
    (void)memset(self, 0, sizeof *self);
    self->base.ops = &lcm_ops;
    self->url      = url;
    self->plant    = plant;
    self->width    = width;
    return open_lcm(self);
}

void blw_port_lcm_describe(blw_port_lcm_t *self, const char *method,
                           const blw_node_report_t *report)
{
    self->method = method;
    self->report = report;
}

void blw_port_lcm_close(blw_port_lcm_t *self)
{
    if (self->lcm != NULL) {
        lcm_destroy(self->lcm);
        self->lcm = NULL;
    }
}

int blw_port_lcm_handle(const blw_port_lcm_t *self)
{
    return (self->lcm != NULL) ? lcm_get_fileno(self->lcm) : -1;
}
