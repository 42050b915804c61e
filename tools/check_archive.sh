#!/bin/sh
# SPDX-License-Identifier: MIT
# Fail unless a static library holds no writable data and needs nothing from outside but the few
# functions named below.
#
# usage: check_archive.sh ARCHIVE [TOOL_PREFIX]      e.g. check_archive.sh libblw.a arm-none-eabi-
set -eu

if [ $# -lt 1 ] || [ $# -gt 2 ]; then
    echo "usage: check_archive.sh ARCHIVE [TOOL_PREFIX]" >&2
    exit 2
fi
archive=$1
prefix=${2:-}
if [ ! -r "$archive" ]; then
    echo "check_archive: $archive: cannot be read" >&2
    exit 2
fi

# sqrt where it is no instruction; mem... because a compiler may make them of any loop or
# assignment; the compiler's own run-time arithmetic on targets without an FPU; and the library
# itself, for an archive that builds upon it.
run_time='__aeabi_[a-z0-9_]+|__[a-z]+[sd]i?f?[0-9]?'
allowed="^(sqrtf?|memcpy|memmove|memset|_GLOBAL_OFFSET_TABLE_|blw_[a-z0-9_]+|$run_time)\$"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# .data.rel.ro is constant: the linker fills in addresses, and places it in flash on a target.
"${prefix}size" -A "$archive" >"$work/sections"
writable=$(awk '$1 ~ /^\.(data|bss|sdata|sbss|tdata|tbss)/ && $1 !~ /^\.data\.rel\.ro/ && $2 > 0 {
                    print "  " $1 " " $2 " bytes" }' "$work/sections")
"${prefix}nm" "$archive" >"$work/symbols"
common=$(awk 'NF == 3 && $2 == "C" { print "  " $3 " (common)" }' "$work/symbols")

awk 'NF == 3 && $2 ~ /[A-TV-Z]/ { print $3 }' "$work/symbols" | sort -u >"$work/defined"
awk 'NF == 2 && $1 ~ /[Uw]/ { print $2 }' "$work/symbols" | sort -u >"$work/needed"
foreign=$(comm -13 "$work/defined" "$work/needed" | grep -Ev "$allowed" | sed 's/^/  /' || true)

status=0
if [ -n "$writable$common" ]; then
    printf 'check_archive: %s: writable data\n%s%s\n' "$archive" "$writable" "$common" >&2
    status=1
fi
if [ -n "$foreign" ]; then
    printf 'check_archive: %s: foreign symbols\n%s\n' "$archive" "$foreign" >&2
    status=1
fi
exit $status
