/* SPDX-License-Identifier: MIT */
/* Start-up of a RISC-V machine: registers, FPU, memory, then main() by way of start_main(). */
#define FAULT_STATUS 99
#define MSTATUS_FS_INITIAL 0x2000

    .option arch, +zicsr

    .section .text.start, "ax"
    .globl start_reset
start_reset:
    .option push
    .option norelax
    la gp, __global_pointer$
    .option pop
    la sp, blw_stack_top
    la t0, start_fault
    csrw mtvec, t0
#ifdef __riscv_flen
    li t0, MSTATUS_FS_INITIAL
    csrs mstatus, t0
    csrw fcsr, zero
#endif
    la a0, blw_bss_start
    la a2, blw_bss_end
    sub a2, a2, a0
    li a1, 0
    call memset
    call start_main

    .balign 4
start_fault:
    li a0, FAULT_STATUS
    call start_end

/* These three instructions in this order, uncompressed and in one page, are a semihosting call. */
    .section .text.semihosting_call, "ax"
    .balign 16
    .option push
    .option norvc
    .globl semihosting_call
    .type semihosting_call, @function
semihosting_call:
    slli zero, zero, 0x1f
    ebreak
    srai zero, zero, 7
    ret
    .option pop
