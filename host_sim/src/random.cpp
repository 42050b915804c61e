/* SPDX-License-Identifier: MIT */
#include "random.h"
#include "constants.h"
#include <cmath>

namespace sim
{
namespace
{

/* Share of a variance below which what is left of it is rounding. */
const double NO_NOISE = 1e-13;

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

/* Cholesky; a pivot that is zero but for rounding is a direction without noise. */
Eigen::MatrixXd covariance_root(const Eigen::MatrixXd &covariance)
{
    const Eigen::Index n    = covariance.rows();
    Eigen::MatrixXd    root = Eigen::MatrixXd::Zero(n, n);
    for (Eigen::Index j = 0; j < n; j++) {
        const double pivot = covariance(j, j) - root.row(j).head(j).squaredNorm();
        if (!(pivot > NO_NOISE * covariance(j, j))) {
            continue;
        }
        root(j, j) = std::sqrt(pivot);
        for (Eigen::Index i = j + 1; i < n; i++) {
            const double rest = covariance(i, j) - root.row(i).head(j).dot(root.row(j).head(j));
            root(i, j)        = rest / root(j, j);
        }
    }
    return root;
}

} // namespace sim
