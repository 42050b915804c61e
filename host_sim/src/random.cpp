/* SPDX-License-Identifier: MIT */
#include "random.h"
#include <Eigen/Eigenvalues>
#include <cmath>

namespace sim
{
namespace
{

const double TWO_PI = 6.283185307179586476925286766559;

/* splitmix64 (Steele, Lea, Flood 2014): neighbouring seeds give unrelated states. */
std::uint64_t scramble(std::uint64_t value)
{
    value += 0x9E3779B97F4A7C15ULL;
    value = (value ^ (value >> 30U)) * 0xBF58476D1CE4E5B9ULL;
    value = (value ^ (value >> 27U)) * 0x94D049BB133111EBULL;
    return value ^ (value >> 31U);
}

} // namespace

Random::Random(std::uint64_t seed, std::uint64_t stream)
    : engine_(scramble(scramble(seed) ^ scramble(~stream)))
{
}

double Random::uniform()
{
    return static_cast<double>(engine_() >> 11U) * 0x1.0p-53;
}

double Random::normal()
{
    if (has_spare_) {
        has_spare_ = false;
        return spare_;
    }
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    const double angle  = TWO_PI * uniform();
    spare_              = radius * std::sin(angle);
    has_spare_          = true;
    return radius * std::cos(angle);
}

Eigen::VectorXd Random::normal_vector(Eigen::Index size)
{
    Eigen::VectorXd vector(size);
    for (double &value : vector) {
        value = normal();
    }
    return vector;
}

std::uint64_t run_seed(std::uint64_t seed, std::uint64_t run)
{
    return (run == 0U) ? seed : scramble(seed ^ scramble(run));
}

Eigen::MatrixXd covariance_root(const Eigen::MatrixXd &covariance)
{
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance);
    return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

} // namespace sim
