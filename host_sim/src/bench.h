/* SPDX-License-Identifier: MIT */
/** @file bench.h  All methods side by side on the same measurements, and what they said. */
#ifndef BLW_SIM_BENCH_H
#define BLW_SIM_BENCH_H
#include "comparison.h"
#include "log.h"
#include "methods.h"
#include "oracle.h"
#include <string>
#include <vector>

namespace sim
{

/** What a method said in one step. */
struct Verdict {
    Instant             at;
    Eigen::VectorXd     x_hat;     /* [n] */
    Eigen::VectorXd     suspicion; /* [m] */
    double              statistic  = 0.0;
    double              threshold  = 0.0;
    double              bound      = 0.0;
    blw_mask_t          excluded   = 0U;
    blw_mask_t          used       = 0U;
    unsigned            iterations = 0U;
    unsigned            outcome    = BLW_OUTCOME_KALMAN;
    unsigned            flags      = 0U;
    std::vector<double> extra; /* one per Trace::extra_columns */
};

/** One method over one run: a verdict for every row of the log but the first. */
struct Trace {
    std::string              method;
    std::vector<Verdict>     verdicts;
    std::vector<std::string> extra_columns; /* of this method alone */
};

/** What an estimator reported, in double. */
Verdict verdict_of(const blw_estimator_out_t &out, Instant at, const Design &design);

class Bench
{
public:
    /** The methods named, each once.  @param design outlives the bench
     *  @param compare also the filters of comparison.h */
    Bench(const Design &design, const std::vector<std::string> &methods, bool compare);

    /** Everybody back to x0. */
    void start();
    /** One step of every method and of the oracle, from the last row to this one. */
    void step(const Row &last, const Row &now);
    /** The newest estimate of a method, x0 before the first step; InputError if it is not here. */
    const Eigen::VectorXd &x_hat(const std::string &method) const;

    /** The methods' traces in their order, those of the comparisons, then the oracle's. */
    const std::vector<Trace> &traces() const
    {
        return traces_;
    }

private:
    void step_oracle(const Row &last, const Row &now);
    void step_comparison(std::size_t i, const Row &last, const Row &now);

    const Design           *design_;
    std::unique_ptr<Plant>  plant_;
    std::vector<Estimator>  estimators_;
    std::vector<Comparison> comparisons_;
    Oracle                  oracle_;
    std::vector<Trace>      traces_;
};

/** Name of the last trace. */
extern const char *const ORACLE;

} // namespace sim
#endif
