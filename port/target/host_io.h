/* SPDX-License-Identifier: MIT */
/** @file host_io.h  Files, console and exit of a test program: on a target by semihosting through
 *  the debugger or QEMU, on a host by its C library.  Not for firmware in the field.
 *
 *  A target's program starts with main(argument count and vector as ever); it ends when main
 *  returns.
 */
#ifndef HOST_IO_H
#define HOST_IO_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum host_io_mode { HOST_IO_READ, HOST_IO_WRITE } host_io_mode_t;

/** @return a handle, or negative if the file cannot be opened. */
int32_t host_io_open(const char *path, host_io_mode_t mode);
/** Read len bytes, or what is left of the file.  @return the number of bytes read. */
size_t host_io_read(int32_t file, void *to, size_t len);
/** @return false if not all of it could be written. */
bool host_io_write(int32_t file, const void *from, size_t len);
void host_io_close(int32_t file);
/** One character to the console; shown at the end of a line. */
void host_io_putc(int character);

#endif
