/* SPDX-License-Identifier: MIT */
/** @file estimate_reader.h  Estimates as they come over a bus: frames, then a status that seals
 *  them.
 */
#ifndef BLW_SIM_ESTIMATE_READER_H
#define BLW_SIM_ESTIMATE_READER_H
#include "blw/blw_wire.h"
#include <Eigen/Core>
#include <vector>

namespace sim
{

class EstimateReader
{
public:
    explicit EstimateReader(const Eigen::VectorXd &x0);
    /** @return whether the frame was the status of an estimate that is complete. */
    bool take(const blw_frame_t &frame);
    /** Of the last complete estimate. */
    const blw_wire_status_t &status() const
    {
        return status_;
    }
    /** The last complete estimate [n], x0 before the first. */
    const Eigen::VectorXd &x_hat() const
    {
        return x_hat_;
    }

private:
    std::vector<float> pending_;
    blw_wire_status_t  status_{};
    Eigen::VectorXd    x_hat_;
};

} // namespace sim
#endif
