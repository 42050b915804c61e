# SPDX-License-Identifier: MIT
# shellcheck shell=sh disable=SC2154 # root and build are set by tools/bulwark
# What tools/bulwark installs, once: Debian packages, a virtual environment, Unity.
# Sourced with $root (the checkout) and $build (its build folder) set.  Every function is idempotent
# and silent if there is nothing to do; progress goes to standard error.

say() { echo "bulwark: $*" >&2; }

fail() {
    say "$*"
    exit 1
}

as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo "$@"
    else
        fail "installing packages needs root or sudo; as root: $*"
    fi
}

# packages_missing GROUP...: those packages of the groups that are not installed.
packages_missing() {
    wanted=$(for group in "$@"; do
        sed -n "s/^$group  *//p" "$root/tools/setup/packages"
    done)
    # shellcheck disable=SC2086 # a list of names
    installed=$(dpkg-query -W -f '${db:Status-Status} ${Package}\n' $wanted 2>/dev/null |
        sed -n 's/^installed //p')
    echo "$wanted" | grep -vxF -e "$installed" || :
}

# ensure_packages GROUP...: install what is missing in one go.  On other systems than Debian the
# user installs the same things; what is missing then shows up where it is used.
ensure_packages() {
    command -v dpkg-query >/dev/null && command -v apt-get >/dev/null || return 0
    missing=$(packages_missing "$@" | tr '\n' ' ')
    [ -n "$missing" ] || return 0
    say "installing Debian packages: $missing"
    as_root apt-get -qq update >&2 || fail "apt-get update failed"
    # shellcheck disable=SC2086 # a list of names
    as_root env DEBIAN_FRONTEND=noninteractive \
        apt-get -qq -y -o Dpkg::Use-Pty=0 install --no-install-recommends $missing \
        >"$build/apt.log" 2>&1 </dev/null || {
        tail -n 20 "$build/apt.log" >&2
        fail "apt-get install failed, see build/apt.log"
    }
}

# ensure_venv: build/venv as tools/requirements.lock has it.  The stamp is written last, so an
# interrupted set-up is made again, and so is one of another lock or Python.
ensure_venv() {
    python=/usr/bin/python3
    [ -x "$python" ] || python=$(command -v python3) || fail "python3 is not installed"
    want=$({ "$python" --version; echo "$root"; cat "$root/tools/requirements.lock"; } | sha256sum)
    [ "$(cat "$build/venv/.stamp" 2>/dev/null)" != "$want" ] || return 0
    say "making the virtual environment build/venv from tools/requirements.lock"
    rm -rf "$build/venv"
    "$python" -m venv "$build/venv" >&2 || fail "python3 -m venv failed"
    "$build/venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-input \
        --require-hashes --only-binary :all: -r "$root/tools/requirements.lock" >&2 ||
        fail "pip could not install tools/requirements.lock"
    echo "$want" >"$build/venv/.stamp"
}

# unity_sources DIR: this machine's package sources, as source-package entries, in DIR.
unity_sources() {
    for file in /etc/apt/sources.list.d/*.sources; do
        [ ! -f "$file" ] || sed 's/^Types:.*/Types: deb-src/' "$file" >"$1/${file##*/}"
    done
    for file in /etc/apt/sources.list /etc/apt/sources.list.d/*.list; do
        [ ! -f "$file" ] || sed -n 's/^deb[[:space:]]/deb-src /p' "$file" >"$1/${file##*/}"
    done
}

# ensure_unity: the test framework in build/unity.  Debian has it only inside the source package
# ntpsec; it is fetched with apt, which verifies it, without touching the machine's configuration.
ensure_unity() {
    [ ! -f "$build/unity/unity.c" ] || return 0
    command -v apt-get >/dev/null || return 0
    say "fetching the Unity test framework (Debian source package ntpsec) to build/unity"
    apt=$build/unity.apt
    rm -rf "$apt" "$build/unity.part"
    mkdir -p "$apt/sources" "$apt/lists/partial" "$apt/cache/archives/partial" "$build/unity.part"
    unity_sources "$apt/sources"
    set -- -qq -o APT::Sandbox::User= -o Dir::Etc::SourceList=/dev/null \
        -o "Dir::Etc::SourceParts=$apt/sources" -o "Dir::State::Lists=$apt/lists" \
        -o "Dir::Cache=$apt/cache"
    (cd "$apt" && apt-get "$@" update && apt-get "$@" source --download-only ntpsec) >&2 ||
        fail "the source package ntpsec could not be fetched"
    tar -xf "$apt"/ntpsec_*.orig.tar.* -C "$build/unity.part" --strip-components=3 --wildcards \
        '*/tests/unity/unity*.[ch]' || fail "Unity is not in the source package ntpsec"
    rm -rf "$build/unity" "$apt"
    mv "$build/unity.part" "$build/unity"
}
