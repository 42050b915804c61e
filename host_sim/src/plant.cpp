/* SPDX-License-Identifier: MIT */
#include "plant.h"

namespace sim
{
namespace
{

/* Streams of random numbers; those of the attacks begin at 100. */
const std::uint64_t INITIAL_STREAM = 0U;
const std::uint64_t PROCESS_STREAM = 1U;
const std::uint64_t SENSOR_STREAM  = 2U;

} // namespace

TruePlant::TruePlant(const Design &design, const Eigen::VectorXd &mean,
                     const Eigen::MatrixXd &covariance, std::uint64_t seed)
    : design_(&design), initial_noise_(seed, INITIAL_STREAM), process_noise_(seed, PROCESS_STREAM),
      sensor_noise_(seed, SENSOR_STREAM), B_root_Q_(design.B * covariance_root(design.Q)),
      root_R_(covariance_root(design.R)),
      x_(mean + covariance_root(covariance) * initial_noise_.normal_vector(mean.size()))
{
}

void TruePlant::step(const Eigen::VectorXd &u)
{
    const Eigen::VectorXd w = process_noise_.normal_vector(B_root_Q_.cols());
    x_                      = design_->A * x_ + design_->Bu * u + B_root_Q_ * w;
}

Samples TruePlant::measure()
{
    const Eigen::VectorXd v = sensor_noise_.normal_vector(root_R_.cols());
    return {design_->C * x_ + design_->offset + root_R_ * v, BLW_MASK_ALL(design_->m)};
}

} // namespace sim
