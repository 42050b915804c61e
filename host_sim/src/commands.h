/* SPDX-License-Identifier: MIT */
/** @file commands.h  The subcommands of blw_sim.
 *
 *  Both write log.csv, <method>.csv, oracle.csv and summary.json into the output folder, all or
 *  none.  With several runs, log.csv and the methods' files are those of the first run and
 *  summary.json covers all.  They return the exit status: 0, or 1 if the plant diverged (what came
 *  before is written).  InputError for bad input.
 */
#ifndef BLW_SIM_COMMANDS_H
#define BLW_SIM_COMMANDS_H
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace sim
{

struct Options {
    std::string                  input; /* scenario or log */
    std::string                  design;
    std::string                  out;
    std::vector<std::string>     methods; /* names, or "all" */
    std::optional<std::uint64_t> seed;
    std::optional<std::uint64_t> runs;
    std::string                  map;
    std::string                  attack;
    std::string                  attack_id;
    bool                         compare = false; /* with the filters of comparison.h */
    bool                         json    = false;
};

int run_command(const Options &options);
int replay_command(const Options &options);

/** "0.1.0 (f32)": version and width of the number type. */
std::string version_text();

} // namespace sim
#endif
