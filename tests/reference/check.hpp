// SPDX-License-Identifier: MIT
// The least that a reference test needs: count failures, name them, go on.
#ifndef CHECK_HPP
#define CHECK_HPP
#include <cmath>
#include <cstdio>

namespace check
{

inline int failures = 0;

inline void that(bool ok, const char *what, const char *file, int line)
{
    if (!ok) {
        ++failures;
        std::fprintf(stderr, "%s:%d: not so: %s\n", file, line, what);
    }
}

inline void near(double expected, double actual, double tolerance, const char *what,
                 const char *file, int line)
{
    if (!(std::abs(expected - actual) <= tolerance)) {
        ++failures;
        std::fprintf(stderr, "%s:%d: %s is %.17g, expected %.17g to %.3g\n", file, line, what,
                     actual, expected, tolerance);
    }
}

} // namespace check

#define CHECK(condition) check::that((condition), #condition, __FILE__, __LINE__)
#define CHECK_NEAR(expected, actual, tolerance) \
    check::near((expected), (actual), (tolerance), #actual, __FILE__, __LINE__)

#endif
