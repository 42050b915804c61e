/* SPDX-License-Identifier: MIT */
/** @file words.h  Outcomes, flags and traces as text. */
#ifndef BLW_SIM_WORDS_H
#define BLW_SIM_WORDS_H
#include "bench.h"
#include <array>
#include <string>

namespace sim
{

struct FlagWord {
    unsigned    flag;
    const char *word;
};

extern const std::array<FlagWord, 5U> FLAG_WORDS;

/** kalman, converged, bound or held. */
const char *outcome_word(unsigned outcome);
/** The outcome and "+flag" for every reservation. */
std::string status_text(unsigned outcome, unsigned flags);

/** A trace as CSV: k,t_s,status,<states>,statistic,threshold,iterations,bound,excluded,
 *  suspicion:<sensor>... and the method's own columns, with that many significant digits;
 *  `excluded` is joined by ;. */
std::string format_trace(const Trace &trace, const Design &design, int digits);

} // namespace sim
#endif
