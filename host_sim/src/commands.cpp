/* SPDX-License-Identifier: MIT */
#include "commands.h"
#include "attack_parse.h"
#include "error.h"
#include "session.h"
#include "trial.h"
#include <cstdio>
#include <iostream>
#include <unistd.h>

namespace sim
{
namespace
{

const int RUN_DIVERGED = 1;

void show_progress(std::uint64_t run, std::uint64_t runs)
{
    if ((runs > 1U) && (::isatty(STDERR_FILENO) == 1)) {
        std::fprintf(stderr, "\rrun %llu of %llu%s", static_cast<unsigned long long>(run),
                     static_cast<unsigned long long>(runs), (run == runs) ? "\n" : "");
    }
}

/* All runs up to the first that diverges. */
std::optional<Divergence> simulate_runs(const Scenario &scenario, const Design &design,
                                        Bench &bench, Session &session)
{
    for (std::uint64_t run = 0U; run < scenario.runs; run++) {
        Simulation one = simulate(scenario, design, run_seed(scenario.seed, run), bench);
        session.take(one.log, bench.traces());
        if (one.divergence) {
            one.divergence->run = run;
            return one.divergence;
        }
        show_progress(run + 1U, scenario.runs);
    }
    return std::nullopt;
}

Log open_log(const Options &options, const Design &design)
{
    return options.map.empty() ? read_log(options.input, design)
                               : read_foreign_log(options.input, options.map, design);
}

Json divergence_json(const std::optional<Divergence> &divergence)
{
    if (!divergence) {
        return Json();
    }
    return {{"run", divergence->run}, {"k", divergence->k}, {"state", divergence->state}};
}

} // namespace

int run_command(const Options &options)
{
    const Design design   = load_design(options.design);
    Scenario     scenario = load_scenario(options.input, design, options.seed);
    scenario.runs         = options.runs.value_or(scenario.runs);
    Bench   bench(design, choose_methods(options, design, scenario.controller.method),
                  options.compare);
    Session session(design, options);

    const std::optional<Divergence> divergence = simulate_runs(scenario, design, bench, session);
    Json                            head = summary_head("run", options, design, scenario.attacks);
    head["seed"]                         = scenario.seed;
    head["runs"]                         = scenario.runs;
    head["steps"]                        = scenario.steps;
    head["divergence"]                   = divergence_json(divergence);
    print_summary(session.finish(std::move(head)), options.json);
    if (divergence) {
        std::cerr << "blw_sim: " << divergence_text(options.input, *divergence) << "\n";
    }
    return divergence ? RUN_DIVERGED : 0;
}

int replay_command(const Options &options)
{
    const Design            design = load_design(options.design);
    Log                     log    = open_log(options, design);
    const std::uint64_t     seed   = options.seed.value_or(1U);
    std::vector<AttackSpec> attacks;
    if (!options.attack.empty()) {
        attacks = read_attacks(options.attack, options.attack_id, design);
        attack_log(log, design, attacks, seed);
    }
    Bench   bench(design, choose_methods(options, design, ""), options.compare);
    Session session(design, options);
    replay(log, bench);
    session.take(log, bench.traces());
    Json head     = summary_head("replay", options, design, attacks);
    head["seed"]  = seed;
    head["runs"]  = 1;
    head["steps"] = log.rows.size() - 1U;
    print_summary(session.finish(std::move(head)), options.json);
    return 0;
}

} // namespace sim
