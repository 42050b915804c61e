/* SPDX-License-Identifier: MIT */
#include "score.h"
#include "constants.h"
#include <algorithm>
#include <cmath>

namespace sim
{
namespace
{

bool fails_test(const Verdict &verdict)
{
    return (verdict.threshold > 0.0) && (verdict.statistic > verdict.threshold);
}

Phase phase_of(const Log &log, const std::vector<Window> &windows, std::size_t step)
{
    if (log.rows[step + 1U].active != 0U) {
        return DURING;
    }
    return (windows.empty() || (step < windows.front().first)) ? BEFORE : AFTER;
}

/* Sums of squares and counts per state, entries that are not known left out. */
class ErrorSum
{
public:
    explicit ErrorSum(Eigen::Index n)
        : squares_(Eigen::VectorXd::Zero(n)), counts_(Eigen::VectorXd::Zero(n))
    {
    }
    void add(const Eigen::VectorXd &error)
    {
        const auto known = !error.array().isNaN();
        squares_.array() += known.select(error.array().square(), 0.0);
        counts_.array() += known.cast<double>();
    }
    Eigen::VectorXd mean() const
    {
        return (counts_.array() > 0.0).select(squares_.array() / counts_.array(), UNKNOWN);
    }

private:
    Eigen::VectorXd squares_, counts_;
};

double sum_of_known(const Eigen::VectorXd &values)
{
    const auto known = !values.array().isNaN();
    return known.any() ? known.select(values.array(), 0.0).sum() : UNKNOWN;
}

void score_errors(const Log &log, const std::vector<Window> &windows, const Trace &trace,
                  const Trace &oracle, Score &score)
{
    const Eigen::Index           n        = log.rows.front().x.size();
    std::array<ErrorSum, PHASES> sums     = {ErrorSum(n), ErrorSum(n), ErrorSum(n), ErrorSum(n)};
    const std::vector<Verdict>  &verdicts = trace.verdicts;
    for (std::size_t i = 0U; i < verdicts.size(); i++) {
        const Eigen::VectorXd &x = log.has_truth ? log.rows[i + 1U].x : oracle.verdicts[i].x_hat;
        const Eigen::VectorXd  error = verdicts[i].x_hat - x;
        sums[phase_of(log, windows, i)].add(error);
        sums[ALL].add(error);
    }
    for (std::size_t phase = 0U; phase < PHASES; phase++) {
        score.mse_state[phase] = sums[phase].mean();
        score.mse[phase]       = sum_of_known(score.mse_state[phase]);
    }
}

void count_samples(const Row &row, const Verdict &verdict, Score &score)
{
    for (Eigen::Index i = 0; i < row.samples.y.size(); i++) {
        if (((verdict.used >> i) & 1U) == 0U) {
            continue;
        }
        const bool excluded = ((verdict.excluded >> i) & 1U) != 0U;
        if (((row.attacked >> i) & 1U) != 0U) {
            score.missed.add(!excluded);
        } else {
            score.wrong.add(excluded);
        }
    }
}

void count_step(const Row &row, const Verdict &verdict, Phase phase, Score &score)
{
    const bool alarm  = fails_test(verdict) || ((verdict.excluded & verdict.used) != 0U);
    const bool kalman = verdict.outcome == BLW_OUTCOME_KALMAN;
    if (phase != DURING) {
        score.false_alarms.add(alarm);
    }
    if (phase == BEFORE) {
        score.false_alarms_before.add(alarm);
    }
    score.kalman[phase].add(kalman);
    score.kalman[ALL].add(kalman);
    score.outcomes[verdict.outcome & 3U]++;
    score.iterations[verdict.iterations]++;
    for (unsigned flag = 1U; flag <= verdict.flags; flag <<= 1U) {
        score.flags[flag] += ((verdict.flags & flag) != 0U) ? 1U : 0U;
    }
    count_samples(row, verdict, score);
}

std::optional<std::size_t> delay(const Log &log, const Window &window, const Trace &trace)
{
    const std::size_t last = std::min(window.last, trace.verdicts.size());
    for (std::size_t i = window.first; i < last; i++) {
        const Verdict &verdict = trace.verdicts[i];
        if (fails_test(verdict) || ((verdict.excluded & log.rows[i + 1U].attacked) != 0U)) {
            return i - window.first;
        }
    }
    return std::nullopt;
}

} // namespace

std::vector<Window> find_windows(const Log &log)
{
    std::vector<Window> windows;
    for (std::size_t i = 0U; i + 1U < log.rows.size(); i++) {
        const Row &row = log.rows[i + 1U];
        if (row.active == 0U) {
            continue;
        }
        if (windows.empty() || (windows.back().last < i)) {
            windows.push_back({i, i, row.at.k, row.at.k, row.at.t_s, row.at.t_s, 0U});
        }
        windows.back().last = i + 1U;
        windows.back().to_k = row.at.k + 1U;
        windows.back().to_s = row.at.t_s;
        windows.back().sensors |= row.active;
    }
    return windows;
}

Score score(const Log &log, const std::vector<Window> &windows, const Trace &trace,
            const Trace &oracle)
{
    Score result;
    score_errors(log, windows, trace, oracle, result);
    for (std::size_t i = 0U; i < trace.verdicts.size(); i++) {
        count_step(log.rows[i + 1U], trace.verdicts[i], phase_of(log, windows, i), result);
    }
    for (const Window &window : windows) {
        result.delays.push_back(delay(log, window, trace));
    }
    return result;
}

} // namespace sim
