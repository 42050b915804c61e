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

#endif
