/* SPDX-License-Identifier: MIT */
/* blw_sim: the library's estimators on simulated and on recorded measurements. */
#include "commands.h"
#include "program.h"

namespace
{

void add_common(CLI::App &command, sim::Options &options)
{
    command.add_option("--design", options.design, "NAME.json of tools/bulwark design")->required();
    command.add_option("--out", options.out, "Folder for the results")->required();
    command
        .add_option("--method", options.methods,
                    "Methods to run beside kalman and oracle; all = every one designed")
        ->delimiter(',')
        ->default_val(std::vector<std::string>{"all"});
    command.add_option("--seed", options.seed, "Seed of the random numbers")
        ->check(CLI::NonNegativeNumber);
    command.add_flag("--compare", options.compare,
                     "Also the filters that joint is compared with in its paper");
    command.add_flag("--json", options.json, "Print summary.json instead of a table");
}

CLI::App *add_run(CLI::App &app, sim::Options &options)
{
    CLI::App *run = app.add_subcommand("run", "Simulate a scenario");
    run->add_option("scenario", options.input, "SCENARIO.toml")->required();
    add_common(*run, options);
    run->add_option("--runs", options.runs, "Number of runs, each with its own seed")
        ->check(CLI::Range(1, 1000000));
    return run;
}

CLI::App *add_replay(CLI::App &app, sim::Options &options)
{
    CLI::App *replay = app.add_subcommand("replay", "Replay a recorded log");
    replay->add_option("log", options.input, "The log")->required();
    add_common(*replay, options);
    static std::string format = "csv";
    replay->add_option("--format", format, "Format of the log")->check(CLI::IsMember({"csv"}));
    replay->add_option("--map", options.map, "MAP.toml, the columns of a foreign CSV");
    CLI::Option *attack =
        replay->add_option("--attack", options.attack, "ATTACK.toml or attacks.json to inject");
    replay->add_option("--attack-id", options.attack_id, "Only that attack of the file")
        ->needs(attack);
    return replay;
}

} // namespace

int main(int argc, char **argv)
{
    CLI::App        app("Bulwark's estimators on simulated and recorded measurements.", "blw_sim");
    sim::Options    options;
    const CLI::App *run = add_run(app, options);
    add_replay(app, options);
    return sim::run_program(app, argc, argv, [&] {
        return run->parsed() ? sim::run_command(options) : sim::replay_command(options);
    });
}
