#!/usr/bin/env bash
# install_packages.sh REASON PACKAGE...: install Debian packages as root or with sudo, or say which line to type.
set -euo pipefail
reason=$1
shift
packages=$(printf '%s\n' "$@" | sort | tr '\n' ' ')
packages=${packages% }
line="apt-get update && apt-get install -y --no-install-recommends $packages"

if ! command -v apt-get >/dev/null; then
    echo "$reason; install what your system calls: $packages" >&2
    exit 1
fi
if [ "$(id -u)" -eq 0 ]; then
    run=()
elif command -v sudo >/dev/null && { sudo -n true 2>/dev/null || [ -t 0 ]; }; then
    run=(sudo)
else
    echo "$reason; as root, type: $line" >&2
    exit 1
fi
echo "$reason; installing $packages" >&2
export DEBIAN_FRONTEND=noninteractive
# shellcheck disable=SC2086
if ! { "${run[@]}" apt-get update -q && "${run[@]}" apt-get install -y -q --no-install-recommends $packages; } >&2; then
    echo "$reason and could not be installed; as root, type: $line" >&2
    exit 1
fi
