/* SPDX-License-Identifier: MIT */
/** @file summary.h  summary.json: the scores of all methods over all runs.
 *
 *  Per method: mse, mse_se (standard error over the runs), rmse, rmse_state and ratio_to_oracle,
 *  each with the phases before, during, after, all (null where a phase is empty or, for one run,
 *  no standard error exists); detection_delay_steps and _s of the attacks that were detected,
 *  false_alarm_rate outside attacks, missed and wrong exclusions, kalman_rate, outcomes, flags,
 *  iterations, and the verdict that the design gave on the method, if any.  Means are over runs,
 *  rates over the steps of all runs.
 */
#ifndef BLW_SIM_SUMMARY_H
#define BLW_SIM_SUMMARY_H
#include "score.h"
#include <string>
#include <vector>

namespace sim
{

/** The scores of one method, one per run. */
struct MethodScores {
    std::string        method;
    std::vector<Score> runs;
};

/** The member "methods" of summary.json.  @param scores the oracle's last */
Json summarise(const std::vector<MethodScores> &scores, const Design &design);

/** The member "attack_windows": what was attacked, and when. */
Json summarise_windows(const std::vector<Window> &windows, const Design &design);

} // namespace sim
#endif
