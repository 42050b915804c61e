/* SPDX-License-Identifier: MIT */
/** @file blw_real.h  The one floating-point type of the library, and what may be assumed of it.
 *
 *  float unless BLW_REAL_DOUBLE is defined (the CMake option BLW_DOUBLE does it for the library and
 *  for everything that links it).  All code is written for round-to-nearest IEEE 754 arithmetic
 *  without contraction, so that every target computes the same bits; fast-math breaks that and the
 *  tests for NaN, so it is refused here.
 *
 *  BLW_SIGNAL_MAX is the largest magnitude of a sample, an input or a state that a step works with.
 *  Its square, and sums of squares after gains far above 1, are still finite; what is larger is
 *  treated like an infinity, so that no data overflow into a state.  BLW_REAL_ABS is that of math.h.
 */
#ifndef BLW_REAL_H
#define BLW_REAL_H
#include <float.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __FAST_MATH__
#error "Bulwark needs IEEE arithmetic: compile without -ffast-math"
#endif

#ifdef BLW_REAL_DOUBLE
typedef double blw_real_t;
#define BLW_R(literal) literal
#define BLW_REAL_MAX   DBL_MAX
#define BLW_REAL_EPS   DBL_EPSILON
#define BLW_REAL_ABS   fabs
#define BLW_SIGNAL_MAX 1e150
#else
typedef float blw_real_t;
#define BLW_R(literal) literal##F
#define BLW_REAL_MAX   FLT_MAX
#define BLW_REAL_EPS   FLT_EPSILON
#define BLW_REAL_ABS   fabsf
#define BLW_SIGNAL_MAX 1e15F
#endif

#endif
