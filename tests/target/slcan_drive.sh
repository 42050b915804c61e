#!/bin/sh
# SPDX-License-Identifier: MIT
# Inside user-mode Linux: the serial line /dev/ttyS0 as a CAN interface, and the driver on it.
#
# usage: slcan_drive.sh PYTHON STEPS ANSWERS
set -eu

stty -F /dev/ttyS0 raw -echo
slcand -o -s6 ttyS0 slcan0
until ip link show slcan0 >/dev/null 2>&1; do sleep 0.1; done
ip link set slcan0 txqueuelen 1000 up # a step is sent at once
exec "$1" -m blw.pil_drive can:slcan0 "$2" "$3"
