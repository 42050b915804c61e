/* SPDX-License-Identifier: MIT */
/* Loaded before user-mode Linux (LD_PRELOAD) on processors with AVX-512 or AMX.  It saves and
 * restores floating-point registers in a buffer for AVX; present kernels refuse to restore less
 * than all there is.  So what it restores is completed by what the process has. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <elf.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/uio.h>

#define ALL_STATE 16384U /* more than AMX needs */

typedef long (*ptrace_t)(enum __ptrace_request request, ...);

static long restore(ptrace_t real, void *pid, void *set, struct iovec *part)
{
    static char  all[ALL_STATE] __attribute__((aligned(64)));
    struct iovec whole = {all, sizeof all};

    if (real(PTRACE_GETREGSET, pid, set, &whole) < 0) {
        return -1;
    }
    if (part->iov_len < whole.iov_len) {
        (void)memcpy(all, part->iov_base, part->iov_len);
        part = &whole;
    }
    return real(PTRACE_SETREGSET, pid, set, part);
}

long ptrace(enum __ptrace_request request, ...)
{
    const ptrace_t real = (ptrace_t)(uintptr_t)dlsym(RTLD_NEXT, "ptrace");
    va_list        arguments;

    va_start(arguments, request);
    void *const pid  = va_arg(arguments, void *);
    void *const set  = va_arg(arguments, void *);
    void *const data = va_arg(arguments, void *);
    va_end(arguments);
    if ((request == PTRACE_SETREGSET) && ((uintptr_t)set == NT_X86_XSTATE)) {
        return restore(real, pid, set, data);
    }
    return real(request, pid, set, data);
}
