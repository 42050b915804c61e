/* SPDX-License-Identifier: MIT */
/* Example firmware: one estimator node on a serial line that speaks SLCAN.
 *
 * The model is the committed one; another one is this file with another name.  Memory is static and
 * known at link time; the main loop never blocks, so other work can go beside blw_node_poll().
 */
#include "blw/blw_node.h"
#include "blw_port_uart.h"
#include "pendulum_physical_model.h"

BLW_PENDULUM_PHYSICAL_CANONICAL_STORAGE(estimator);

static const blw_node_config_t config = {
    .model       = PENDULUM_PHYSICAL_MODEL_ID,
    .period_us   = 0U, /* the plant's syncs alone begin steps */
    .deadline_us = 500000U,
    .quarantine  = 20U,
    .max_gap     = 100U,
    .babbling    = 8U,
    .collects    = BLW_WIRE_MEASUREMENT,
    .width       = 1U,
    .format      = BLW_WIRE_CLASSIC,
};

static blw_port_uart_t port;
static blw_node_t      node;
static blw_real_t      node_mem[BLW_NODE_MEM(PENDULUM_PHYSICAL_M, 1U, PENDULUM_PHYSICAL_L)];

static bool start(void)
{
    blw_port_uart_open(&port);
    return (blw_lasso_init(&estimator, &blw_pendulum_physical_canonical, estimator_mem,
                           BLW_PENDULUM_PHYSICAL_CANONICAL_MEM)
            == BLW_OK)
           && (blw_node_init(&node, &config, &blw_pendulum_physical_plant, &estimator.base,
                             &port.base, node_mem, sizeof node_mem / sizeof node_mem[0])
               == BLW_OK);
}

int main(void)
{
    if (!start()) {
        return 1; /* tables of another library, or damaged flash */
    }
    for (;;) {
        (void)blw_node_poll(&node);
    }
}
