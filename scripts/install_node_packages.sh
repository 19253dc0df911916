#!/usr/bin/env bash
# Installs what checks exported GLB files (the Khronos validator) where npm is at hand; the check is skipped without it.
set -euo pipefail
cd "$(dirname "$0")/node"
if ! command -v npm >/dev/null; then
    echo "npm is not installed: GLB files are not shown to the Khronos validator" >&2
    exit 0
fi
stamp=node_modules/.stamp
[ -f "$stamp" ] && [ "$stamp" -nt package.json ] && exit 0
npm install --no-package-lock --no-audit --no-fund --silent >&2 && touch "$stamp"
