/* SPDX-License-Identifier: MIT */
/** @file trial.h  One run: a plant simulated, or a log replayed, with the bench in step. */
#ifndef BLW_SIM_TRIAL_H
#define BLW_SIM_TRIAL_H
#include "bench.h"
#include "scenario.h"
#include <optional>
#include <string>

namespace sim
{

/** Where the true state left its bound and the run ended. */
struct Divergence {
    std::uint64_t run = 0U;
    std::uint64_t k   = 0U;
    std::string   state;
    double        value = 0.0;
};

/** The first state that is out of bounds, if there is one. */
std::optional<Divergence> find_divergence(const Eigen::VectorXd &x, const Scenario &scenario,
                                          const Design &design, std::uint64_t k);
/** The same as one line. */
std::string divergence_text(const std::string &input, const Divergence &divergence);

struct Simulation {
    Log                       log;
    std::optional<Divergence> divergence; /* the log ends before it */
};

/** Simulate the scenario with that seed; the traces are in the bench. */
Simulation simulate(const Scenario &scenario, const Design &design, std::uint64_t seed,
                    Bench &bench);

/** Attack the samples of a log. */
void attack_log(Log &log, const Design &design, const std::vector<AttackSpec> &attacks,
                std::uint64_t seed);

/** Step through a log; the traces are in the bench. */
void replay(const Log &log, Bench &bench);

} // namespace sim
#endif
