/* SPDX-License-Identifier: MIT */
/** @file start.h  What the start-up code calls once memory and FPU are ready: with semihosting
 *  (semihosting.c) for a program that is run for a host, without (standalone.c) for a firmware.
 */
#ifndef START_H
#define START_H

/** Call main() and see to what it returns. */
void start_main(void) __attribute__((noreturn));
/** After a fault: end with this status, if there is somebody to tell. */
void start_end(int status) __attribute__((noreturn));

#endif
