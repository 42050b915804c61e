/* SPDX-License-Identifier: MIT */
/** @file log.h  Logs: what the sensors sent, what the inputs were, and for scoring the truth.
 *
 *  CSV: k,t_s,<sensors>,<inputs>[,x:<state>...][,a:<sensor>...] in any order, k counting up by one.
 *  The first row is the initial state: its samples are not used, its u acts from k to k+1.  An
 *  empty cell is a missing sample, an unknown truth or, under a:, no attack.
 */
#ifndef BLW_SIM_LOG_H
#define BLW_SIM_LOG_H
#include "attack.h"
#include "design.h"
#include <string>
#include <vector>

namespace sim
{

struct Row {
    Instant         at;
    Samples         samples;
    Eigen::VectorXd u;             /* [l] */
    Eigen::VectorXd x;             /* [n] the true state; NaN where it is not known */
    Eigen::VectorXd a;             /* [m] injected attack */
    blw_mask_t      attacked = 0U; /* samples that were changed or withheld */
    blw_mask_t      active   = 0U; /* sensors held by an attack */
};

struct Log {
    std::vector<Row> rows;
    bool             has_truth = false;
};

/** A row with nothing known. */
Row empty_row(const Design &design);

/** Read a log in the format above; InputError "file:line:column: ...". */
Log read_log(const std::string &path, const Design &design);

/** Read a foreign CSV through a column map.
 *
 *      time      = "t"         # its time column, in seconds; without one, t = k dt_s
 *      first_row = "initial"   # or "sample": an initial row is put in front of it
 *      [columns]               # of sensors, inputs and x:<state>; with a factor to their unit
 *      v_esp = "speed"
 *      v_dsu = { column = "speed_kmh", unit_factor = 0.2777777777777778 }
 *
 *  A sensor or input that is not under [columns] is the column of its own name.  Rows are one dt_s
 *  apart and keep their order. */
Log read_foreign_log(const std::string &path, const std::string &map_path, const Design &design);

/** The log as CSV; numbers read back exactly. */
std::string format_log(const Log &log, const Design &design);

} // namespace sim
#endif
