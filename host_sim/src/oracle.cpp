/* SPDX-License-Identifier: MIT */
#include "oracle.h"
#include <Eigen/Cholesky>

namespace sim
{

Oracle::Oracle(const Design &design)
    : design_(&design), W_(design.B * design.Q * design.B.transpose()), x_hat_(design.x0),
      P_(design.initial_covariance())
{
}

void Oracle::step(const Eigen::VectorXd &u, const Eigen::VectorXd &y, blw_mask_t used)
{
    const Eigen::MatrixXd &A = design_->A;
    x_hat_                   = A * x_hat_ + design_->Bu * u;
    P_                       = A * P_ * A.transpose() + W_;

    std::vector<Eigen::Index> rows;
    for (Eigen::Index i = 0; i < y.size(); i++) {
        if (((used >> i) & 1U) != 0U) {
            rows.push_back(i);
        }
    }
    if (!rows.empty()) {
        update(y, rows);
    }
    P_ = (0.5 * (P_ + P_.transpose())).eval();
}

void Oracle::update(const Eigen::VectorXd &y, const std::vector<Eigen::Index> &rows)
{
    const Eigen::MatrixXd C  = design_->C(rows, Eigen::all);
    const Eigen::MatrixXd R  = design_->R(rows, rows);
    const Eigen::VectorXd z  = y(rows) - design_->offset(rows) - C * x_hat_;
    const Eigen::MatrixXd S  = C * P_ * C.transpose() + R;
    const Eigen::MatrixXd K  = S.llt().solve(C * P_).transpose();
    const Eigen::MatrixXd IK = Eigen::MatrixXd::Identity(P_.rows(), P_.cols()) - K * C;
    x_hat_ += K * z;
    P_ = (IK * P_ * IK.transpose() + K * R * K.transpose()).eval();
}

} // namespace sim
