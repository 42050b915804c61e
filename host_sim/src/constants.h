/* SPDX-License-Identifier: MIT */
/** @file constants.h  Numbers that several parts need. */
#ifndef BLW_SIM_CONSTANTS_H
#define BLW_SIM_CONSTANTS_H
#include <limits>

namespace sim
{

inline constexpr double TWO_PI = 6.283185307179586476925286766559;
/** A value that the log does not have. */
inline constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();

} // namespace sim
#endif
