/* SPDX-License-Identifier: MIT */
/** @file counter.h  A counter that advances with every executed instruction under QEMU's option
 *  -icount, at a rate that the caller knows; without that option it means nothing.
 */
#ifndef COUNTER_H
#define COUNTER_H
#include <stdint.h>

void counter_start(void);
/** Ticks so far, modulo 2^32. */
uint32_t counter_read(void);

#endif
