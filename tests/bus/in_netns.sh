#!/bin/sh
# SPDX-License-Identifier: MIT
# Run a command in a network of its own, where multicast stays on the loopback interface: LCM's
# messages then never leave this machine, nor do others' come in.
# Exit status: the command's; 77 = such a network cannot be had here.
#
# usage: in_netns.sh COMMAND [ARGUMENT]...
set -eu

if [ "$(id -u)" -eq 0 ]; then
    own='unshare --net'
else
    own='unshare --net --user --map-root-user'
fi
set_up='ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo'
# shellcheck disable=SC2086 # a command and its options
$own sh -c "$set_up" 2>/dev/null || {
    echo "in_netns: the kernel gives no network namespace with multicast" >&2
    exit 77
}
# shellcheck disable=SC2086
exec $own sh -c "$set_up"' && exec "$@"' in_netns "$@"
