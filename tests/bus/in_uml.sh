#!/bin/sh
# SPDX-License-Identifier: MIT
# Run a command on a kernel with SocketCAN: user-mode Linux on this machine's file system, with the
# interfaces vcan0 and vcan1 (CAN FD), in the present directory and with this environment.
# Exit status: the command's; 77 = such a kernel cannot be had here; 125 = it did not come up.
#
# usage: in_uml.sh [-t SECONDS] [-k KERNEL_ARGUMENT]... -- COMMAND [ARGUMENT]...
set -eu

timeout=300
work=$(mktemp -d "${TMPDIR:-/tmp}/in_uml.XXXXXX")
trap 'rm -rf "$work"' EXIT
: >"$work/kernel_arguments"
while [ "${1:-}" != -- ]; do
    case ${1:-} in
        -t) timeout=$2 ;;
        -k) printf '%s\n' "$2" >>"$work/kernel_arguments" ;;
        *)
            echo "usage: in_uml.sh [-t SECONDS] [-k KERNEL_ARGUMENT]... -- COMMAND [ARGUMENT]..." >&2
            exit 2
            ;;
    esac
    shift 2
done
shift

for program in linux busybox ip cc; do
    command -v "$program" >/dev/null || {
        echo "in_uml: $program is not installed (Debian: user-mode-linux busybox iproute2 gcc)" >&2
        exit 77
    }
done

# quote WORD...: as one line that a shell reads as the same words
quote()
{
    for word in "$@"; do
        printf "'%s' " "$(printf %s "$word" | sed "s/'/'\\\\''/g")"
    done
}

export -p >"$work/environment"
quote "$@" >"$work/command"
cat >"$work/init" <<END
#!/bin/sh
. $work/environment
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t tmpfs run /run
mkdir -p /dev/shm
mount -t tmpfs shm /dev/shm
ln -sf /proc/self/fd /dev/fd
modules=/usr/lib/uml/modules/\$(uname -r)/kernel
for module in net/can/can net/can/can-raw net/can/can-gw drivers/net/can/dev/can-dev \\
    drivers/net/can/vcan drivers/net/can/slcan/slcan; do
    busybox insmod "\$modules/\$module.ko" || echo "in_uml: no module \$module" >&2
done
echo 8388608 >/proc/sys/net/core/rmem_max
echo 100000 >/proc/sys/net/core/netdev_max_backlog
ip link set lo up
for i in 0 1; do
    ip link add vcan\$i type vcan && ip link set vcan\$i mtu 72 up
done
cd '$PWD'
$(cat "$work/command") >$work/out 2>&1
echo \$? >$work/status
sync
busybox poweroff -f
END
chmod +x "$work/init"

set -- mem=512M rootfstype=hostfs rootflags=/ rw "init=$work/init" con=null con0=null,fd:1 quiet \
    "umid=${work##*/}"
while read -r argument; do
    set -- "$@" "$argument"
done <"$work/kernel_arguments"
cc -shared -fPIC -O1 -o "$work/xstate.so" "$(dirname "$0")/uml_xstate.c" -ldl
timeout -k 5 "$timeout" env LD_PRELOAD="$work/xstate.so" linux "$@" >"$work/console" 2>&1 </dev/null || true
[ ! -f "$work/out" ] || cat "$work/out"
if [ ! -f "$work/status" ]; then
    echo "in_uml: the kernel did not run the command within $timeout s:" >&2
    tail -n 20 "$work/console" >&2
    exit 125
fi
exit "$(cat "$work/status")"
