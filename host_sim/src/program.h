/* SPDX-License-Identifier: MIT */
/* What the programs of the simulator do alike: version, command line, errors. */
#ifndef PROGRAM_H
#define PROGRAM_H
#include <CLI/CLI.hpp>
#include <functional>

namespace sim
{

/* Parse the command line of app, whose subcommands are set up, and run the command.  An error
 * becomes one line on standard error.
 * @return the exit status: that of the command, 1 if it failed, 2 for bad input. */
int run_program(CLI::App &app, int argc, char **argv, const std::function<int()> &command);

} // namespace sim
#endif
