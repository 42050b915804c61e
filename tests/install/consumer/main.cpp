// SPDX-License-Identifier: MIT
// The same program as C++: the headers' linkage, constants and inline functions hold there too.
#include "main.c"
