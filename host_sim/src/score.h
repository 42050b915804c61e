/* SPDX-License-Identifier: MIT */
/** @file score.h  How well a method did in one run.
 *
 *  Phases: `before` the first attack, `during` any attack, `after` = every other step.  The first
 *  row, the initial state, is not scored.  e = x_hat - x; where no true state is known, e = x_hat -
 *  the oracle's.
 *  Alarm: statistic > threshold > 0, or a sample was there and excluded.  An attack is detected at
 *  its first step with statistic > threshold > 0 or an attacked sample excluded; windows that
 *  overlap or touch are one attack.
 */
#ifndef BLW_SIM_SCORE_H
#define BLW_SIM_SCORE_H
#include "bench.h"
#include <array>
#include <map>
#include <optional>
#include <vector>

namespace sim
{

enum Phase { BEFORE, DURING, AFTER, ALL, PHASES };

/** Steps first <= i < last (positions among the verdicts) in which some sensor is attacked. */
struct Window {
    std::size_t   first   = 0U;
    std::size_t   last    = 0U;
    std::uint64_t from_k  = 0U; /* k of the first step, */
    std::uint64_t to_k    = 0U; /* and of the last one, plus 1 */
    double        from_s  = 0.0;
    double        to_s    = 0.0; /* time of the last step */
    blw_mask_t    sensors = 0U;
};

/** A number of cases out of a number of tries. */
struct Share {
    std::size_t cases = 0U;
    std::size_t tries = 0U;
    void        add(bool hit)
    {
        cases += hit ? 1U : 0U;
        tries++;
    }
};

struct Score {
    std::array<Eigen::VectorXd, PHASES> mse_state;  /* [n] of e_j^2; NaN where nothing is known */
    std::array<double, PHASES>          mse{};      /* of |e|^2, over the known states; or NaN */
    std::vector<std::optional<std::size_t>> delays; /* steps to detection, one per window */
    Share                                   false_alarms; /* alarms in steps without attack */
    Share                                   false_alarms_before;
    Share                           missed;     /* attacked samples that were there, not excluded */
    Share                           wrong;      /* honest samples that were there, excluded */
    std::array<Share, PHASES>       kalman;     /* steps with outcome `kalman` */
    std::array<std::size_t, 4U>     outcomes{}; /* by blw_outcome_t */
    std::map<unsigned, std::size_t> flags;      /* by BLW_FLAG_... */
    std::map<unsigned, std::size_t> iterations; /* steps by the number they took */
};

/** The attacks of a log. */
std::vector<Window> find_windows(const Log &log);

/** Score a trace against the log's truth, or against the oracle's trace if there is none. */
Score score(const Log &log, const std::vector<Window> &windows, const Trace &trace,
            const Trace &oracle);

} // namespace sim
#endif
