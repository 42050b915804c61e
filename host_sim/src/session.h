/* SPDX-License-Identifier: MIT */
/** @file session.h  What a run, in one process or on a bus, writes and prints. */
#ifndef BLW_SIM_SESSION_H
#define BLW_SIM_SESSION_H
#include "commands.h"
#include "summary.h"
#include "text.h"
#include <string>
#include <vector>

namespace sim
{

/** Scores of all runs so far, and the files of the first. */
class Session
{
public:
    /** @param design outlives the session */
    Session(const Design &design, const Options &options);

    /** One run.  @param traces the oracle's last, each with a verdict per row but the first */
    void take(const Log &log, const std::vector<Trace> &traces);
    /** One more file. */
    void add(const std::string &name, std::string content);
    /** Complete the summary's head by the results, and write everything. */
    Json finish(Json summary);

private:
    void add_files(const Log &log, const std::vector<Trace> &traces);

    const Design             *design_;
    OutputSet                 files_;
    std::vector<MethodScores> scores_;
    std::vector<Window>       windows_;
    bool                      has_truth_ = false;
};

/** kalman first, then the wanted methods in the order of the design, each once. */
std::vector<std::string> choose_methods(const Options &options, const Design &design,
                                        const std::string &controller);

/** summary.json as far as it is known before the results. */
Json summary_head(const char *command, const Options &options, const Design &design,
                  const std::vector<AttackSpec> &attacks);

/** Mean squared errors per phase, and how often the method passed its test; or all as JSON. */
void print_summary(const Json &summary, bool as_json);

/** Significant digits that tell any two estimates apart. */
int estimate_digits();

} // namespace sim
#endif
