/* SPDX-License-Identifier: MIT */
#include "design.h"
#include "error.h"
#include "text.h"
#include <algorithm>

namespace sim
{
namespace
{

std::size_t index_of(const std::vector<std::string> &names, const std::string &name,
                     const char *what, const std::string &where)
{
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end()) {
        throw InputError(where + ": no " + what + " \"" + name + "\"; the model has "
                         + (names.empty() ? "none" : join(names, ", ")));
    }
    return static_cast<std::size_t>(found - names.begin());
}

std::vector<std::string> names_of(const JsonNode &model, const char *key, std::size_t count)
{
    const JsonNode                 node  = model.member(key);
    const std::vector<std::string> names = node.texts();
    if (names.size() != count) {
        node.fail("expected " + std::to_string(count) + " names");
    }
    return names;
}

void read_names(const JsonNode &model, Design &design)
{
    design.n = model.member("n").integer(UINT8_MAX);
    design.m = model.member("m").integer(BLW_MAX_SENSORS);
    design.l = model.member("l").integer(UINT8_MAX);
    design.p = model.member("p").integer(BLW_MAX_SENSORS);
    if ((design.n == 0U) || (design.m == 0U)) {
        model.fail("n and m must be at least 1");
    }
    design.dt_s = model.member("dt_s").number();
    if (!(design.dt_s > 0.0)) {
        model.member("dt_s").fail("must be positive");
    }
    design.states  = names_of(model, "states", design.n);
    design.sensors = names_of(model, "sensors", design.m);
    design.inputs  = names_of(model, "inputs", design.l);
}

void read_matrices(const JsonNode &model, Design &design)
{
    const std::size_t n  = design.n;
    const std::size_t m  = design.m;
    design.A             = model.member("A").matrix(n, n);
    design.Bu            = model.member("Bu").matrix(n, design.l);
    design.C             = model.member("C").matrix(m, n);
    design.R             = model.member("R").matrix(m, m);
    const JsonNode noise = model.member("Q");
    design.Q             = noise.matrix(noise.value().size(), noise.value().size());
    design.B             = model.member("B").matrix(n, noise.value().size());
    design.x0            = model.member("x0").vector(n);
    design.offset        = model.member("offset").vector(m);
    if (model.has("P0")) {
        design.P0 = model.member("P0").matrix(n, n);
    }
}

Eigen::MatrixXd read_gain(const Design &design)
{
    const auto            n     = static_cast<Eigen::Index>(design.n);
    const auto            m     = static_cast<Eigen::Index>(design.m);
    const JsonNode        node  = design.method("kalman").member("tables").member("K");
    const Eigen::VectorXd table = node.vector(design.n * design.m);
    return table.reshaped<Eigen::RowMajor>(n, m);
}

} // namespace

std::size_t Design::sensor_index(const std::string &sensor, const std::string &where) const
{
    return index_of(sensors, sensor, "sensor", where);
}

std::size_t Design::input_index(const std::string &input, const std::string &where) const
{
    return index_of(inputs, input, "input", where);
}

JsonNode Design::method(const std::string &method) const
{
    const JsonNode all = JsonNode(root, path).member("methods");
    if (!all.has(method.c_str())) {
        throw InputError(path + ": has no method \"" + method + "\", only "
                         + join(methods(), ", "));
    }
    return all.member(method.c_str());
}

std::vector<std::string> Design::methods() const
{
    std::vector<std::string> names;
    for (const auto &item : root.at("methods").items()) {
        names.push_back(item.key());
    }
    return names;
}

Design load_design(const std::string &path)
{
    Design design;
    design.path = path;
    design.root = read_json(path);
    const JsonNode top(design.root, path);
    if (!design.root.is_object() || (design.root.value("format", Json()) != "bulwark-design-1")) {
        throw InputError(path + ": not a design (format \"bulwark-design-1\")");
    }
    design.name         = top.member("name").text();
    design.model_sha256 = top.member("model_sha256").text();
    if (!top.member("methods").value().is_object()) {
        top.member("methods").fail("expected an object");
    }
    const JsonNode model = top.member("model");
    read_names(model, design);
    read_matrices(model, design);
    design.y_min = top.member("plant").member("y_min").vector(design.m);
    design.y_max = top.member("plant").member("y_max").vector(design.m);
    design.K     = read_gain(design);
    design.P     = design.method("kalman").member("info").member("P").matrix(design.n, design.n);
    return design;
}

blw_mask_t usable(const Design &design, const Eigen::VectorXd &y, blw_mask_t valid)
{
    blw_mask_t mask = 0U;
    for (Eigen::Index i = 0; i < y.size(); i++) {
        const blw_mask_t bit = static_cast<blw_mask_t>(1) << i;
        if (((valid & bit) != 0U) && (y[i] >= design.y_min[i]) && (y[i] <= design.y_max[i])) {
            mask |= bit;
        }
    }
    return mask;
}

} // namespace sim
