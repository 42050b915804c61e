/* SPDX-License-Identifier: MIT */
#include "commands.h"
#include "attack_parse.h"
#include "error.h"
#include "summary.h"
#include "text.h"
#include "trial.h"
#include "words.h"
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <unistd.h>

namespace sim
{
namespace
{

const bool  IS_FLOAT  = sizeof(blw_real_t) == 4U;
const char *PRECISION = IS_FLOAT ? "f32" : "f64";
/* Enough to tell any two numbers apart. */
const int DIGITS        = IS_FLOAT ? 9 : 17;
const int DOUBLE_DIGITS = 17;
const int RUN_DIVERGED  = 1;

/* Scores of all runs so far, and the files of the first. */
class Session
{
public:
    Session(const Design &design, const Options &options) : design_(&design), files_(options.out) {}

    void take(const Log &log, const std::vector<Trace> &traces)
    {
        const std::vector<Window> windows = find_windows(log);
        if (scores_.empty()) {
            windows_   = windows;
            has_truth_ = log.has_truth;
            add_files(log, traces);
        }
        for (std::size_t i = 0U; i < traces.size(); i++) {
            scores_[i].runs.push_back(score(log, windows, traces[i], traces.back()));
        }
    }

    /* Complete the summary's head by the results, and write everything. */
    Json finish(Json summary)
    {
        summary["errors_against"] = has_truth_ ? "truth" : ORACLE;
        summary["attack_windows"] = summarise_windows(windows_, *design_);
        summary["methods"]        = summarise(scores_, *design_);
        files_.add("summary.json", summary.dump(2) + "\n");
        files_.commit();
        return summary;
    }

private:
    void add_files(const Log &log, const std::vector<Trace> &traces)
    {
        files_.add("log.csv", format_log(log, *design_));
        for (const Trace &trace : traces) {
            scores_.push_back({trace.method, {}});
            const int digits = (trace.method == ORACLE) ? DOUBLE_DIGITS : DIGITS;
            files_.add(trace.method + ".csv", format_trace(trace, *design_, digits));
        }
    }

    const Design             *design_;
    OutputSet                 files_;
    std::vector<MethodScores> scores_;
    std::vector<Window>       windows_;
    bool                      has_truth_ = false;
};

/* kalman first, then the wanted methods in the order of the design, each once. */
std::vector<std::string> choose_methods(const Options &options, const Design &design,
                                        const std::string &controller)
{
    std::vector<std::string> wanted = options.methods;
    if (!controller.empty() && (controller != "truth")) {
        wanted.push_back(controller);
    }
    const bool all = std::find(wanted.begin(), wanted.end(), "all") != wanted.end();
    for (const std::string &method : wanted) {
        if (method != "all") {
            find_method(method);
            design.method(method);
        }
    }
    std::vector<std::string> chosen = {"kalman"};
    for (const std::string &method : design.methods()) {
        const bool named = std::find(wanted.begin(), wanted.end(), method) != wanted.end();
        if ((all || named) && (method != "kalman")) {
            chosen.push_back(method);
        }
    }
    return chosen;
}

std::string file_name(const std::string &path)
{
    return std::filesystem::path(path).filename().string();
}

Json attacks_json(const std::vector<AttackSpec> &attacks, const Design &design)
{
    Json list = Json::array();
    for (const AttackSpec &attack : attacks) {
        Json sensors = Json::array();
        for (const std::size_t sensor : attack.sensors) {
            sensors.push_back(design.sensors[sensor]);
        }
        list.push_back({{"id", attack.id}, {"kind", kind_name(attack.kind)}, {"sensors", sensors}});
    }
    return list;
}

Json summary_head(const char *command, const Options &options, const Design &design,
                  const std::vector<AttackSpec> &attacks)
{
    Json versions       = design.root.value("versions", Json::object());
    versions["blw_sim"] = BLW_SIM_VERSION;
    versions["abi"]     = BLW_MODEL_ABI;
    return {{"format", "bulwark-summary-1"},
            {"command", command},
            {"name", design.name},
            {"model_sha256", design.model_sha256},
            {"design", file_name(options.design)},
            {"input", file_name(options.input)},
            {"precision", PRECISION},
            {"versions", versions},
            {"dt_s", design.dt_s},
            {"states", design.states},
            {"sensors", design.sensors},
            {"attacks", attacks_json(attacks, design)}};
}

void show_progress(std::uint64_t run, std::uint64_t runs)
{
    if ((runs > 1U) && (::isatty(STDERR_FILENO) == 1)) {
        std::fprintf(stderr, "\rrun %llu of %llu%s", static_cast<unsigned long long>(run),
                     static_cast<unsigned long long>(runs), (run == runs) ? "\n" : "");
    }
}

std::string figure(const Json &value)
{
    return value.is_number() ? with_digits(value.get<double>(), 4) : "-";
}

/* Mean squared errors per phase, and how often the method passed its test. */
void print_summary(const Json &summary, bool as_json)
{
    if (as_json) {
        std::cout << summary.dump(2) << "\n";
        return;
    }
    std::printf("%-10s %12s %12s %12s %12s %12s\n", "MSE", "before", "during", "after",
                "during/orac.", "kalman rate");
    for (const auto &item : summary["methods"].items()) {
        const Json &method = item.value();
        const Json &mse    = method["mse"];
        std::printf("%-10s %12s %12s %12s %12s %12s\n", item.key().c_str(),
                    figure(mse["before"]).c_str(), figure(mse["during"]).c_str(),
                    figure(mse["after"]).c_str(),
                    figure(method["ratio_to_oracle"]["during"]).c_str(),
                    figure(method["kalman_rate"]["all"]).c_str());
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

std::string version_text()
{
    return std::string(BLW_SIM_VERSION) + " (" + PRECISION + ")";
}

int run_command(const Options &options)
{
    const Design design   = load_design(options.design);
    Scenario     scenario = load_scenario(options.input, design);
    scenario.seed         = options.seed.value_or(scenario.seed);
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
        std::cerr << "blw_sim: " << options.input << ": the plant diverged in run "
                  << divergence->run + 1U << " at k = " << divergence->k << ": state "
                  << divergence->state << " = " << with_digits(divergence->value, 3)
                  << "; an unstable plant needs a stabilising [controller]\n";
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
