/* SPDX-License-Identifier: MIT */
#include "program.h"
#include "commands.h"
#include "error.h"
#include <algorithm>
#include <iostream>
#include <new>

namespace sim
{

namespace
{

const int FAILED    = 1;
const int BAD_INPUT = 2;

int complain(const CLI::App &app, const std::string &message, int status)
{
    std::string line = message;
    std::replace(line.begin(), line.end(), '\n', ' ');
    std::cerr << app.get_name() << ": " << line << "\n";
    return status;
}

} // namespace

int run_program(CLI::App &app, int argc, char **argv, const std::function<int()> &command)
{
    app.set_version_flag("--version", app.get_name() + " " + version_text());
    app.require_subcommand(1);
    try {
        app.parse(argc, argv);
        return command();
    } catch (const CLI::Success &help_or_version) {
        return app.exit(help_or_version);
    } catch (const CLI::ParseError &error) {
        return complain(app, std::string(error.what()) + "; see --help", BAD_INPUT);
    } catch (const InputError &error) {
        return complain(app, error.what(), BAD_INPUT);
    } catch (const std::bad_alloc &) {
        return complain(app, "not enough memory", FAILED);
    } catch (const std::exception &error) {
        return complain(app, error.what(), FAILED);
    }
}

} // namespace sim
