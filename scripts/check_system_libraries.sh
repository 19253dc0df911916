#!/usr/bin/env bash
# Check for the shared libraries that Open3D's wheel expects from the system. As root or with sudo the missing ones are
# installed; otherwise stop with the exact line to type. Does nothing on systems without the Linux loader's cache.
set -euo pipefail
PATH=$PATH:/usr/sbin:/sbin
command -v ldconfig >/dev/null || exit 0

declare -A package_of=(
    [libusb-1.0.so.0]=libusb-1.0-0 [libGL.so.1]=libgl1 [libEGL.so.1]=libegl1 [libX11.so.6]=libx11-6
    [libudev.so.1]=libudev1 [libidn2.so.0]=libidn2-0 [libgomp.so.1]=libgomp1
)
known=$(ldconfig -p)
missing=()
for library in "${!package_of[@]}"; do
    grep -qF "$library" <<<"$known" || missing+=("${package_of[$library]}")
done
[ ${#missing[@]} -eq 0 ] && exit 0

exec "$(dirname "$0")/install_packages.sh" "Open3D needs system libraries that are missing here" "${missing[@]}"
