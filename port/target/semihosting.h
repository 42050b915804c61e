/* SPDX-License-Identifier: MIT */
/** @file semihosting.h  Arm semihosting, which RISC-V has taken over: operations that a debugger or
 *  QEMU carries out for the program ("Semihosting for AArch32 and AArch64", 2.0).
 */
#ifndef SEMIHOSTING_H
#define SEMIHOSTING_H
#include <stdint.h>

/** One operation; provided by the start-up code of the architecture.
 *  @param parameters of the operation: an address in all that are used here. */
intptr_t semihosting_call(intptr_t operation, const void *parameters);
/** End the program with this status. */
void semihosting_exit(int status) __attribute__((noreturn));
/** Call main() with the words of the command line, and end the program with what it returns. */
void semihosting_main(void) __attribute__((noreturn));

#endif
