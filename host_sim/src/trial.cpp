/* SPDX-License-Identifier: MIT */
#include "trial.h"
#include "plant.h"
#include "text.h"
#include <cmath>

namespace sim
{
namespace
{

const char *const TRUTH = "truth";

Eigen::VectorXd input(const Scenario &scenario, const Design &design, const TruePlant &plant,
                      const Bench &bench, double t_s)
{
    const ControllerSpec &controller = scenario.controller;
    const bool            truth      = !controller.feedback || (controller.method == TRUTH);
    return control(controller, design, t_s, truth ? plant.x() : bench.x_hat(controller.method));
}

void take(AttackedSamples attacked, Row &row)
{
    row.samples = std::move(attacked.samples);
    row.a += attacked.a;
    row.attacked |= attacked.attacked;
    row.active |= attacked.active;
}

} // namespace

std::optional<Divergence> find_divergence(const Eigen::VectorXd &x, const Scenario &scenario,
                                          const Design &design, std::uint64_t k)
{
    for (Eigen::Index j = 0; j < x.size(); j++) {
        if (!(std::fabs(x[j]) <= scenario.diverged_at)) {
            return Divergence{0U, k, design.states[static_cast<std::size_t>(j)], x[j]};
        }
    }
    return std::nullopt;
}

std::string divergence_text(const std::string &input, const Divergence &divergence)
{
    return input + ": the plant diverged in run " + std::to_string(divergence.run + 1U)
           + " at k = " + std::to_string(divergence.k) + ": state " + divergence.state + " = "
           + with_digits(divergence.value, 3)
           + "; an unstable plant needs a stabilising [controller]";
}

Simulation simulate(const Scenario &scenario, const Design &design, std::uint64_t seed,
                    Bench &bench)
{
    TruePlant     plant(design, scenario.x0_mean, scenario.x0_covariance, seed);
    const Instant end = {scenario.steps, static_cast<double>(scenario.steps) * design.dt_s};
    Attacker      attacker(design, scenario.attacks, end, seed);
    Simulation    result;
    result.log.has_truth   = true;
    std::vector<Row> &rows = result.log.rows;
    bench.start();
    rows.push_back(empty_row(design));
    rows.front().x = plant.x();
    rows.front().u = input(scenario, design, plant, bench, 0.0);
    for (std::uint64_t k = 1U; k <= scenario.steps; k++) {
        plant.step(rows.back().u);
        result.divergence = find_divergence(plant.x(), scenario, design, k);
        if (result.divergence) {
            break;
        }
        Row row = empty_row(design);
        row.at  = {k, static_cast<double>(k) * design.dt_s};
        row.x   = plant.x();
        take(attacker.apply(row.at, rows.back().u, plant.measure()), row);
        bench.step(rows.back(), row);
        row.u = input(scenario, design, plant, bench, row.at.t_s);
        rows.push_back(std::move(row));
    }
    return result;
}

void attack_log(Log &log, const Design &design, const std::vector<AttackSpec> &attacks,
                std::uint64_t seed)
{
    Attacker attacker(design, attacks, log.rows.back().at, seed);
    for (std::size_t i = 1U; i < log.rows.size(); i++) {
        Row &row = log.rows[i];
        take(attacker.apply(row.at, log.rows[i - 1U].u, row.samples), row);
    }
}

void replay(const Log &log, Bench &bench)
{
    bench.start();
    for (std::size_t i = 1U; i < log.rows.size(); i++) {
        bench.step(log.rows[i - 1U], log.rows[i]);
    }
}

} // namespace sim
