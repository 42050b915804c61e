/* SPDX-License-Identifier: MIT */
#include "session.h"
#include "words.h"
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>

namespace sim
{
namespace
{

const bool  IS_FLOAT  = sizeof(blw_real_t) == 4U;
const char *PRECISION = IS_FLOAT ? "f32" : "f64";
/* Enough to tell any two numbers apart. */
const int   DIGITS        = IS_FLOAT ? 9 : 17;
const int   DOUBLE_DIGITS = 17;
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

std::string figure(const Json &value)
{
    return value.is_number() ? with_digits(value.get<double>(), 4) : "-";
}

} // namespace

Session::Session(const Design &design, const Options &options)
    : design_(&design), files_(options.out)
{
}

void Session::take(const Log &log, const std::vector<Trace> &traces)
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

void Session::add(const std::string &name, std::string content)
{
    files_.add(name, std::move(content));
}

Json Session::finish(Json summary)
{
    summary["errors_against"] = has_truth_ ? "truth" : ORACLE;
    summary["attack_windows"] = summarise_windows(windows_, *design_);
    summary["methods"]        = summarise(scores_, *design_);
    files_.add("summary.json", summary.dump(2) + "\n");
    files_.commit();
    return summary;
}

void Session::add_files(const Log &log, const std::vector<Trace> &traces)
{
    files_.add("log.csv", format_log(log, *design_));
    for (const Trace &trace : traces) {
        scores_.push_back({trace.method, {}});
        const int digits = (trace.method == ORACLE) ? DOUBLE_DIGITS : DIGITS;
        files_.add(trace.method + ".csv", format_trace(trace, *design_, digits));
    }
}

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

std::string version_text()
{
    return std::string(BLW_SIM_VERSION) + " (" + PRECISION + ")";
}

int estimate_digits()
{
    return DIGITS;
}

} // namespace sim
