#!/usr/bin/env bash
# Sets up what the tests need and runs all of them. Debian 12 or similar with Rust and Python 3.11; as root it installs
# the missing system packages, otherwise it names them. Nothing is skipped silently: see the lines that say SKIPPED.
set -euo pipefail
cd "$(dirname "$0")/.."

need=()
ls /usr/share/vulkan/icd.d/*lvp* >/dev/null 2>&1 || need+=(mesa-vulkan-drivers)
ldconfig -p | grep -q libvulkan.so.1 || need+=(libvulkan1)
command -v cc >/dev/null || need+=(gcc libc6-dev)
# For STEP files: Open CASCADE (half a minute to install and build).
[ -f /usr/include/opencascade/Standard_Version.hxx ] || need+=(libocct-data-exchange-dev libocct-modeling-algorithms-dev)
command -v c++ >/dev/null || need+=(g++)
python3 -c 'import ensurepip' 2>/dev/null || need+=(python3-venv)
if [ ${#need[@]} -gt 0 ]; then
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        apt-get update -qq
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${need[@]}" >/dev/null
    else
        echo "missing: ${need[*]} (install them, or run this as root on Debian)"
    fi
fi

# Independent readers of the export formats.
if [ ! -x target/readers/bin/python ]; then
    python3 -m venv target/readers
    target/readers/bin/pip install -q --disable-pip-version-check -r tests/readers/requirements.txt
fi
export GRIPFAST_PYTHON="$PWD/target/readers/bin/python"

# With the software Vulkan driver there is always an adapter: a test that needs one fails instead of skipping.
export GRIPFAST_GPU=require GRIPFAST_READERS=require
# The report page's browser test runs where Chromium, Node and viewer/node_modules (npm ci) are there, and says SKIPPED
# elsewhere; GRIPFAST_BROWSER=require makes it fail instead.

cargo fmt --check
cargo clippy --all-targets --features full --quiet -- -D warnings
features=full
if [ -f /usr/include/opencascade/Standard_Version.hxx ] && command -v c++ >/dev/null; then
    features=full,step
else
    echo "SKIPPED: STEP files: install libocct-data-exchange-dev, libocct-modeling-algorithms-dev and g++ (cargo test --features step)"
fi
cargo test --features "$features" --no-fail-fast
