/* SPDX-License-Identifier: MIT */
/* blw_bus: plant, node and attacker on a bus. */
#include "bus.h"
#include "program.h"
#include <csignal>
#include <iostream>

namespace sim
{

std::atomic<bool> bus_interrupted{false};

void say_listening(const char *who, const std::string &where)
{
    std::cout << "blw_bus " << who << ": listening on " << where << std::endl;
}

} // namespace sim

namespace
{

void interrupt(int /*signal*/)
{
    sim::bus_interrupted = true;
}

void add_common(CLI::App &command, sim::BusOptions &options)
{
    command.add_option("--design", options.run.design, "NAME.json of tools/bulwark design")
        ->required();
    command
        .add_option("--link", options.link, "can:IF, canfd:IF, slcan:PLACE, lcm:URL, replay:FILE")
        ->required();
    command.add_option("--seed", options.run.seed, "Seed of the random numbers")
        ->check(CLI::NonNegativeNumber);
    command.add_option("--idle-s", options.idle_s, "Give up after so long a silence; 0: never")
        ->capture_default_str();
}

void add_results(CLI::App &command, sim::BusOptions &options)
{
    command.add_option("--out", options.run.out, "Folder for the results")->required();
    command.add_flag("--json", options.run.json, "Print the figures as JSON");
}

CLI::App *add_plant(CLI::App &app, sim::BusOptions &options)
{
    CLI::App *plant = app.add_subcommand("plant", "Simulate the plant and its sensors");
    plant->add_option("scenario", options.run.input, "SCENARIO.toml")->required();
    add_common(*plant, options);
    add_results(*plant, options);
    plant->add_option("--pace-us", options.pace_us, "Time between steps; 0: wait for the answer");
    plant->add_option("--patience-ms", options.patience_ms, "For an answer")->capture_default_str();
    return plant;
}

CLI::App *add_node(CLI::App &app, sim::BusOptions &options)
{
    CLI::App *node = app.add_subcommand("node", "Estimate from what is heard on the bus");
    add_common(*node, options);
    add_results(*node, options);
    node->add_option("--method", options.run.methods, "Methods beside kalman; all = every one")
        ->delimiter(',')
        ->default_val(std::vector<std::string>{"all"});
    node->add_option("--speaker", options.speaker, "Method that sends; the last if not given");
    node->add_flag("--mute", options.mute, "Send nothing");
    node->add_option("--period-us", options.period_us, "Own clock; 0: only syncs begin steps");
    node->add_option("--deadline-us", options.deadline_us,
                     "From the sync to the step at the latest")
        ->capture_default_str();
    node->add_option("--settle-us", options.settle_us, "Wait for contradictions");
    node->add_option("--quarantine", options.quarantine, "Steps a contradicting sensor is rejected")
        ->capture_default_str();
    node->add_option("--max-gap", options.max_gap, "Steps made up for blindly")
        ->capture_default_str();
    node->add_flag("--fusion", options.fusion, "Take the sensors' local states for samples");
    node->add_option("--sensor", options.sensor, "Run the local filter of this sensor, no more")
        ->excludes("--fusion");
    CLI::Option *scenario =
        node->add_option("--scenario", options.run.input, "Score against this scenario, and");
    node->add_option("--log", options.log, "the plant's log.csv of the same run")->needs(scenario);
    return node;
}

CLI::App *add_attack(CLI::App &app, sim::BusOptions &options)
{
    CLI::App *attack = app.add_subcommand("attack", "Attack the measurements on the bus");
    attack->add_option("scenario", options.run.input, "SCENARIO.toml with the attacks")->required();
    add_common(*attack, options);
    attack->add_option("--sensor-link", options.sensor_link,
                       "The plant's side, to be a gateway; without it, an intruder");
    attack->add_option("--fault", options.fault,
                       "Disturb instead: babble, crc, stale, early, duplicate, sync, garbage");
    return attack;
}

} // namespace

int main(int argc, char **argv)
{
    std::signal(SIGINT, interrupt);
    std::signal(SIGTERM, interrupt);
    CLI::App        app("Bulwark's plant, nodes and attacker on a bus.", "blw_bus");
    sim::BusOptions options;
    const CLI::App *plant = add_plant(app, options);
    const CLI::App *node  = add_node(app, options);
    add_attack(app, options);
    return sim::run_program(app, argc, argv, [&] {
        if (plant->parsed()) {
            return sim::plant_command(options);
        }
        return node->parsed() ? sim::node_command(options) : sim::attack_command(options);
    });
}
