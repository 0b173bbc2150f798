#!/usr/bin/env bash
# Checks and measures gripfast on a graphics adapter, in under nine minutes:
#
#   bash benches/device.sh [--seconds N] [ADAPTER]
#
# ADAPTER is a number or part of a name as `gripfast devices` lists them; without it the first that
# counts as a GPU. (A software adapter must be named: llvmpipe. Its figures say nothing about
# speed.) Results go to the folder $OUT (target/device) after each part, so that a run that is cut
# off leaves what it has: NAME.md and NAME.json of the parts, and entry.md and entry.json, the dated
# entry for benches/RESULTS.md.
#
#   1 devices   adapter, driver, limits, subgroups, period of the timestamps
#   2 check     the kernels against the processor's and against double precision; sizes, order,
#               loss of the device
#     suite     the test suite of both backends, with the reference cases where they lie beside it
#   3 sweep     rates by twists, loads and contacts; one core, all cores, adapter; every step and
#               the bytes of a grip apart
#   4 commands  whole plans on processor and adapter, compared to 1e-9 and in order
#   5 entry     all of it as one entry
#
# Exit code: 0 all passed; 1 a part failed, was cut off or could not be written; 2 the adapter,
# the program or the output folder is not usable (parts that need no adapter run all the same).
#
# On a machine without Rust and network: make a folder to carry on one that has both,
#
#   bash benches/device.sh --pack FOLDER
#
# copy it there whole and run `bash FOLDER/device.sh [ADAPTER]`. It holds the release binary and the
# test binary (stripped), the shipped parts, the reference cases where they are, and the Vulkan
# loader; some 27 MiB, 64 MiB at most. There it needs bash, coreutils, a glibc no older than that
# of the building machine, and the adapter's driver with its ICD file (a JSON that names the
# driver's library). The loader looks in /usr/share/vulkan/icd.d and /etc/vulkan/icd.d. Containers
# often have NVIDIA's driver without the file: this script then looks in other usual places, and at
# last writes one for libGLX_nvidia.so.0. If it still finds no adapter, look for nvidia_icd.json
# (find / -name 'nvidia_icd*.json') and set VK_DRIVER_FILES to it.
#
# Environment: OUT, GRIPFAST (binary), SUITE (test binary; empty: none), PARTS (folder of the
# shipped parts), TFLOPS and BANDWIDTH [GB/s] (limits of an adapter that gripfast does not know),
# LOSE (rehearsal: the sweep loses the device before this chunk).
set -u
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(dirname "$here")
target=${CARGO_TARGET_DIR:-$root/target}
total=510
adapter=
pack=

say() { printf '%s\n' "$*"; }
stop() { say "device.sh: $*" >&2; exit 2; }

while [ $# -gt 0 ]; do
    case $1 in
        --pack) [ $# -gt 1 ] || stop "--pack needs a folder"; pack=$2; shift 2 ;;
        --seconds)
            [[ ${2-} =~ ^[1-9][0-9]*$ ]] || stop "--seconds needs a whole number of seconds"
            total=$2; shift 2 ;;
        -h | --help) sed -n '2,/^set -u/s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"; exit 0 ;;
        -*) stop "unknown flag $1; see --help" ;;
        *) adapter=$1; shift ;;
    esac
done

newest_suite() {
    local found
    for found in $(ls -t "$target"/debug/deps/backend-* 2>/dev/null); do
        if [ -x "$found" ] && [ ! -d "$found" ]; then
            say "$found"
            return
        fi
    done
}

build() {
    command -v cargo >/dev/null || stop "there is neither a built program nor cargo to build one"
    (cd "$root" && cargo build --release) || stop "the program does not build"
    (cd "$root" && cargo test --workspace --features full --test backend --no-run) ||
        stop "the test suite does not build"
}

# The folder to carry.
if [ -n "$pack" ]; then
    build
    mkdir -p "$pack/parts" && pack=$(cd "$pack" && pwd) || stop "cannot make $pack"
    suite=$(newest_suite)
    [ -n "$suite" ] || stop "no test binary in $target/debug/deps"
    cp "$target/release/gripfast" "$pack/gripfast" && cp "$suite" "$pack/suite" &&
        cp "$root"/data/parts/*.stl "$pack/parts/" && cp "$here/device.sh" "$pack/" ||
        stop "cannot fill $pack"
    if command -v strip >/dev/null; then strip "$pack/gripfast" "$pack/suite"; fi
    git -C "$root" describe --always --dirty >"$pack/COMMIT" 2>/dev/null
    if [ -f "$root/../shared/cases/reference.json" ]; then
        mkdir -p "$pack/reference/cases"
        cp "$root/../shared/cases/reference.json" "$pack/reference/cases/"
    fi
    loader=$(ldconfig -p 2>/dev/null | sed -n 's/.*libvulkan\.so\.1 .*=> //p' | head -n 1)
    if [ -n "$loader" ]; then
        mkdir -p "$pack/lib"
        cp -L "$loader" "$pack/lib/libvulkan.so.1"
    fi
    bytes=$(du -sb "$pack" | cut -f 1)
    (cd "$pack" && du -ab . | sort -rn | head -n 12)
    say "packed into $pack: $((bytes / 1048576)) MiB"
    [ "$bytes" -le 67108864 ] || stop "that is more than 64 MiB"
    exit 0
fi

# The program and what belongs to it: in the packed folder, or in the checkout.
if [ -x "$here/gripfast" ]; then
    program=${GRIPFAST:-$here/gripfast}
    suite=${SUITE-$here/suite}
    parts=${PARTS:-$here/parts}
    commit=$(cat "$here/COMMIT" 2>/dev/null)
    out=${OUT:-$here/out}
    [ ! -d "$here/reference" ] || export GRIPFAST_REFERENCE="$here/reference"
else
    program=${GRIPFAST:-$target/release/gripfast}
    suite=${SUITE-$(newest_suite)}
    # SUITE= (empty) leaves the suite out.
    if ! [ -x "$program" ] || { [ -z "$suite" ] && [ -z "${SUITE+x}" ]; }; then
        build
        suite=${SUITE-$(newest_suite)}
    fi
    parts=${PARTS:-$root/data/parts}
    commit=$(git -C "$root" describe --always --dirty 2>/dev/null)
    out=${OUT:-$target/device}
fi
[ -x "$program" ] || stop "no program at $program; build it, or name one with GRIPFAST"
"$program" --version >/dev/null || stop "$program does not run here"

mkdir -p "$out" && out=$(cd "$out" && pwd) || stop "cannot make the output folder $out; set OUT"
full() {
    stop "the output folder $out is full or cannot be written; nothing was left in it. \
Make room (1 MiB) or set OUT to another folder"
}
head -c 1048576 /dev/zero 2>/dev/null >"$out/.room" || { rm -f "$out/.room"; full; }
rm -f "$out/.room"
for old in devices check suite sweep commands entry; do
    rm -f "$out/$old.json" "$out/$old.md" "$out/$old.log"
done
work=$(mktemp -d) || stop "no folder for temporary files; set TMPDIR"
# Where a program looks for it, Mesa complains if it is not there.
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-$work}
trap 'rm -rf "$work"' EXIT

# The loader and the driver's file.
if ! ldconfig -p 2>/dev/null | grep -q 'libvulkan\.so\.1' && [ -f "$here/lib/libvulkan.so.1" ]; then
    export LD_LIBRARY_PATH="$here/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
    say "Vulkan loader: the packed one"
fi
known_icd() { ls /usr/share/vulkan/icd.d/*nvidia*.json /etc/vulkan/icd.d/*nvidia*.json 2>/dev/null; }
if [ -z "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] && [ -e /dev/nvidiactl ] &&
    [ -z "$(known_icd)" ]; then
    icd=
    for place in /usr/local/nvidia /usr/local /opt/nvidia /run/opengl-driver /usr; do
        for file in "$place"/share/vulkan/icd.d/nvidia_icd*.json "$place"/vulkan/icd.d/nvidia*.json; do
            [ -f "$file" ] && icd=$file && break 2
        done
    done
    if [ -z "$icd" ]; then
        icd=$work/nvidia_icd.json
        say '{"file_format_version": "1.0.0", "ICD": {"library_path": "libGLX_nvidia.so.0",
"api_version": "1.3.0"}}' >"$icd"
    fi
    # Besides the others that the loader finds; older loaders know the other name only.
    export VK_ADD_DRIVER_FILES=$icd
    if ! ls /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json >/dev/null 2>&1; then
        export VK_DRIVER_FILES=$icd VK_ICD_FILENAMES=$icd
    fi
    say "driver file: $icd"
fi

begin=$SECONDS
code=0
ended=()
rest() { say $((total - SECONDS + begin)); }
# A number of seconds in a run of 510, as a share of this run.
share() { say $((($1 * total + 509) / 510)); }

note() { # name, words
    say "   $1: $2"
    ended+=(--ended "$1=$2")
    "$program" bench entry --out "$out" --date "$(date -u +%F)" --commit "${commit:-unknown}" \
        "${ended[@]}" && return
    say "device.sh: entry.md and entry.json in $out, if any, are those before this part" >&2
    code=1
}

# Keeps a file of the work folder under its name in the output folder, whole or not at all.
keep() {
    if ! { cp "$work/$1" "$out/.$1" && mv "$out/.$1" "$out/$1"; } 2>/dev/null; then
        rm -f "$out/.$1"
        say "device.sh: the output folder $out is full: $1 is not in it" >&2
        code=1
    fi
}

# Runs a part: name, seconds at most, command. What it prints goes to the terminal; standard output
# also to the file NAME.stdout of the work folder.
part() {
    local name=$1 limit status before=$SECONDS
    limit=$(($2 < $(rest) ? $2 : $(rest)))
    shift 2
    say
    say "== $name"
    if [ "$limit" -lt 1 ]; then
        status=1
        note "$name" "not run, no time"
        code=1
        return 1
    fi
    timeout -k 3 "$limit" "$@" >"$work/$name.stdout" 2> >(tee "$work/$name.stderr" >&2)
    status=$?
    sleep 0.1
    case $status in
        0) words="whole, $((SECONDS - before)) s" ;;
        124 | 137) words="cut off after $limit s" ;;
        *) words="FAILED with exit code $status: $(grep -m 1 '^error:' "$work/$name.stderr")" ;;
    esac
    [ $status -eq 0 ] || code=1
    return $status
}

# 1
words=
part devices 20 "$program" devices --json
status=$?
if [ -s "$work/devices.stdout" ]; then
    mv "$work/devices.stdout" "$work/devices.json"
    keep devices.json
    "$program" devices || true
fi
[ -z "$words" ] || note devices "$words"

# 2
named=()
[ -z "$adapter" ] || named=(--adapter "$adapter")
usable=1
words=
part check "$(share 80)" "$program" bench check "${named[@]}" --seconds "$(share 50)" --out "$out"
status=$?
[ -z "$words" ] || note check "$words"
if [ $status -eq 2 ] && ! grep -q '"adapter"' "$out/check.json" 2>/dev/null &&
    ! grep -q 'cannot write' "$work/check.stderr"; then
    say "device.sh: the adapter cannot be used; the parts that need none run" >&2
    usable=0
fi
backend=gpu
[ $usable -eq 1 ] || { backend=cpu; named=(); }
if [ -n "$suite" ] && [ -x "$suite" ]; then
    words=
    : >"$work/suite.log"
    if [ $usable -eq 1 ]; then
        # The name of the adapter that was checked.
        name=$(sed -n 's/^ *"adapter": "\(.*\) ([A-Z][A-Za-z0-9]*, .*$/\1/p' "$out/check.json" |
            head -n 1)
        export GRIPFAST_GPU=require GRIPFAST_ADAPTER="${adapter:-$name}"
        part suite "$(share 110)" "$suite" gpu
        status=$?
        cat "$work/suite.stdout" "$work/suite.stderr" >>"$work/suite.log"
        [ $status -eq 0 ] || note suite "adapter: $words"
        unset GRIPFAST_GPU GRIPFAST_ADAPTER
    fi
    part suite "$(share 40)" "$suite" cpu::
    status=$?
    cat "$work/suite.stdout" "$work/suite.stderr" >>"$work/suite.log"
    keep suite.log
    [ -z "$words" ] || note suite "$words"
else
    say
    say "== suite"
    note suite "SKIPPED: no test binary; SUITE names one"
fi

# 3
limits=()
[ -z "${TFLOPS:-}" ] || limits+=(--tflops "$TFLOPS")
[ -z "${BANDWIDTH:-}" ] || limits+=(--bandwidth "$BANDWIDTH")
[ -z "${LOSE:-}" ] || limits+=(--lose-before "$LOSE")
words=
part sweep "$(share 180)" "$program" bench sweep --backend $backend "${named[@]}" \
    --seconds "$(share 150)" "${limits[@]}" --out "$out"
[ -z "$words" ] || note sweep "$words"

# 4
words=
part commands "$(share 150)" "$program" bench commands --backend $backend "${named[@]}" \
    --parts "$parts" --seconds "$(share 130)" --out "$out"
[ -z "$words" ] || note commands "$words"

# 5
say
[ ! -f "$out/entry.md" ] || cat "$out/entry.md"
for left in entry.md entry.json; do
    [ -f "$out/$left" ] || { say "device.sh: $out/$left could not be written" >&2; code=1; }
done
[ $usable -eq 1 ] || code=2
say "results: $out (exit code $code)"
exit $code
