/* SPDX-License-Identifier: MIT */
/** @file random.h  Random numbers that depend on the seed only, not on the C++ library.
 *
 *  std::mt19937_64 is fixed by the standard, its distributions are not; hence our own.  Every use
 *  has its own stream, so that an attack does not change the noise of the plant.
 */
#ifndef BLW_SIM_RANDOM_H
#define BLW_SIM_RANDOM_H
#include <Eigen/Core>
#include <cstdint>
#include <random>

namespace sim
{

class Random
{
public:
    /** Streams of the same seed are independent of each other. */
    Random(std::uint64_t seed, std::uint64_t stream);

    /** In [0, 1). */
    double uniform();
    /** N(0, 1), Box-Muller. */
    double normal();
    /** N(0, I) of that length. */
    Eigen::VectorXd normal_vector(Eigen::Index size);

private:
    std::mt19937_64 engine_;
    double          spare_     = 0.0;
    bool            has_spare_ = false;
};

/** The seed of run number `run` of a series: run 0 has the seed itself. */
std::uint64_t run_seed(std::uint64_t seed, std::uint64_t run);
/** L with L L' = covariance, which is symmetric and positive semidefinite. */
Eigen::MatrixXd covariance_root(const Eigen::MatrixXd &covariance);

} // namespace sim
#endif
