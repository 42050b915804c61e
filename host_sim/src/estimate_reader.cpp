/* SPDX-License-Identifier: MIT */
#include "estimate_reader.h"

namespace sim
{

EstimateReader::EstimateReader(const Eigen::VectorXd &x0)
    : pending_(static_cast<std::size_t>(x0.size())), x_hat_(x0)
{
}

bool EstimateReader::take(const blw_frame_t &frame)
{
    blw_wire_values_t values;
    blw_wire_status_t status;
    if ((blw_wire_kind(&frame) == BLW_WIRE_ESTIMATE)
        && (blw_wire_get_values(&frame, &values) == BLW_WIRE_OK)) {
        for (std::size_t j = 0U; j < values.count; j++) {
            const std::size_t at = values.first + j;
            if (at < pending_.size()) {
                pending_[at] = values.value[j];
            }
        }
        return false;
    }
    if ((blw_wire_get_status(&frame, &status) != BLW_WIRE_OK)
        || (status.estimate != blw_wire_sum_values(0U, pending_.data(), pending_.size()))) {
        return false;
    }
    status_ = status;
    for (std::size_t j = 0U; j < pending_.size(); j++) {
        x_hat_[static_cast<Eigen::Index>(j)] = static_cast<double>(pending_[j]);
    }
    return true;
}

} // namespace sim
