/* SPDX-License-Identifier: MIT */
/** @file plant.h  The simulated plant, in double:
 *      x(k+1) = A x(k) + Bu u(k) + B w(k),   y(k) = C x(k) + offset + v(k). */
#ifndef BLW_SIM_PLANT_H
#define BLW_SIM_PLANT_H
#include "attack.h"
#include "design.h"
#include "random.h"

namespace sim
{

class TruePlant
{
public:
    /** x(0) ~ N(mean, covariance).  @param design outlives the plant */
    TruePlant(const Design &design, const Eigen::VectorXd &mean, const Eigen::MatrixXd &covariance,
              std::uint64_t seed);

    /** Advance by one step with u [l]. */
    void step(const Eigen::VectorXd &u);
    /** y of the present state, with fresh noise; no sample is missing. */
    Samples                measure();
    const Eigen::VectorXd &x() const
    {
        return x_;
    }

private:
    const Design   *design_;
    Random          initial_noise_, process_noise_, sensor_noise_;
    Eigen::MatrixXd B_root_Q_, root_R_;
    Eigen::VectorXd x_;
};

} // namespace sim
#endif
