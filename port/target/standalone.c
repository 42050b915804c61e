/* SPDX-License-Identifier: MIT */
/* start.h for a firmware: nobody is told anything.  Where a watchdog runs, it resets the device. */
#include "start.h"

int main(void);

void start_main(void)
{
    (void)main();
    start_end(0);
}

void start_end(int status)
{
    (void)status;
    for (;;) {
    }
}
