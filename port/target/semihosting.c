/* SPDX-License-Identifier: MIT */
#include "semihosting.h"
#include "host_io.h"
#include "start.h"

enum {
    SYS_OPEN          = 0x01,
    SYS_CLOSE         = 0x02,
    SYS_WRITE0        = 0x04,
    SYS_WRITE         = 0x05,
    SYS_READ          = 0x06,
    SYS_GET_CMDLINE   = 0x15,
    SYS_EXIT_EXTENDED = 0x20
};

#define OPEN_RB            1
#define OPEN_WB            5
#define APPLICATION_EXIT   0x20026
#define MAX_ARGUMENTS      8
#define MAX_COMMAND_LENGTH 512U

int main(int argc, char **argv);

static char   line[128];
static size_t line_len;

static size_t length(const char *text)
{
    size_t len = 0U;

    while (text[len] != '\0') {
        len++;
    }
    return len;
}

int32_t host_io_open(const char *path, host_io_mode_t mode)
{
    const intptr_t parameters[3] = {(intptr_t)path, (mode == HOST_IO_READ) ? OPEN_RB : OPEN_WB,
                                    (intptr_t)length(path)};

    return (int32_t)semihosting_call(SYS_OPEN, parameters);
}

size_t host_io_read(int32_t file, void *to, size_t len)
{
    const intptr_t parameters[3] = {file, (intptr_t)to, (intptr_t)len};
    const size_t   left          = (size_t)semihosting_call(SYS_READ, parameters);

    return (left > len) ? 0U : len - left;
}

bool host_io_write(int32_t file, const void *from, size_t len)
{
    const intptr_t parameters[3] = {file, (intptr_t)from, (intptr_t)len};

    return semihosting_call(SYS_WRITE, parameters) == 0;
}

void host_io_close(int32_t file)
{
    const intptr_t parameters[1] = {file};

    (void)semihosting_call(SYS_CLOSE, parameters);
}

void host_io_putc(int character)
{
    line[line_len] = (char)character;
    line_len++;
    if ((character == '\n') || (line_len == sizeof line - 1U)) {
        line[line_len] = '\0';
        (void)semihosting_call(SYS_WRITE0, line);
        line_len = 0U;
    }
}

void start_end(int status)
{
    const intptr_t parameters[2] = {APPLICATION_EXIT, status};

    for (;;) {
        (void)semihosting_call(SYS_EXIT_EXTENDED, parameters);
    }
}

/* Cut the command line at its blanks. */
static int split(char *command, char **argv)
{
    int  argc     = 0;
    bool in_blank = true;

    for (char *at = command; *at != '\0'; at++) {
        const bool blank = (*at == ' ');

        if (blank) {
            *at = '\0';
        } else if (in_blank && (argc < MAX_ARGUMENTS)) {
            argv[argc] = at;
            argc++;
        }
        in_blank = blank;
    }
    return argc;
}

void start_main(void)
{
    static char    command[MAX_COMMAND_LENGTH];
    static char   *argv[MAX_ARGUMENTS];
    const intptr_t parameters[2] = {(intptr_t)command, (intptr_t)sizeof command};
    const intptr_t failed        = semihosting_call(SYS_GET_CMDLINE, parameters);

    start_end(main((failed == 0) ? split(command, argv) : 0, argv));
}
