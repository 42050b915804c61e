/* SPDX-License-Identifier: MIT */
/** @file design.h  NAME.json as the design tool writes it: the model, and the methods' tables. */
#ifndef BLW_SIM_DESIGN_H
#define BLW_SIM_DESIGN_H
#include "blw/blw_model.h"
#include "json_read.h"
#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

namespace sim
{

/** The model in double, and the raw tables.  x(k+1) = A x + Bu u + B w, y = C x + offset + v. */
struct Design {
    std::string                    path;
    std::string                    name;
    std::string                    model_sha256;
    Json                           root; /* the whole file */
    std::size_t                    n    = 0U;
    std::size_t                    m    = 0U;
    std::size_t                    l    = 0U;
    std::size_t                    p    = 0U;
    double                         dt_s = 0.0;
    std::vector<std::string>       states;
    std::vector<std::string>       sensors;
    std::vector<std::string>       inputs;
    Eigen::MatrixXd                A, Bu, B, C, Q, R;
    Eigen::VectorXd                x0, offset;
    Eigen::VectorXd                y_min, y_max; /* a sample outside is missing */
    Eigen::MatrixXd                K;            /* steady-state Kalman gain */
    Eigen::MatrixXd                P;            /* steady-state covariance after the measurement */
    std::optional<Eigen::MatrixXd> P0;           /* covariance of x(0), where the model gives one */

    /** Covariance of the initial error: P0, else P. */
    const Eigen::MatrixXd &initial_covariance() const
    {
        return P0 ? *P0 : P;
    }
    /** InputError "where: no sensor "name"; the model has ..." */
    std::size_t sensor_index(const std::string &sensor, const std::string &where) const;
    std::size_t input_index(const std::string &input, const std::string &where) const;
    /** methods.<method>; InputError if it was not designed. */
    JsonNode method(const std::string &method) const;
    /** Names under methods, in the order of the file. */
    std::vector<std::string> methods() const;
};

/** Read and check NAME.json; InputError names the file and the member. */
Design load_design(const std::string &path);

/** Samples of the set that are finite and inside their range. */
blw_mask_t usable(const Design &design, const Eigen::VectorXd &y, blw_mask_t valid);

} // namespace sim
#endif
