/* SPDX-License-Identifier: MIT */
/** @file bus.h  Plant, node and attacker as processes of their own, on a bus.
 *
 *  The plant sends sync, inputs and measurements of one step after the other, and waits for the
 *  answer of a node that has its model (or does not wait: pace_us).  A node process holds one node
 *  per method, all on the bus; the speaker alone sends.  In a split deployment one process per
 *  sensor runs the local filter, and a fusion node takes what they send.  The attacker is either a
 *  gateway, between the sensors' link and the node's, that changes, withholds and delays what it
 *  holds; or an intruder on the node's link, that sends frames with its victims' identifiers.
 *
 *  Each prints one line "listening on ..." when it is on the bus, and a report when it ends.
 */
#ifndef BLW_SIM_BUS_H
#define BLW_SIM_BUS_H
#include "blw/blw_lasso.h"
#include "commands.h"
#include "link.h"
#include "methods.h"
#include <atomic>
#include <string>

namespace sim
{

/** For a frame to come, in milliseconds; a second in microseconds. */
inline constexpr int           WAIT_MS = 1;
inline constexpr std::uint64_t SECOND  = 1000000U;

struct BusOptions {
    Options       run;              /* input = scenario, design, out, methods, seed, json */
    std::string   link;             /* the node's; see link.h */
    std::string   sensor_link;      /* attacker: of the plant's side; empty: an intruder */
    std::string   speaker;          /* node: the method that sends */
    std::string   log;              /* node: the plant's log.csv, for a summary */
    std::string   fault;            /* attacker: see bus_attack.cpp */
    std::uint64_t pace_us     = 0U; /* plant: 0 = wait for the node's answer */
    std::uint64_t patience_ms = 1000U;
    std::uint64_t idle_s      = 30U; /* give up when nothing has come for so long */
    std::uint32_t period_us   = 0U;
    std::uint32_t deadline_us = 200000U;
    std::uint32_t settle_us   = 0U;
    std::uint16_t quarantine  = 20U;
    std::uint16_t max_gap     = 100U;
    bool          mute        = false; /* node: nobody speaks */
    bool          fusion      = false; /* node: takes local states for samples */
    std::string   sensor;              /* node: only the local filter of this sensor */
};

/** Exit status: 0; 1 if the plant diverged, a node heard no run, or nobody answered. */
int plant_command(const BusOptions &options);
int node_command(const BusOptions &options);
int attack_command(const BusOptions &options);
/** node_command() with options.sensor. */
int station_command(const BusOptions &options);
/** The tables of `lasso` or `canonical`; InputError for another method. */
const blw_lasso_model_t &split_model(const Estimator &estimator);

/** Set by SIGINT and SIGTERM: end in good order. */
extern std::atomic<bool> bus_interrupted;

/** "blw_bus plant: listening on can:vcan0", for whoever starts the processes. */
void say_listening(const char *who, const std::string &where);

} // namespace sim
#endif
