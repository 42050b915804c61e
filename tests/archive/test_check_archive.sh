#!/bin/sh
# SPDX-License-Identifier: MIT
# check_archive.sh lets a clean archive pass and names what is wrong with the others.
# usage: test_check_archive.sh CC CHECK_ARCHIVE
set -eu
cc=$1
check=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# judge SOURCE: check an archive of this source; $status, and the messages in $work/message
judge()
{
    rm -f "$work/case.a"
    printf '%s\n' "$1" >"$work/case.c"
    "$cc" -std=c99 -c "$work/case.c" -o "$work/case.o"
    ar rcs "$work/case.a" "$work/case.o"
    status=0
    "$check" "$work/case.a" 2>"$work/message" || status=$?
}

# fail WHAT SOURCE
fail()
{
    echo "$1: $2" >&2
    cat "$work/message" >&2
    exit 1
}

expect_clean()
{
    judge "$1"
    if [ "$status" -ne 0 ] || [ -s "$work/message" ]; then
        fail "refused" "$1"
    fi
}

# expect_refused PATTERN SOURCE
expect_refused()
{
    judge "$2"
    if [ "$status" -ne 1 ] || ! grep -q "$1" "$work/message"; then
        fail "status $status, or no '$1' in the message" "$2"
    fi
}

expect_clean 'static const int t[2] = {1, 2}; int f(int i); int f(int i) { return t[i]; }'
expect_clean 'double sqrt(double x); double f(double x); double f(double x) { return sqrt(x); }'
expect_clean 'int f(void); int (*const t)(void) = f; int f(void) { return 0; }'
expect_refused '\.bss' 'static int n; int f(void); int f(void) { return ++n; }'
expect_refused '\.data' 'int n = 3;'
expect_refused 'common' '__attribute__((common)) int n;'
expect_refused 'free' 'void free(void *p); void f(void *p); void f(void *p) { free(p); }'
