/* SPDX-License-Identifier: MIT */
#include "methods.h"
#include "blw/blw_bank.h"
#include "blw/blw_decentral.h"
#include "blw/blw_guard.h"
#include "blw/blw_joint.h"
#include "blw/blw_kalman.h"
#include "blw/blw_lasso.h"
#include "error.h"
#include "text.h"
#include <algorithm>

namespace sim
{
namespace
{

const char *reason(blw_status_t status)
{
    switch (status) {
    case BLW_OK:
        return "no error";
    case BLW_ERR_ARG:
        return "an argument is wrong";
    case BLW_ERR_MODEL:
        return "a table is missing, not finite or inconsistent";
    case BLW_ERR_MEM:
        return "too little memory";
    case BLW_ERR_INPUT:
        return "a known input is not finite";
    }
    return "unknown error";
}

} // namespace

std::vector<std::string> MethodTables::extra_columns(const Design & /*design*/) const
{
    return {};
}

void MethodTables::extra_values(const blw_estimator_t & /*state*/,
                                std::vector<double> & /*values*/) const
{
}

const std::vector<Method> &registry()
{
    static const std::vector<Method> methods = {
        {"kalman", BLW_METHOD_KALMAN, &blw_kalman_ops, load_kalman},
        {"lasso", BLW_METHOD_LASSO, &blw_lasso_ops, load_lasso},
        {"canonical", BLW_METHOD_CANONICAL, &blw_lasso_ops, load_lasso},
        {"decentral", BLW_METHOD_DECENTRAL, &blw_decentral_ops, load_decentral},
        {"bank", BLW_METHOD_BANK, &blw_bank_ops, load_bank},
        {"joint", BLW_METHOD_JOINT, &blw_joint_ops, load_joint},
        {"guard", BLW_METHOD_GUARD, &blw_guard_ops, load_guard},
    };
    return methods;
}

const Method &find_method(const std::string &name)
{
    std::vector<std::string> known;
    for (const Method &method : registry()) {
        if (name == method.name) {
            return method;
        }
        known.emplace_back(method.name);
    }
    throw InputError("unknown method \"" + name + "\"; known are " + join(known, ", "));
}

std::unique_ptr<Plant> load_plant(const Design &design)
{
    auto              plant = std::make_unique<Plant>();
    blw_table_check_t ignored;
    blw_table_begin(&ignored);
    TableReader  tables(JsonNode(design.root, design.path).member("plant"), plant->store, ignored);
    blw_plant_t &to = plant->tables;
    to.n            = static_cast<std::uint8_t>(design.n);
    to.m            = static_cast<std::uint8_t>(design.m);
    to.l            = static_cast<std::uint8_t>(design.l);
    to.p            = static_cast<std::uint8_t>(design.p);
    to.A            = tables.reals("A", design.n * design.n);
    to.Bu           = tables.reals("Bu", design.n * design.l);
    to.C            = tables.reals("C", design.m * design.n);
    to.offset       = tables.reals("offset", design.m);
    to.y_min        = tables.reals("y_min", design.m);
    to.y_max        = tables.reals("y_max", design.m);
    to.x0           = tables.reals("x0", design.n);
    return plant;
}

Estimator::Estimator(const Design &design, const Plant &plant, const std::string &name,
                     const blw_estimator_ops_t *ops)
    : name_(name), u_(design.l), y_(design.m)
{
    const Method                    &method = find_method(name);
    const blw_estimator_ops_t *const used   = (ops != nullptr) ? ops : method.ops;
    const JsonNode                   node   = design.method(name).member("tables");
    blw_table_check_t                walk;
    blw_model_t head = {BLW_MODEL_ABI, static_cast<std::uint8_t>(method.id), 0U, &plant.tables};
    if (blw_model_begin(&head, method.id, &walk) != BLW_OK) {
        throw InputError(design.path + ": plant: the library refuses the plant's tables");
    }
    TableReader reader(node, store_, walk);
    tables_         = method.load(reader, plant.tables);
    head.crc        = walk.crc;
    tables_->head() = head;
    memory_.resize(used->mem_len(&tables_->head()));
    const std::size_t unit = sizeof(std::max_align_t);
    state_.resize((used->state_size + unit - 1U) / unit);
    const blw_status_t status =
        blw_estimator_init(self(), used, &tables_->head(), memory_.data(), memory_.size());
    if (status != BLW_OK) {
        node.fail(std::string("the library refuses these tables: ") + reason(status));
    }
    extra_columns_ = tables_->extra_columns(design);
}

std::vector<double> Estimator::extra_values() const
{
    std::vector<double> values;
    tables_->extra_values(*self(), values);
    return values;
}

void Estimator::reset()
{
    blw_estimator_reset(self(), nullptr);
}

const blw_estimator_out_t &Estimator::step(const Eigen::VectorXd &u, const Eigen::VectorXd &y,
                                           blw_mask_t valid)
{
    std::transform(u.begin(), u.end(), u_.begin(), narrow);
    std::transform(y.begin(), y.end(), y_.begin(), narrow);
    const blw_real_t  *input  = u_.empty() ? nullptr : u_.data();
    const blw_status_t status = blw_estimator_step(self(), input, y_.data(), valid, &out_);
    if (status != BLW_OK) {
        throw InputError("method " + name_ + ": " + reason(status));
    }
    return out_;
}

} // namespace sim
