/* SPDX-License-Identifier: MIT */
/** @file oracle.h  The Kalman filter that knows which samples are attacked: the yardstick.
 *
 *  Time-varying, in double, Joseph form.  Of every step it takes the usable samples alone, with the
 *  submatrices of C and R that belong to them, so a correlated R needs no special care.
 */
#ifndef BLW_SIM_ORACLE_H
#define BLW_SIM_ORACLE_H
#include "design.h"

namespace sim
{

class Oracle
{
public:
    /** Starts from x0 with the design's initial covariance.  @param design outlives the oracle */
    explicit Oracle(const Design &design);

    /** From k-1 to k with u(k-1) [l] and those samples of y(k) [m] that are in `used`. */
    void step(const Eigen::VectorXd &u, const Eigen::VectorXd &y, blw_mask_t used);

    const Eigen::VectorXd &x_hat() const
    {
        return x_hat_;
    }

private:
    void update(const Eigen::VectorXd &y, const std::vector<Eigen::Index> &rows);

    const Design   *design_;
    Eigen::MatrixXd W_; /* B Q B' */
    Eigen::VectorXd x_hat_;
    Eigen::MatrixXd P_;
};

} // namespace sim
#endif
