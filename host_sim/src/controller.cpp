/* SPDX-License-Identifier: MIT */
#include "controller.h"
#include "constants.h"
#include "error.h"
#include <cmath>

namespace sim
{
namespace
{

Wave::Shape parse_shape(const TomlTable &table)
{
    const std::string name = table.text("shape").value_or("constant");
    if (name == "constant") {
        return Wave::Shape::constant;
    }
    if (name == "sine") {
        return Wave::Shape::sine;
    }
    if (name == "pulse") {
        return Wave::Shape::pulse;
    }
    table.fail("shape", "expected \"constant\", \"sine\" or \"pulse\"");
}

/* A key that does nothing is a mistake: the input would not be the one that was meant. */
void check_meaning(const TomlTable &table, Wave::Shape shape)
{
    if (table.has("period_s") && (shape == Wave::Shape::constant)) {
        table.fail("period_s", "has a meaning for shape sine, pulse only");
    }
    if (table.has("width_s") && (shape != Wave::Shape::pulse)) {
        table.fail("width_s", "has a meaning for shape pulse only");
    }
    if (table.has("phase_rad") && (shape != Wave::Shape::sine)) {
        table.fail("phase_rad", "has a meaning for shape sine only");
    }
}

Wave parse_wave(const TomlTable &table, const Design &design)
{
    Wave wave;
    if (!table.has("input") || !table.has("value")) {
        table.fail(table.has("input") ? "value" : "input", "missing");
    }
    wave.shape     = parse_shape(table);
    wave.input     = design.input_index(*table.text("input"), table.where("input"));
    wave.value     = *table.number("value");
    wave.period_s  = table.number("period_s").value_or(0.0);
    wave.width_s   = table.number("width_s").value_or(0.0);
    wave.phase_rad = table.number("phase_rad").value_or(0.0);
    if ((wave.shape != Wave::Shape::constant) && !(wave.period_s > 0.0)) {
        table.fail("period_s", "must be given and positive");
    }
    if ((wave.shape == Wave::Shape::pulse) && !(wave.width_s > 0.0)) {
        table.fail("width_s", "must be given and positive");
    }
    check_meaning(table, wave.shape);
    return wave;
}

void parse_feedback(const TomlTable &table, const Design &design, ControllerSpec &spec)
{
    spec.feedback  = true;
    spec.method    = table.text("method").value_or("truth");
    spec.gain      = table.matrix("gain", design.l, design.n);
    spec.reference = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(design.n));
    if (const std::optional<std::vector<double>> reference = table.numbers("reference")) {
        if (reference->size() != design.n) {
            table.fail("reference", "expected " + std::to_string(design.n) + " numbers");
        }
        spec.reference = Eigen::Map<const Eigen::VectorXd>(reference->data(),
                                                           static_cast<Eigen::Index>(design.n));
    }
}

double level(const Wave &wave, const Design &design, double t_s)
{
    const double slack = 1e-6 * design.dt_s; /* t = k dt is rounded */
    switch (wave.shape) {
    case Wave::Shape::sine:
        return wave.value * std::sin(TWO_PI * t_s / wave.period_s + wave.phase_rad);
    case Wave::Shape::pulse:
        return (std::fmod(t_s + slack, wave.period_s) < wave.width_s) ? wave.value : 0.0;
    case Wave::Shape::constant:
        break;
    }
    return wave.value;
}

} // namespace

ControllerSpec parse_controller(const TomlTable &controller, const Design &design)
{
    ControllerSpec    spec;
    const std::string kind = controller.text("kind").value_or("none");
    if ((kind != "none") && (kind != "wave") && (kind != "feedback")) {
        controller.fail("kind", "expected \"feedback\", \"wave\" or \"none\"");
    }
    if (kind == "feedback") {
        parse_feedback(controller, design, spec);
    } else {
        for (const char *key : {"method", "gain", "reference"}) {
            if (controller.has(key)) {
                controller.fail(key, "has a meaning for kind \"feedback\" only");
            }
        }
    }
    for (const toml::table *item : controller.tables("wave")) {
        const TomlTable table(*item, controller.path(),
                              {"input", "shape", "value", "period_s", "width_s", "phase_rad"});
        spec.waves.push_back(parse_wave(table, design));
    }
    if ((kind == "none") != (!spec.feedback && spec.waves.empty())) {
        controller.fail("kind", "does not agree with the waves under [[controller.wave]]");
    }
    return spec;
}

Eigen::VectorXd control(const ControllerSpec &spec, const Design &design, double t_s,
                        const Eigen::VectorXd &x_hat)
{
    Eigen::VectorXd u = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(design.l));
    if (spec.feedback) {
        u = spec.gain * (spec.reference - x_hat);
    }
    for (const Wave &wave : spec.waves) {
        u[static_cast<Eigen::Index>(wave.input)] += level(wave, design, t_s);
    }
    return u;
}

} // namespace sim
