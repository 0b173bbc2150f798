#!/usr/bin/env bash
# Builds what is shipped: for each target a tar.gz of the program (all features but STEP), its
# documents and its bill of materials (CycloneDX), and one file of SHA-256 sums.
#
#   bash cli/dist.sh [TARGET ..]     without a target: the one of this machine
#
# Same commit, same compiler, same libc: the same bytes, wherever the folder lies. (Times come from
# the commit, paths are left out, and the lock file is obeyed.) A dirty tree is refused.
#
# Linked with the libc of the building machine, so build on the oldest system to be served. Not
# static: the Vulkan loader is a shared library. For another architecture its cross compiler must
# be there (Debian: gcc-aarch64-linux-gnu, libc6-dev-arm64-cross) and `rustup target add TARGET`.
#
# Environment: OUT (target/shipped), CARGO_TARGET_DIR.
set -euo pipefail
cd "$(dirname "$0")/.."
stop() { echo "dist.sh: $*" >&2; exit 2; }

command -v cargo-cyclonedx >/dev/null || stop "cargo-cyclonedx is not there: cargo install cargo-cyclonedx --locked"
[ -z "$(git status --porcelain)" ] || stop "the tree has changes that are not committed"
[ $# -gt 0 ] || set -- "$(rustc -vV | sed -n 's/^host: //p')"
out=${OUT:-target/shipped}
target=${CARGO_TARGET_DIR:-target}
version=$(cargo metadata --no-deps --locked --format-version 1 |
    sed -n 's/.*"name":"gripfast-cli","version":"\([^"]*\)".*/\1/p')
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH
cargo_home=$(realpath "${CARGO_HOME:-$HOME/.cargo}")
sysroot=$(rustc --print sysroot)
remap="--remap-path-prefix=$PWD=/gripfast --remap-path-prefix=$cargo_home=/cargo --remap-path-prefix=$sysroot=/rust"
rm -rf "$out"
mkdir -p "$out"

for triple in "$@"; do
    linker=
    case $triple in
        "$(rustc -vV | sed -n 's/^host: //p')") ;;
        aarch64-unknown-linux-gnu) linker=aarch64-linux-gnu-gcc ;;
        x86_64-unknown-linux-gnu) linker=x86_64-linux-gnu-gcc ;;
        *) stop "no cross compiler is known for $triple; build it on such a machine" ;;
    esac
    if [ -n "$linker" ]; then
        command -v "$linker" >/dev/null || stop "$linker is not there: apt install gcc-${triple%%-*}-linux-gnu"
        name=${triple//-/_}
        export "CARGO_TARGET_${name^^}_LINKER=$linker" "CC_$name=$linker"
    fi
    RUSTFLAGS="$remap -C strip=symbols" CFLAGS="-ffile-prefix-map=$cargo_home=/cargo" \
        cargo build --locked --profile dist -p gripfast-cli --features full --target "$triple"

    folder=gripfast-$version-$triple
    mkdir "$out/$folder"
    install -m 755 "$target/$triple/dist/gripfast" "$out/$folder/"
    install -m 644 README.md CHANGELOG.md SECURITY.md LICENSE-APACHE LICENSE-MIT "$out/$folder/"
    cp -r docs "$out/$folder/docs"
    mkdir "$out/$folder/data"
    cp -r data/parts "$out/$folder/data/parts"
    # Written beside each package's manifest; the program's is shipped. Its number is random
    # otherwise.
    cargo cyclonedx -q --manifest-path cli/Cargo.toml --features full --target "$triple" \
        --format json --spec-version 1.5 --override-filename gripfast-sbom
    mv cli/gripfast-sbom.json "$out/$folder/gripfast-$triple.cdx.json"
    rm -f gripfast-sbom.json python/gripfast-sbom.json
    sed -i '/"serialNumber"/d' "$out/$folder/gripfast-$triple.cdx.json"
    sed -i "s|$PWD|/gripfast|g" "$out/$folder/gripfast-$triple.cdx.json"
    tar --sort=name --owner=0 --group=0 --numeric-owner --mtime="@$SOURCE_DATE_EPOCH" --mode=go-w \
        -C "$out" -cf - "$folder" | gzip -9n >"$out/$folder.tar.gz"
    rm -r "${out:?}/$folder"
done
(cd "$out" && sha256sum -- *.tar.gz | tee SHA256SUMS)
