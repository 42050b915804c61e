/* SPDX-License-Identifier: MIT */
#include "comparison.h"
#include "error.h"
#include <set>

namespace sim
{
namespace
{

const double FORGETTING = 0.98; /* lambda of [33] */

Eigen::Index sensor_of(const Design &design, const Json &name)
{
    const std::string where = design.path + ": methods.joint.info.pairs";
    return static_cast<Eigen::Index>(design.sensor_index(name.get<std::string>(), where));
}

} // namespace

Comparison::Comparison(const Design &design, Kind kind) : design_(&design), kind_(kind)
{
    design.method("joint");
    const auto n           = static_cast<Eigen::Index>(design.n);
    A_                     = Eigen::MatrixXd::Identity(n + 1, n + 1);
    A_.topLeftCorner(n, n) = design.A;
    W_                     = Eigen::MatrixXd::Zero(n + 1, n + 1);
    W_.topLeftCorner(n, n) = design.B * design.Q * design.B.transpose();
    C_                     = Eigen::MatrixXd::Zero(design.C.rows(), n + 1);
    C_.leftCols(n)         = design.C;
    R_                     = design.R;
    try {
        const Json &info = design.root.at("methods").at("joint").at("info");
        if ((kind == Kind::strong_kalman) || (kind == Kind::central_kalman)) {
            listen_to_all_pairs(info);
        } else {
            listen_to_first_pair(info);
        }
    } catch (const Json::exception &) {
        throw InputError(design.path + ": methods.joint.info names no pairs or no eta");
    }
    reset();
}

void Comparison::listen_to_first_pair(const Json &info)
{
    const auto  n    = static_cast<Eigen::Index>(design_->n);
    const Json &pair = info.at("pairs").at(0);
    sensors_         = {sensor_of(*design_, pair.at(0))};
    for (const Json &name : pair.at(1)) {
        sensors_.push_back(sensor_of(*design_, name));
    }
    eta_                    = info.at("eta").at(0).get<double>();
    W_(n, n)                = (kind_ == Kind::augmented) ? 2.0 * eta_ : 0.0;
    C_(sensors_.front(), n) = 1.0;
}

void Comparison::listen_to_all_pairs(const Json &info)
{
    std::set<Eigen::Index> found;
    for (std::size_t i = 0U; i < info.at("pairs").size(); i++) {
        const Json        &pair = info.at("pairs").at(i);
        const Eigen::Index weak = sensor_of(*design_, pair.at(0));
        if (kind_ == Kind::central_kalman) {
            found.insert(weak);
            R_(weak, weak) += info.at("eta").at(i).get<double>();
        }
        for (const Json &name : pair.at(1)) {
            found.insert(sensor_of(*design_, name));
        }
    }
    sensors_.assign(found.begin(), found.end());
}

const char *Comparison::name() const
{
    switch (kind_) {
    case Kind::augmented:
        return "augmented";
    case Kind::augmented_blind:
        return "augmented_blind";
    case Kind::adaptive:
        return "adaptive";
    case Kind::strong_kalman:
        return "strong_kalman";
    case Kind::central_kalman:
        break;
    }
    return "central_kalman";
}

void Comparison::reset()
{
    const auto n           = static_cast<Eigen::Index>(design_->n);
    X_                     = Eigen::VectorXd::Zero(n + 1);
    X_.head(n)             = design_->x0;
    P_                     = Eigen::MatrixXd::Zero(n + 1, n + 1);
    P_.topLeftCorner(n, n) = design_->initial_covariance();
    P_(n, n)               = eta_;
    phi_                   = 0.0;
    phi_var_               = 2.0 * eta_;
    Upsilon_               = Eigen::VectorXd::Zero(n + 1);
}

void Comparison::predict(const Eigen::VectorXd &u)
{
    const auto n = static_cast<Eigen::Index>(design_->n);
    X_           = (A_ * X_).eval();
    X_.head(n) += design_->Bu * u;
    X_[n] += phi_;
    P_           = (A_ * P_ * A_.transpose() + W_).eval();
    Upsilon_bar_ = A_ * Upsilon_;
    Upsilon_bar_[n] += 1.0;
    Upsilon_ = Upsilon_bar_;
}

void Comparison::step(const Eigen::VectorXd &u, const Eigen::VectorXd &y, blw_mask_t used)
{
    std::vector<Eigen::Index> rows;
    for (const Eigen::Index sensor : sensors_) {
        if (((used >> sensor) & 1U) != 0U) {
            rows.push_back(sensor);
        }
    }
    predict(u);
    if (!rows.empty()) {
        correct(y, rows);
    }
}

void Comparison::correct(const Eigen::VectorXd &y, const std::vector<Eigen::Index> &rows)
{
    const Eigen::MatrixXd C = C_(rows, Eigen::all);
    const Eigen::MatrixXd R = R_(rows, rows);
    const Eigen::VectorXd e = y(rows) - design_->offset(rows) - C * X_;
    const Eigen::MatrixXd S = C * P_ * C.transpose() + R;
    const Eigen::MatrixXd K = S.llt().solve(C * P_).transpose();
    const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(P_.rows(), P_.cols()) - K * C;
    P_                      = (I * P_ * I.transpose() + K * R * K.transpose()).eval();
    X_ += K * e;
    if (kind_ == Kind::adaptive) {
        adapt(e, C, K, S);
    }
}

void Comparison::adapt(const Eigen::VectorXd &e, const Eigen::MatrixXd &C, const Eigen::MatrixXd &K,
                       const Eigen::MatrixXd &S)
{
    const Eigen::VectorXd Omega  = C * Upsilon_bar_;
    const Eigen::MatrixXd Lambda = FORGETTING * S + phi_var_ * Omega * Omega.transpose();
    const Eigen::VectorXd weight = Lambda.llt().solve(Omega);
    const double          change = phi_var_ * weight.dot(e);
    phi_var_                     = phi_var_ * (1.0 - phi_var_ * weight.dot(Omega)) / FORGETTING;
    Upsilon_                     = Upsilon_bar_ - K * Omega;
    X_ += Upsilon_ * change;
    phi_ += change;
}

Eigen::VectorXd Comparison::x_hat() const
{
    return X_.head(static_cast<Eigen::Index>(design_->n));
}

} // namespace sim
