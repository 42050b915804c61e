/* SPDX-License-Identifier: MIT */
/** @file methods.h  The library's estimators, made from a design.
 *
 *  A method is one line in the registry (methods.cpp) and one loader (load_<method>.cpp).
 */
#ifndef BLW_SIM_METHODS_H
#define BLW_SIM_METHODS_H
#include "blw/blw_estimator.h"
#include "design.h"
#include "tables.h"
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace sim
{

/** A C model with everything it points to except the plant. */
class MethodTables
{
public:
    virtual ~MethodTables() = default;
    /** First member of the model. */
    virtual blw_model_t &head() = 0;
    /** Columns that only this method has, after the standard ones of its trace. */
    virtual std::vector<std::string> extra_columns(const Design &design) const;
    /** What belongs in them after a step of the estimator. */
    virtual void extra_values(const blw_estimator_t &state, std::vector<double> &values) const;
};

/** Makes a method's C model from its tables; the head is filled in by the caller. */
using Loader = std::unique_ptr<MethodTables> (*)(TableReader &tables, const blw_plant_t &plant);

struct Method {
    const char                *name;
    blw_method_t               id;
    const blw_estimator_ops_t *ops;
    Loader                     load;
};

std::unique_ptr<MethodTables> load_bank(TableReader &tables, const blw_plant_t &plant);
std::unique_ptr<MethodTables> load_decentral(TableReader &tables, const blw_plant_t &plant);
std::unique_ptr<MethodTables> load_guard(TableReader &tables, const blw_plant_t &plant);
std::unique_ptr<MethodTables> load_joint(TableReader &tables, const blw_plant_t &plant);
std::unique_ptr<MethodTables> load_kalman(TableReader &tables, const blw_plant_t &plant);
std::unique_ptr<MethodTables> load_lasso(TableReader &tables, const blw_plant_t &plant);

/** The methods that this program knows. */
const std::vector<Method> &registry();
/** InputError if the name is not in the registry. */
const Method &find_method(const std::string &name);

/** The plant's tables; they outlive the estimators. */
struct Plant {
    blw_plant_t tables;
    TableStore  store;
};
std::unique_ptr<Plant> load_plant(const Design &design);

/** One estimator: model, state and memory. */
class Estimator
{
public:
    /** InputError if the design lacks the method or the library refuses its tables.
     *  @param ops instead of the method's own, on the same tables */
    Estimator(const Design &design, const Plant &plant, const std::string &name,
              const blw_estimator_ops_t *ops = nullptr);

    const std::string &name() const
    {
        return name_;
    }
    /** Columns of this method alone, and what the last step put into them. */
    const std::vector<std::string> &extra_columns() const
    {
        return extra_columns_;
    }
    std::vector<double> extra_values() const;
    void                reset();
    /** One step with u(k-1) [l], y(k) [m]; the result holds until the next call. */
    const blw_estimator_out_t &step(const Eigen::VectorXd &u, const Eigen::VectorXd &y,
                                    blw_mask_t valid);
    /** Its tables, the head of the method's model. */
    const blw_model_t &model() const
    {
        return tables_->head();
    }
    /** The estimator itself, for a node. */
    blw_estimator_t *handle()
    {
        return self();
    }

private:
    blw_estimator_t *self()
    {
        return reinterpret_cast<blw_estimator_t *>(state_.data());
    }
    const blw_estimator_t *self() const
    {
        return reinterpret_cast<const blw_estimator_t *>(state_.data());
    }

    std::string                   name_;
    TableStore                    store_;
    std::unique_ptr<MethodTables> tables_;
    std::vector<std::string>      extra_columns_;
    std::vector<std::max_align_t> state_;
    std::vector<blw_real_t>       memory_, u_, y_;
    blw_estimator_out_t           out_{};
};

} // namespace sim
#endif
