/* SPDX-License-Identifier: MIT */
#include "scenario.h"
#include "attack_parse.h"
#include "error.h"
#include "toml_read.h"
#include <algorithm>
#include <filesystem>

namespace sim
{
namespace
{

/* More would not fit into memory with any useful model. */
const std::uint64_t MAX_STEPS = 100000000U;

/* The design was made from a model of that name; a full check would need its hash. */
void check_model(const TomlTable &file, const Design &design)
{
    namespace fs = std::filesystem;
    if (!file.has("model")) {
        file.fail("model", "missing");
    }
    const std::string model = *file.text("model");
    const fs::path    path  = fs::path(file.path()).parent_path() / model;
    if (!fs::exists(path)) {
        file.fail("model", "no such file \"" + path.string() + "\"");
    }
    const toml::table root = read_toml(path.string());
    const std::string name = root["name"].value_or(std::string());
    if (name != design.name) {
        file.fail("model", "is \"" + name + "\", but " + design.path + " is the design of \""
                               + design.name + "\"");
    }
}

void parse_count(const TomlTable &file, const char *key, std::uint64_t &count)
{
    count = file.integer(key).value_or(count);
    if ((count < 1U) || (count > MAX_STEPS)) {
        file.fail(key, file.has(key) ? "must be from 1 to 100000000" : "missing");
    }
}

void parse_named_initial(const TomlTable &file, const Design &design, Scenario &scenario)
{
    const std::string name = *file.text("initial");
    if (name == "exact") {
        return;
    }
    if (name == "steady") {
        scenario.x0_covariance = design.P;
        return;
    }
    if (name != "P0") {
        file.fail("initial", "expected \"steady\", \"P0\", \"exact\" or a list of states");
    }
    if (!design.P0) {
        file.fail("initial", "the model has no P0");
    }
    scenario.x0_covariance = *design.P0;
}

void parse_initial(const TomlTable &file, const Design &design, Scenario &scenario)
{
    const auto n           = static_cast<Eigen::Index>(design.n);
    scenario.x0_mean       = design.x0;
    scenario.x0_covariance = Eigen::MatrixXd::Zero(n, n);
    if (!file.has("initial")) {
        scenario.x0_covariance = design.initial_covariance();
        return;
    }
    if (file.node("initial")->is_string()) {
        parse_named_initial(file, design, scenario);
        return;
    }
    const std::vector<double> states = *file.numbers("initial");
    if (states.size() != design.n) {
        file.fail("initial", "expected " + std::to_string(design.n) + " states");
    }
    scenario.x0_mean = Eigen::Map<const Eigen::VectorXd>(states.data(), n);
}

} // namespace

Scenario load_scenario(const std::string &path, const Design &design,
                       const std::optional<std::uint64_t> &seed)
{
    const toml::table root = read_toml(path);
    const TomlTable   file(
          root, path,
          {"model", "steps", "seed", "runs", "initial", "diverged_at", "controller", "attack"});
    check_model(file, design);
    Scenario scenario;
    scenario.path = path;
    parse_count(file, "steps", scenario.steps);
    parse_count(file, "runs", scenario.runs);
    scenario.seed        = seed.value_or(file.integer("seed").value_or(scenario.seed));
    scenario.diverged_at = file.number("diverged_at").value_or(scenario.diverged_at);
    if (!(scenario.diverged_at > 0.0)) {
        file.fail("diverged_at", "must be positive");
    }
    parse_initial(file, design, scenario);
    if (const toml::table *controller = file.table("controller"); controller != nullptr) {
        scenario.controller = parse_controller(
            TomlTable(*controller, path, {"kind", "method", "gain", "reference", "wave"}), design);
    }
    scenario.attacks = parse_attacks(file, design);
    return scenario;
}

} // namespace sim
