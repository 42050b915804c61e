/* SPDX-License-Identifier: MIT */
/* Where nothing counts instructions. */
#include "counter.h"

void counter_start(void) {}

uint32_t counter_read(void)
{
    return 0U;
}
