/* SPDX-License-Identifier: MIT */
/** @file blw_cold.h  Private: marks for what the compiler cannot know of a function.
 *
 *  BLW_COLD has them built for size, and not copied into their callers, at whatever level of
 *  optimisation the user's build has: checks and init would otherwise be the larger half of the
 *  flash.  It is for what runs once, or only passes a call on.
 *
 *  BLW_APART keeps a function out of its caller, whose frame lies on the stack while deeper
 *  functions run: what one part of a step needs for itself is then not there during the others.
 *
 *  BLW_AT_ONCE is 0 in a build for size, where loops that take several elements or rows at once to
 *  save work do without them.  The order of every sum is the same, and so are its bits.
 *
 *  What they mark computes the same, so a compiler that does not know them loses nothing else.
 */
#ifndef BLW_COLD_H
#define BLW_COLD_H

#ifdef __GNUC__
#define BLW_COLD  __attribute__((cold))
#define BLW_APART __attribute__((noinline))
#else
#define BLW_COLD
#define BLW_APART
#endif

#ifdef __OPTIMIZE_SIZE__
#define BLW_AT_ONCE 0
#else
#define BLW_AT_ONCE 1
#endif

#endif
