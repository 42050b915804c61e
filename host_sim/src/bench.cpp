/* SPDX-License-Identifier: MIT */
#include "bench.h"
#include "error.h"
#include <algorithm>

namespace sim
{
const char *const ORACLE = "oracle";

Verdict verdict_of(const blw_estimator_out_t &out, Instant at, const Design &design)
{
    using Reals = Eigen::Matrix<blw_real_t, Eigen::Dynamic, 1>;
    Verdict verdict;
    verdict.at = at;
    verdict.x_hat =
        Eigen::Map<const Reals>(out.x_hat, static_cast<Eigen::Index>(design.n)).cast<double>();
    verdict.suspicion =
        Eigen::Map<const Reals>(out.suspicion, static_cast<Eigen::Index>(design.m)).cast<double>();
    verdict.statistic  = static_cast<double>(out.statistic);
    verdict.threshold  = static_cast<double>(out.threshold);
    verdict.bound      = static_cast<double>(out.bound);
    verdict.excluded   = out.excluded;
    verdict.used       = out.used;
    verdict.iterations = out.iterations;
    verdict.outcome    = out.outcome;
    verdict.flags      = out.flags;
    return verdict;
}

Bench::Bench(const Design &design, const std::vector<std::string> &methods, bool compare)
    : design_(&design), plant_(load_plant(design)), oracle_(design)
{
    estimators_.reserve(methods.size());
    for (const std::string &method : methods) {
        estimators_.emplace_back(design, *plant_, method);
    }
    if (compare) {
        using Kind = Comparison::Kind;
        for (const Kind kind : {Kind::augmented, Kind::augmented_blind, Kind::adaptive,
                                Kind::strong_kalman, Kind::central_kalman}) {
            comparisons_.emplace_back(design, kind);
        }
    }
}

void Bench::start()
{
    traces_.clear();
    for (Estimator &estimator : estimators_) {
        estimator.reset();
        traces_.push_back({estimator.name(), {}, estimator.extra_columns()});
    }
    for (Comparison &comparison : comparisons_) {
        comparison.reset();
        traces_.push_back({comparison.name(), {}, {}});
    }
    oracle_ = Oracle(*design_);
    traces_.push_back({ORACLE, {}, {}});
}

void Bench::step(const Row &last, const Row &now)
{
    for (std::size_t i = 0U; i < estimators_.size(); i++) {
        const blw_estimator_out_t &out =
            estimators_[i].step(last.u, now.samples.y, now.samples.valid);
        traces_[i].verdicts.push_back(verdict_of(out, now.at, *design_));
        traces_[i].verdicts.back().extra = estimators_[i].extra_values();
    }
    for (std::size_t i = 0U; i < comparisons_.size(); i++) {
        step_comparison(i, last, now);
    }
    step_oracle(last, now);
}

const Eigen::VectorXd &Bench::x_hat(const std::string &method) const
{
    const auto found = std::find_if(traces_.begin(), traces_.end(),
                                    [&](const Trace &trace) { return trace.method == method; });
    if (found == traces_.end()) {
        throw InputError("no method \"" + method + "\" among those that run");
    }
    return found->verdicts.empty() ? design_->x0 : found->verdicts.back().x_hat;
}

void Bench::step_comparison(std::size_t i, const Row &last, const Row &now)
{
    const blw_mask_t used = usable(*design_, now.samples.y, now.samples.valid);
    comparisons_[i].step(last.u, now.samples.y, used);

    Verdict verdict;
    verdict.at        = now.at;
    verdict.x_hat     = comparisons_[i].x_hat();
    verdict.used      = used;
    verdict.suspicion = Eigen::VectorXd::Zero(now.samples.y.size());
    verdict.flags     = (used != BLW_MASK_ALL(design_->m)) ? BLW_FLAG_MISSING : 0U;
    traces_[estimators_.size() + i].verdicts.push_back(std::move(verdict));
}

void Bench::step_oracle(const Row &last, const Row &now)
{
    const blw_mask_t usable_now = usable(*design_, now.samples.y, now.samples.valid);
    const blw_mask_t excluded   = usable_now & now.attacked;
    const blw_mask_t used       = usable_now & ~excluded;
    oracle_.step(last.u, now.samples.y, used);

    Verdict verdict;
    verdict.at       = now.at;
    verdict.x_hat    = oracle_.x_hat();
    verdict.excluded = excluded;
    verdict.used     = usable_now;
    verdict.outcome  = (excluded == 0U) ? BLW_OUTCOME_KALMAN : BLW_OUTCOME_CONVERGED;
    verdict.flags    = (usable_now != BLW_MASK_ALL(design_->m)) ? BLW_FLAG_MISSING : 0U;
    verdict.flags |= (used == 0U) ? BLW_FLAG_BLIND : 0U;
    verdict.suspicion = Eigen::VectorXd::Zero(now.samples.y.size());
    for (Eigen::Index i = 0; i < verdict.suspicion.size(); i++) {
        verdict.suspicion[i] = (((used >> i) & 1U) == 0U) ? 1.0 : 0.0;
    }
    traces_.back().verdicts.push_back(std::move(verdict));
}

} // namespace sim
