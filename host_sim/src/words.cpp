/* SPDX-License-Identifier: MIT */
#include "words.h"
#include "text.h"

namespace sim
{
namespace
{

std::string header(const Trace &trace, const Design &design)
{
    std::string line = "k,t_s,status," + join(design.states, ",")
                       + ",statistic,threshold,iterations,bound,excluded";
    for (const std::string &sensor : design.sensors) {
        line += ",suspicion:" + sensor;
    }
    for (const std::string &column : trace.extra_columns) {
        line += "," + column;
    }
    return line + "\n";
}

std::string names_of(blw_mask_t mask, const Design &design)
{
    std::vector<std::string> names;
    for (std::size_t i = 0U; i < design.m; i++) {
        if (((mask >> i) & 1U) != 0U) {
            names.push_back(design.sensors[i]);
        }
    }
    return join(names, ";");
}

std::string format_verdict(const Verdict &verdict, const Design &design, int digits)
{
    std::string line = std::to_string(verdict.at.k) + "," + shortest(verdict.at.t_s) + ","
                       + status_text(verdict.outcome, verdict.flags);
    for (const double value : verdict.x_hat) {
        line += "," + with_digits(value, digits);
    }
    line += "," + with_digits(verdict.statistic, digits) + ","
            + with_digits(verdict.threshold, digits) + "," + std::to_string(verdict.iterations)
            + "," + with_digits(verdict.bound, digits) + "," + names_of(verdict.excluded, design);
    for (const double value : verdict.suspicion) {
        line += "," + with_digits(value, digits);
    }
    for (const double value : verdict.extra) {
        line += "," + with_digits(value, digits);
    }
    return line + "\n";
}

} // namespace

const std::array<FlagWord, 5U> FLAG_WORDS = {{
    {BLW_FLAG_MISSING, "missing"},
    {BLW_FLAG_DEGRADED, "degraded"},
    {BLW_FLAG_BLIND, "blind"},
    {BLW_FLAG_WARMING_UP, "warming_up"},
    {BLW_FLAG_AMBIGUOUS, "ambiguous"},
}};

const char *outcome_word(unsigned outcome)
{
    switch (outcome) {
    case BLW_OUTCOME_KALMAN:
        return "kalman";
    case BLW_OUTCOME_CONVERGED:
        return "converged";
    case BLW_OUTCOME_BOUND:
        return "bound";
    default:
        return "held";
    }
}

std::string status_text(unsigned outcome, unsigned flags)
{
    std::string text = outcome_word(outcome);
    for (const FlagWord &flag : FLAG_WORDS) {
        if ((flags & flag.flag) != 0U) {
            text += std::string("+") + flag.word;
        }
    }
    return text;
}

std::string format_trace(const Trace &trace, const Design &design, int digits)
{
    std::string text = header(trace, design);
    for (const Verdict &verdict : trace.verdicts) {
        text += format_verdict(verdict, design, digits);
    }
    return text;
}

} // namespace sim
