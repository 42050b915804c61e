#!/bin/sh
# SPDX-License-Identifier: MIT
# Run a bare-metal program in QEMU; its semihosting console is our standard output, its exit status ours.
# BLW_QEMU_OPTIONS: further options, e.g. "-icount shift=7" for exact instruction counts.
#
# usage: qemu.sh QEMU MACHINE PROGRAM [ARGUMENT...]
set -eu

if [ $# -lt 3 ]; then
    echo "usage: qemu.sh QEMU MACHINE PROGRAM [ARGUMENT...]" >&2
    exit 2
fi
qemu=$1
machine=$2
program=$3
shift 3
semihosting=enable=on,target=native,chardev=console,arg=$(basename "$program")
for argument in "$@"; do
    semihosting=$semihosting,arg=$argument
done
set -- -machine "$machine" -kernel "$program" -display none -monitor none -serial null \
    -chardev stdio,id=console -semihosting-config "$semihosting"
case $machine in virt*) set -- "$@" -bios none ;; esac
# shellcheck disable=SC2086 # a list of options
exec "$qemu" "$@" ${BLW_QEMU_OPTIONS-} </dev/null
