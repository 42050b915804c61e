/* SPDX-License-Identifier: MIT */
/** @file blw_cold.h  Private: a mark for functions that run once, or only pass a call on.
 *
 *  BLW_COLD has them built for size, and not copied into their callers, at whatever level of
 *  optimisation the user's build has: checks and init would otherwise be the larger half of the
 *  flash.  What it marks computes the same, so a compiler that does not know it loses nothing else.
 */
#ifndef BLW_COLD_H
#define BLW_COLD_H

#ifdef __GNUC__
#define BLW_COLD __attribute__((cold))
#else
#define BLW_COLD
#endif

#endif
