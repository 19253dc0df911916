#!/usr/bin/env bash
# Build the wheel and use it without a checkout: an empty environment, another folder, the demo.
# The wheel has to contain the compiled kernels: first commands over the demo's recording compile nothing.
#   scripts/check_wheel.sh PYTHON          dependencies are those of PYTHON's environment (what CI does)
#   scripts/check_wheel.sh PYTHON --full   dependencies are installed from the package index (a release)
set -euo pipefail
cd "$(dirname "$0")/.."
python=${1:?name a Python that has the dependencies}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$python" -m pip wheel --quiet --no-deps --no-build-isolation --wheel-dir "$work/dist" .
"$python" -m venv "$work/empty"
if [ "${2:-}" = --full ]; then
    "$work/empty/bin/python" -m pip install --quiet "$work"/dist/depthmocap-*.whl
else
    "$work/empty/bin/python" -m pip install --quiet --no-deps "$work"/dist/depthmocap-*.whl
    # A path in a .pth file lends the packages that lie there, but not the checkout that PYTHON may be linked to.
    "$python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))' \
        >"$("$work/empty/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/lent.pth"
fi
mkdir "$work/elsewhere" "$work/cache"
unset NUMBA_CACHE_DIR NUMBA_CPU_NAME
cd "$work/elsewhere"
unset PYTHONPATH
found=$("$work/empty/bin/python" -c 'import toolkit; print(toolkit.__file__)')
case $found in
"$work"/empty/*) ;;
*)
    echo "the wheel does not bring its own code: $found" >&2
    exit 1
    ;;
esac
"$work/empty/bin/depthmocap" --version
"$work/empty/bin/python" -c 'import depthmocap; print(depthmocap.track, depthmocap.Tracker)'
"$work/empty/bin/depthmocap" demo --output demo
for file in take.npz run/track.npz film.webm contact_sheet.png table.csv report.html; do
    [ -s "demo/$file" ] || { echo "the demo did not write $file" >&2; exit 1; }
done
for first in "track demo/take.npz --output run" "info demo/take.npz --output info.png" "live file:demo/take.npz" \
    "database build --max-poses 100 --output poses.npz"; do
    XDG_CACHE_HOME=$work/cache "$work/empty/bin/depthmocap" $first
    compiled=$(find "$work/cache" -name '*.nbc')
    [ -z "$compiled" ] || { echo "$first compiled kernels that the wheel should contain: $compiled" >&2; exit 1; }
done
"$work/empty/bin/depthmocap" export demo/run --output motion.glb --rig mixamo
echo "the wheel works"
