#!/usr/bin/env bash
# make_environment.sh FOLDER: a virtual environment with the project and its tools, whole or not at all.
# An environment that is up to date is left alone; one whose making was interrupted is removed and made again.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$1
stamp=$folder/.installed
unfinished=$folder/.unfinished
wanted=$(sha256sum pyproject.toml | cut -d' ' -f1)

if [ ! -e "$unfinished" ] && [ "$(cat "$stamp" 2>/dev/null)" = "$wanted" ]; then
    exit 0
fi

range=$(sed -n 's/^requires-python = ">=3\.\([0-9]*\),<3\.\([0-9]*\)"$/\1 \2/p' pyproject.toml)
first=${range% *}
last=$((${range#* } - 1))

works() { "$1" -c "import sys; sys.exit(not (3, $first) <= sys.version_info[:2] <= (3, $last))" 2>/dev/null; }

find_python() {
    if [ -n "${PYTHON:-}" ]; then
        works "$PYTHON" && { echo "$PYTHON"; return; }
        echo "PYTHON=$PYTHON is not a Python 3.$first to 3.$last; name another one" >&2
        return 1
    fi
    for candidate in python3 $(seq -f python3.%.0f "$last" -1 "$first") python; do
        works "$candidate" && { echo "$candidate"; return; }
    done
    echo "no Python 3.$first to 3.$last was found; install one or name it: make PYTHON=/path/to/python3.11" >&2
    return 1
}

[ -e "$unfinished" ] && rm -rf "$folder"
ours=
if [ ! -d "$folder" ]; then
    python=$(find_python)
    if ! "$python" -c 'import venv, ensurepip' 2>/dev/null; then
        version=$("$python" -c 'import sys; print(f"{sys.version_info[0]}.{sys.version_info[1]}")')
        scripts/install_packages.sh "$python cannot make virtual environments" "python$version-venv"
    fi
    mkdir -p "$folder"
    ours=yes
elif [ -e "$stamp" ]; then
    ours=yes
fi

# Only what this script has made is ever removed: an environment that someone else put here is theirs.
tidy() { [ -z "$ours" ] || { rm -rf "$folder"; echo "the unfinished environment in $folder was removed" >&2; }; }
[ -z "$ours" ] || touch "$unfinished"
trap tidy EXIT
trap 'exit 130' INT TERM

[ -x "$folder/bin/python" ] || "$python" -m venv "$folder"
echo "installing the project and its tools into $folder (once; some minutes)" >&2
# Modules are compiled when they are first imported: most of the packages' never are, and all of them take a minute.
# Without build isolation: a build environment would have all packages again, to compile kernels that an editable
# installation does not contain.
{
    "$folder/bin/python" -m pip install --quiet --disable-pip-version-check --no-compile 'hatchling>=1.18' editables &&
        "$folder/bin/python" -m pip install --quiet --disable-pip-version-check --no-compile --no-build-isolation \
            --editable '.[dev]'
} || {
    echo "the packages could not be installed; check the network and run make again" >&2
    exit 1
}
echo "$wanted" >"$stamp"
rm -f "$unfinished"
trap - EXIT
