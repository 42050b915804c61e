/* SPDX-License-Identifier: MIT */
#include "attack_parse.h"
#include "error.h"
#include "text.h"
#include <algorithm>

namespace sim
{
namespace
{

struct KindName {
    const char *name;
    AttackKind  kind;
};

const std::vector<KindName> KINDS = {
    {"bias", AttackKind::bias},       {"scale", AttackKind::scale},
    {"ramp", AttackKind::ramp},       {"sine", AttackKind::sine},
    {"pulse", AttackKind::pulse},     {"white", AttackKind::white},
    {"uniform", AttackKind::uniform}, {"zero", AttackKind::zero},
    {"stuck", AttackKind::stuck},     {"sign_flip", AttackKind::sign_flip},
    {"replay", AttackKind::replay},   {"delay", AttackKind::delay},
    {"drop", AttackKind::drop},       {"ghost", AttackKind::ghost},
    {"noise", AttackKind::white},     {"innovation_aligned", AttackKind::innovation_aligned},
    {"freeze", AttackKind::stuck},
};

AttackKind find_kind(const std::string &name, const std::string &where)
{
    std::vector<std::string> known;
    for (const KindName &entry : KINDS) {
        if (name == entry.name) {
            return entry.kind;
        }
        known.emplace_back(entry.name);
    }
    throw InputError(where + ": unknown kind \"" + name + "\"; known are " + join(known, ", "));
}

bool needs_value(AttackKind kind)
{
    const AttackKind without[] = {AttackKind::zero, AttackKind::stuck, AttackKind::sign_flip,
                                  AttackKind::drop, AttackKind::ghost};
    return std::find(std::begin(without), std::end(without), kind) == std::end(without);
}

void set_sensors(AttackSpec &spec, const std::vector<std::string> &names, const Design &design,
                 const std::string &where)
{
    for (const std::string &name : names) {
        const std::size_t sensor = design.sensor_index(name, where);
        if (std::find(spec.sensors.begin(), spec.sensors.end(), sensor) != spec.sensors.end()) {
            throw InputError(where + ": sensor \"" + name + "\" is named twice");
        }
        spec.sensors.push_back(sensor);
    }
    if (spec.sensors.empty()) {
        throw InputError(where + ": names no sensor");
    }
}

/* One number stands for all sensors. */
void set_value(AttackSpec &spec, const std::vector<double> &value, const std::string &where)
{
    spec.value = value;
    if (value.size() == 1U) {
        spec.value.assign(spec.sensors.size(), value.front());
    }
    if (spec.value.size() != spec.sensors.size()) {
        throw InputError(where + ": value: expected one number, or one per sensor");
    }
    const bool in_the_past = (spec.kind == AttackKind::replay) || (spec.kind == AttackKind::delay);
    if (in_the_past && (*std::min_element(spec.value.begin(), spec.value.end()) <= 0.0)) {
        throw InputError(where + ": value: seconds back must be positive");
    }
}

/* A key that does nothing is a mistake: the attack would not be the one that was meant. */
void check_meaning(const TomlTable &table, AttackKind kind)
{
    const struct {
        const char             *key;
        std::vector<AttackKind> kinds;
    } uses[] = {
        {"probability", {AttackKind::drop}},
        {"state", {AttackKind::ghost}},
        {"period_s", {AttackKind::sine, AttackKind::pulse}},
        {"width_s", {AttackKind::pulse}},
        {"phase_rad", {AttackKind::sine}},
    };
    for (const auto &use : uses) {
        if (table.has(use.key)
            && (std::find(use.kinds.begin(), use.kinds.end(), kind) == use.kinds.end())) {
            std::vector<std::string> names;
            for (const AttackKind known : use.kinds) {
                names.emplace_back(kind_name(known));
            }
            table.fail(use.key, "has a meaning for kind " + join(names, ", ") + " only");
        }
    }
}

void check_waves(const AttackSpec &spec, const std::string &where)
{
    const bool repeats = (spec.kind == AttackKind::sine) || (spec.kind == AttackKind::pulse);
    if (repeats && !(spec.period_s > 0.0)) {
        throw InputError(where + ": period_s: must be given and positive");
    }
    if ((spec.kind == AttackKind::pulse) && !(spec.width_s > 0.0)) {
        throw InputError(where + ": width_s: must be given and positive");
    }
}

void parse_window(const TomlTable &table, AttackSpec &spec)
{
    spec.from = table.integer("from").value_or(1U);
    spec.to   = table.integer("to");
    spec.t0_s = table.number("t0_s");
    spec.t1_s = table.number("t1_s");
    if ((table.has("from") || table.has("to")) && (table.has("t0_s") || table.has("t1_s"))) {
        table.fail("t0_s", "either steps (from, to) or seconds (t0_s, t1_s), not both");
    }
    if (spec.t1_s && !spec.t0_s) {
        table.fail("t1_s", "t0_s is missing");
    }
    if ((spec.to && (*spec.to <= spec.from)) || (spec.t1_s && !(*spec.t1_s > *spec.t0_s))) {
        table.fail(spec.to ? "to" : "t1_s", "the attack ends before it begins");
    }
}

void parse_sensors(const TomlTable &table, const Design &design, AttackSpec &spec)
{
    if (table.has("sensor") == table.has("sensors")) {
        table.fail("sensor", "expected either sensor or sensors");
    }
    const char *key = table.has("sensor") ? "sensor" : "sensors";
    set_sensors(spec,
                table.has("sensor") ? std::vector<std::string>{*table.text("sensor")}
                                    : *table.texts("sensors"),
                design, table.where(key));
}

void parse_value(const TomlTable &table, AttackSpec &spec)
{
    if (needs_value(spec.kind) != table.has("value")) {
        table.fail("value", table.has("value") ? "has no meaning for this kind" : "missing");
    }
    if (needs_value(spec.kind)) {
        set_value(spec, *table.numbers("value"), table.where("value"));
        return;
    }
    const double probability = table.number("probability").value_or(1.0);
    if (!(probability >= 0.0) || !(probability <= 1.0)) {
        table.fail("probability", "must be from 0 to 1");
    }
    spec.value.assign(spec.sensors.size(), probability);
}

void parse_state(const TomlTable &table, const Design &design, AttackSpec &spec)
{
    const std::optional<std::vector<double>> state = table.numbers("state");
    if ((spec.kind == AttackKind::ghost) != state.has_value()) {
        table.fail("state", "missing");
    }
    if (state && (state->size() != design.n)) {
        table.fail("state", "expected " + std::to_string(design.n) + " numbers");
    }
    if (state) {
        spec.state =
            Eigen::Map<const Eigen::VectorXd>(state->data(), static_cast<Eigen::Index>(design.n));
    }
}

AttackSpec parse_attack(const TomlTable &table, const Design &design)
{
    AttackSpec spec;
    if (!table.has("kind")) {
        table.fail("kind", "missing");
    }
    spec.id   = table.text("id").value_or("");
    spec.kind = find_kind(*table.text("kind"), table.where("kind"));
    check_meaning(table, spec.kind);
    spec.seed = table.integer("seed");
    parse_sensors(table, design, spec);
    parse_window(table, spec);
    parse_value(table, spec);
    parse_state(table, design, spec);
    spec.period_s  = table.number("period_s").value_or(0.0);
    spec.width_s   = table.number("width_s").value_or(0.0);
    spec.phase_rad = table.number("phase_rad").value_or(0.0);
    check_waves(spec, table.where("kind"));
    return spec;
}

std::vector<double> json_numbers(const JsonNode &node)
{
    if (!node.value().is_array()) {
        return {node.number()};
    }
    const Eigen::VectorXd list = node.vector(node.value().size());
    return std::vector<double>(list.begin(), list.end());
}

AttackSpec json_attack(const JsonNode &node, const Design &design)
{
    AttackSpec spec;
    spec.id   = node.member("id").text();
    spec.kind = find_kind(node.member("type").text(), node.where() + ".type");
    spec.t0_s = node.member("t0").number();
    spec.t1_s = node.member("t1").number();
    if (!(*spec.t1_s > *spec.t0_s)) {
        node.fail("the attack ends before it begins");
    }
    set_sensors(spec, node.member("sensors").texts(), design, node.where() + ".sensors");
    spec.value.assign(spec.sensors.size(), 1.0);
    if (needs_value(spec.kind)) {
        set_value(spec, json_numbers(node.member("value")), node.where());
    }
    if (spec.kind == AttackKind::ghost) {
        spec.state = node.member("state").vector(design.n);
    }
    if (node.has("period")) {
        spec.period_s = node.member("period").number();
        spec.width_s  = node.has("width") ? node.member("width").number() : 0.5 * spec.period_s;
    }
    if (node.has("seed")) {
        spec.seed = node.member("seed").integer(UINT64_MAX);
    }
    check_waves(spec, node.where());
    return spec;
}

/* Attacks on sensors that the model lacks do not hinder another one of the same file. */
std::vector<AttackSpec> json_attacks(const std::string &path, const std::string &id,
                                     const Design &design)
{
    const Json root = read_json(path);
    if (!root.is_array()) {
        throw InputError(path + ": expected a list of attacks");
    }
    std::vector<AttackSpec> specs;
    for (std::size_t i = 0U; i < root.size(); i++) {
        const JsonNode node(root[i], path + ": [" + std::to_string(i) + "]");
        if (id.empty() || (node.member("id").text() == id)) {
            specs.push_back(json_attack(node, design));
        }
    }
    return specs;
}

} // namespace

const char *kind_name(AttackKind kind)
{
    const auto found = std::find_if(KINDS.begin(), KINDS.end(),
                                    [kind](const KindName &entry) { return entry.kind == kind; });
    return found->name;
}

std::vector<AttackSpec> parse_attacks(const TomlTable &file, const Design &design)
{
    std::vector<AttackSpec> specs;
    for (const toml::table *item : file.tables("attack")) {
        const TomlTable table(*item, file.path(),
                              {"id", "sensor", "sensors", "kind", "from", "to", "t0_s", "t1_s",
                               "value", "probability", "state", "period_s", "width_s", "phase_rad",
                               "seed"});
        specs.push_back(parse_attack(table, design));
    }
    return specs;
}

std::vector<AttackSpec> read_attacks(const std::string &path, const std::string &id,
                                     const Design &design)
{
    const std::string       json = ".json";
    std::vector<AttackSpec> specs;
    if ((path.size() > json.size())
        && (path.compare(path.size() - json.size(), json.size(), json) == 0)) {
        specs = json_attacks(path, id, design);
    } else {
        const toml::table root = read_toml(path);
        specs                  = parse_attacks(TomlTable(root, path, {"attack"}), design);
        const auto other = [&id](const AttackSpec &spec) { return !id.empty() && (spec.id != id); };
        specs.erase(std::remove_if(specs.begin(), specs.end(), other), specs.end());
    }
    if (specs.empty()) {
        throw InputError(path + ": has no attack" + (id.empty() ? "" : " \"" + id + "\""));
    }
    return specs;
}

} // namespace sim
