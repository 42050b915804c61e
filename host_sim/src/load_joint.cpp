/* SPDX-License-Identifier: MIT */
#include "blw/blw_joint.h"
#include "error.h"
#include "methods.h"
#include <algorithm>

namespace sim
{
namespace
{

class JointTables final : public MethodTables
{
public:
    blw_joint_schedule_t  schedule{};
    blw_joint_recursive_t recursive{};
    blw_joint_model_t     model{};
    blw_model_t          &head() override
    {
        return model.head;
    }
    std::vector<std::string> extra_columns(const Design &design) const override;
    void extra_values(const blw_estimator_t &state, std::vector<double> &values) const override;

private:
    std::size_t weak(std::size_t i) const
    {
        return model.sensor[model.first[i]];
    }
};

/* What each weak sensor was found to add, and how sure that is. */
std::vector<std::string> JointTables::extra_columns(const Design &design) const
{
    std::vector<std::string> names;
    for (const char *prefix : {"theta:", "theta_sd:"}) {
        for (std::size_t i = 0U; i < model.r; i++) {
            names.push_back(prefix + design.sensors[weak(i)]);
        }
    }
    return names;
}

void JointTables::extra_values(const blw_estimator_t &state, std::vector<double> &values) const
{
    const std::size_t r = model.r;
    values.resize(2U * r);
    for (std::size_t i = 0U; i < r; i++) {
        blw_joint_attack_t attack{};
        blw_joint_get_attack(reinterpret_cast<const blw_joint_t *>(&state), weak(i), &attack);
        values[i]     = static_cast<double>(attack.theta);
        values[r + i] = static_cast<double>(attack.sd);
    }
}

void load_sensors(TableReader &tables, const blw_plant_t &plant, blw_joint_model_t &model)
{
    model.r             = tables.integer<std::uint8_t>("r");
    model.warm_up       = tables.integer<std::uint16_t>("warm_up");
    const std::size_t r = model.r;
    model.first         = tables.indices("first", r + 1U);
    if (!std::is_sorted(model.first, model.first + r + 1U)) {
        throw InputError("joint: tables.first must grow");
    }
    model.sensor = tables.indices("sensor", model.first[r]);
    model.strong = tables.indices("strong", plant.m);
    model.scale  = tables.reals("scale", r);
}

void load_schedule(TableReader tables, const blw_plant_t &plant, const blw_joint_model_t &model,
                   blw_joint_schedule_t &schedule)
{
    schedule.steps          = tables.integer<std::uint16_t>("steps");
    const std::size_t n     = plant.n;
    const std::size_t r     = model.r;
    const std::size_t steps = schedule.steps;
    schedule.K              = tables.reals("K", steps * (n + 2U) * model.first[r]);
    schedule.G              = tables.reals("G", steps * (r - 1U) * n * n);
    schedule.sd             = tables.reals("sd", steps * r);
    schedule.sd_gap         = tables.reals("sd_gap", r);
}

void load_recursive(TableReader tables, const blw_plant_t &plant, std::size_t r,
                    blw_joint_recursive_t &recursive)
{
    const std::size_t n = plant.n;
    const std::size_t m = plant.m;
    recursive.V         = tables.reals("V", n * n);
    recursive.E         = tables.reals("E", (m * (m + 1U)) / 2U);
    recursive.L0        = tables.reals("L0", (n * (n + 1U)) / 2U);
    recursive.theta_sd  = tables.reals("theta_sd", r);
}

} // namespace

std::unique_ptr<MethodTables> load_joint(TableReader &tables, const blw_plant_t &plant)
{
    auto               loaded = std::make_unique<JointTables>();
    blw_joint_model_t &model  = loaded->model;
    load_sensors(tables, plant, model);
    if (model.r == 0U) {
        throw InputError("joint: tables.r must be at least 1");
    }
    if (tables.has("schedule")) {
        load_schedule(tables.nested("schedule"), plant, model, loaded->schedule);
        model.schedule = &loaded->schedule;
    } else {
        load_recursive(tables.nested("recursive"), plant, model.r, loaded->recursive);
        model.recursive = &loaded->recursive;
    }
    return loaded;
}

} // namespace sim
