/* SPDX-License-Identifier: MIT */
/* Start-up of a Cortex-M: vector table, memory, FPU, then main() by way of start_main(). */
#include "start.h"
#include "semihosting.h"
#include <string.h>

#define CPACR (*(volatile uint32_t *)0xE000ED88U) /* coprocessor access control */

#define FAULT_STATUS 99

extern uint32_t blw_stack_top[];
extern uint32_t blw_data_image[];
extern uint32_t blw_data_start[];
extern uint32_t blw_data_end[];
extern uint32_t blw_bss_start[];
extern uint32_t blw_bss_end[];

void start_reset(void);
void start_fault(void);

/* Stack pointer, reset, then NMI and the faults; interrupts stay off. */
typedef struct start_vectors {
    uint32_t *stack;
    void (*handlers[15])(void);
} start_vectors_t;

__attribute__((section(".vectors"), used)) static const start_vectors_t vectors = {
    .stack    = blw_stack_top,
    .handlers = {start_reset, start_fault, start_fault, start_fault, start_fault, start_fault,
                 start_fault},
};

intptr_t semihosting_call(intptr_t operation, const void *parameters)
{
    register intptr_t    r0 __asm("r0") = operation;
    register const void *r1 __asm("r1") = parameters;

    __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void start_fault(void)
{
    start_end(FAULT_STATUS);
}

void start_reset(void)
{
#ifdef __ARM_FP
    CPACR |= 0xFU << 20; /* full access to the FPU */
    __asm volatile("dsb\n isb");
#endif
    (void)memcpy(blw_data_start, blw_data_image,
                 (size_t)((char *)blw_data_end - (char *)blw_data_start));
    (void)memset(blw_bss_start, 0, (size_t)((char *)blw_bss_end - (char *)blw_bss_start));
    start_main();
}
