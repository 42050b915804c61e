/* SPDX-License-Identifier: MIT */
#include "summary.h"
#include "constants.h"
#include "words.h"
#include <algorithm>
#include <cmath>

namespace sim
{
namespace
{

const char *const PHASE_NAMES[PHASES] = {"before", "during", "after", "all"};

/* Mean and its standard error over the runs in which the value is known. */
struct Mean {
    double value = UNKNOWN;
    double error = UNKNOWN;
};

Mean mean_of(const std::vector<double> &values)
{
    double count  = 0.0;
    double sum    = 0.0;
    double spread = 0.0;
    for (const double value : values) {
        if (!std::isnan(value)) {
            count += 1.0;
            const double step = value - sum / std::max(count - 1.0, 1.0);
            spread += (count > 1.0) ? (step * step * (count - 1.0) / count) : 0.0;
            sum += value;
        }
    }
    Mean mean;
    if (count > 0.0) {
        mean.value = sum / count;
    }
    if (count > 1.0) {
        mean.error = std::sqrt(spread / (count - 1.0) / count);
    }
    return mean;
}

Json known(double value)
{
    return std::isfinite(value) ? Json(value) : Json();
}

Mean mean_square(const MethodScores &scores, std::size_t phase)
{
    std::vector<double> values;
    for (const Score &run : scores.runs) {
        values.push_back(run.mse[phase]);
    }
    return mean_of(values);
}

Json root_mean_squares(const MethodScores &scores, std::size_t phase)
{
    Json list = Json::array();
    for (Eigen::Index j = 0; j < scores.runs.front().mse_state[phase].size(); j++) {
        std::vector<double> values;
        for (const Score &run : scores.runs) {
            values.push_back(run.mse_state[phase][j]);
        }
        list.push_back(known(std::sqrt(mean_of(values).value)));
    }
    return list;
}

void add_errors(const MethodScores &scores, const MethodScores &oracle, Json &out)
{
    for (std::size_t phase = 0U; phase < PHASES; phase++) {
        const char  *name            = PHASE_NAMES[phase];
        const Mean   mean            = mean_square(scores, phase);
        const double best            = mean_square(oracle, phase).value;
        out["mse"][name]             = known(mean.value);
        out["mse_se"][name]          = known(mean.error);
        out["rmse"][name]            = known(std::sqrt(mean.value));
        out["rmse_state"][name]      = root_mean_squares(scores, phase);
        out["ratio_to_oracle"][name] = known((best > 0.0) ? (mean.value / best) : UNKNOWN);
    }
}

Share total(const MethodScores &scores, Share Score::*member)
{
    Share sum;
    for (const Score &run : scores.runs) {
        sum.cases += (run.*member).cases;
        sum.tries += (run.*member).tries;
    }
    return sum;
}

Json rate(const Share &share)
{
    return (share.tries > 0U)
               ? Json(static_cast<double>(share.cases) / static_cast<double>(share.tries))
               : Json();
}

Json count_of(const Share &share)
{
    return {{"count", share.cases}, {"of", share.tries}, {"rate", rate(share)}};
}

void add_detection(const MethodScores &scores, double dt_s, Json &out)
{
    std::vector<double> delays;
    Share               detected;
    for (const Score &run : scores.runs) {
        for (const std::optional<std::size_t> &delay : run.delays) {
            detected.add(delay.has_value());
            if (delay) {
                delays.push_back(static_cast<double>(*delay));
            }
        }
    }
    const double delay             = mean_of(delays).value;
    out["detection_delay_steps"]   = known(delay);
    out["detection_delay_s"]       = known(delay * dt_s);
    out["attacks_detected"]        = count_of(detected);
    out["false_alarm_rate"]        = rate(total(scores, &Score::false_alarms));
    out["false_alarm_rate_before"] = rate(total(scores, &Score::false_alarms_before));
    out["missed_exclusions"]       = count_of(total(scores, &Score::missed));
    out["wrong_exclusions"]        = count_of(total(scores, &Score::wrong));
}

void add_outcomes(const MethodScores &scores, Json &out)
{
    for (std::size_t phase = 0U; phase < PHASES; phase++) {
        Share share;
        for (const Score &run : scores.runs) {
            share.cases += run.kalman[phase].cases;
            share.tries += run.kalman[phase].tries;
        }
        out["kalman_rate"][PHASE_NAMES[phase]] = rate(share);
    }
    for (unsigned outcome = 0U; outcome < 4U; outcome++) {
        std::size_t count = 0U;
        for (const Score &run : scores.runs) {
            count += run.outcomes[outcome];
        }
        out["outcomes"][outcome_word(outcome)] = count;
    }
    out["flags"] = Json::object();
    for (const FlagWord &flag : FLAG_WORDS) {
        std::size_t count = 0U;
        for (const Score &run : scores.runs) {
            const auto found = run.flags.find(flag.flag);
            count += (found == run.flags.end()) ? 0U : found->second;
        }
        out["flags"][flag.word] = count;
    }
}

void add_iterations(const MethodScores &scores, Json &out)
{
    std::map<unsigned, std::size_t> histogram;
    double                          sum   = 0.0;
    double                          steps = 0.0;
    for (const Score &run : scores.runs) {
        for (const auto &[iterations, count] : run.iterations) {
            histogram[iterations] += count;
            sum += static_cast<double>(iterations) * static_cast<double>(count);
            steps += static_cast<double>(count);
        }
    }
    Json bars = Json::object();
    for (const auto &[iterations, count] : histogram) {
        bars[std::to_string(iterations)] = count;
    }
    out["iterations"] = {{"mean", known(sum / steps)},
                         {"max", histogram.empty() ? Json() : Json(histogram.rbegin()->first)},
                         {"histogram", bars}};
}

void add_verdict(const std::string &method, const Design &design, Json &out)
{
    const Json::json_pointer where("/methods/" + method + "/info/verdict");
    if (design.root.contains(where)) {
        out["verdict"] = design.root.at(where);
    }
}

} // namespace

Json summarise(const std::vector<MethodScores> &scores, const Design &design)
{
    Json methods = Json::object();
    for (const MethodScores &method : scores) {
        Json &out = methods[method.method];
        add_errors(method, scores.back(), out);
        add_detection(method, design.dt_s, out);
        add_outcomes(method, out);
        add_iterations(method, out);
        add_verdict(method.method, design, out);
    }
    return methods;
}

Json summarise_windows(const std::vector<Window> &windows, const Design &design)
{
    Json list = Json::array();
    for (const Window &window : windows) {
        Json sensors = Json::array();
        for (std::size_t i = 0U; i < design.m; i++) {
            if (((window.sensors >> i) & 1U) != 0U) {
                sensors.push_back(design.sensors[i]);
            }
        }
        list.push_back({{"from_k", window.from_k},
                        {"to_k", window.to_k},
                        {"from_s", window.from_s},
                        {"to_s", window.to_s + design.dt_s},
                        {"sensors", sensors}});
    }
    return list;
}

} // namespace sim
