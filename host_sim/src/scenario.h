/* SPDX-License-Identifier: MIT */
/** @file scenario.h  SCENARIO.toml: what is simulated.
 *
 *      model   = "../models/pendulum.toml"   # seen from the scenario's folder
 *      steps   = 600
 *      seed    = 1                           # optional
 *      runs    = 1                           # optional
 *      initial = "steady"                    # optional: x(0) - x0 has the filter's steady-state
 *                                            # covariance P; "P0": the model's P0; "exact": x(0) =
 *                                            # x0; or a list of states.  Default: P0, else steady
 *      diverged_at = 1e9                     # optional: a state beyond it ends the run
 *      [controller]                          # optional, see controller.h
 *      [[attack]]                            # any number, see attack.h
 */
#ifndef BLW_SIM_SCENARIO_H
#define BLW_SIM_SCENARIO_H
#include "attack.h"
#include "controller.h"
#include "design.h"
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace sim
{

struct Scenario {
    std::string             path;
    std::uint64_t           steps = 0U;
    std::uint64_t           seed  = 1U;
    std::uint64_t           runs  = 1U;
    Eigen::VectorXd         x0_mean; /* x(0) ~ N(x0_mean, x0_covariance) */
    Eigen::MatrixXd         x0_covariance;
    double                  diverged_at = 1e9;
    ControllerSpec          controller;
    std::vector<AttackSpec> attacks;
};

/** Read and check a scenario for that design; InputError with file, line and column.
 *  @param seed instead of the file's */
Scenario load_scenario(const std::string &path, const Design &design,
                       const std::optional<std::uint64_t> &seed);

} // namespace sim
#endif
