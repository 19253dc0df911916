#!/usr/bin/env bash
# Builds sdist and wheel into dist/ and checks what an index and an installer check: metadata, README, contents.
#   scripts/check_package.sh PYTHON
set -euo pipefail
cd "$(dirname "$0")/.."
python=${1:?name a Python that has the development dependencies}
rm -rf dist
# Compiled kernels are checked by check_wheel.sh, and take a minute and a half.
DEPTHMOCAP_WITHOUT_KERNELS=1 "$python" -m hatchling build --target sdist --target wheel --directory dist
"$python" -m twine check --strict dist/*
"$(dirname "$python")/check-wheel-contents" dist/*.whl
list=$(tar tzf dist/*.tar.gz)
for path in benchmarks/results scripts/check_wheel.sh tests/conftest.py docs/data.md toolkit/py.typed; do
    grep -q "/$path" <<<"$list" || { echo "the sdist lacks $path" >&2; exit 1; }
done
