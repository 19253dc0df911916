#!/usr/bin/env bash
# Builds toolkit/output/report/assets/viewer.js, the script of the report page, from scripts/node/viewer/ and three.js.
set -euo pipefail
cd "$(dirname "$0")"
./install_node_packages.sh
npm --prefix node run build --silent
cp node/node_modules/three/LICENSE ../toolkit/output/report/assets/LICENSE.three.txt
