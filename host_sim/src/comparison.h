/* SPDX-License-Identifier: MIT */
/** @file comparison.h  The filters that [J] compares `joint` with, for figures only.
 *
 *  Three use the sensors of joint's first pair and the state X = [x; theta], theta the signal on
 *  the weak sensor, phi(k) = theta(k) - theta(k-1):
 *    augmented        Kalman filter with phi as white noise of the variance 2 eta (Remark 3)
 *    augmented_blind  the same with the variance 0: nothing is known about the attack
 *    adaptive         phi as an unknown constant: Q. Zhang, "Adaptive Kalman filter for actuator
 *                     fault diagnosis", Automatica 93, 2018, (5), reference [33] of [J]
 *  Two estimate no attack:
 *    strong_kalman    Kalman filter on the strong sensors of all pairs alone
 *    central_kalman   Kalman filter on the sensors of all pairs, eta added to the noise of the weak
 */
#ifndef BLW_SIM_COMPARISON_H
#define BLW_SIM_COMPARISON_H
#include "design.h"
#include <Eigen/Dense>
#include <string>
#include <vector>

namespace sim
{

class Comparison
{
public:
    enum class Kind { augmented, augmented_blind, adaptive, strong_kalman, central_kalman };

    /** @param design outlives this; InputError if it has no method joint */
    Comparison(const Design &design, Kind kind);

    const char *name() const;
    /** Back to x0. */
    void reset();
    /** One step with u(k-1) [l], y(k) [m] and the samples that can be used. */
    void step(const Eigen::VectorXd &u, const Eigen::VectorXd &y, blw_mask_t used);
    /** [n] */
    Eigen::VectorXd x_hat() const;

private:
    /* Sensors and noise of the filters that estimate an attack, and of those that do not. */
    void listen_to_first_pair(const Json &info);
    void listen_to_all_pairs(const Json &info);
    void predict(const Eigen::VectorXd &u);
    void correct(const Eigen::VectorXd &y, const std::vector<Eigen::Index> &rows);
    /* What an adaptive filter adds; K of the Kalman part, S its innovation's covariance. */
    void adapt(const Eigen::VectorXd &e, const Eigen::MatrixXd &C, const Eigen::MatrixXd &K,
               const Eigen::MatrixXd &S);

    const Design             *design_;
    Kind                      kind_;
    std::vector<Eigen::Index> sensors_;   /* those that it uses */
    double                    eta_ = 0.0; /* variance of theta(0); 0 if it stays 0 */
    Eigen::MatrixXd           A_, W_, C_; /* of the augmented system; C_ [m x (n + 1)] */
    Eigen::MatrixXd           R_;         /* [m x m] */
    Eigen::VectorXd           X_;
    Eigen::MatrixXd           P_;
    double                    phi_     = 0.0;
    double                    phi_var_ = 0.0; /* S of [33]: scales the gain of phi */
    Eigen::VectorXd           Upsilon_;       /* how X depends on phi */
    Eigen::VectorXd           Upsilon_bar_;   /* the same for the prediction */
};

} // namespace sim
#endif
