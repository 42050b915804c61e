/* SPDX-License-Identifier: MIT */
/* host_io.h on a host. */
#include "host_io.h"
#include <stdio.h>

enum { MAX_FILES = 4 };

static FILE *files[MAX_FILES];

int32_t host_io_open(const char *path, host_io_mode_t mode)
{
    for (int32_t i = 0; i < MAX_FILES; i++) {
        if (files[i] == NULL) {
            files[i] = fopen(path, (mode == HOST_IO_READ) ? "rb" : "wb");
            return (files[i] == NULL) ? -1 : i;
        }
    }
    return -1;
}

size_t host_io_read(int32_t file, void *to, size_t len)
{
    return fread(to, 1U, len, files[file]);
}

bool host_io_write(int32_t file, const void *from, size_t len)
{
    return fwrite(from, 1U, len, files[file]) == len;
}

void host_io_close(int32_t file)
{
    (void)fclose(files[file]);
    files[file] = NULL;
}

void host_io_putc(int character)
{
    (void)putchar(character);
}
