#!/bin/sh
# Builds the emulator of the CUDA kernels, if its sources are newer, and prints where it is. Exits with 2 where there is no
# C++ compiler.
#
#   tools/emulator.sh [FOLDER]
#
# CXX names the compiler. BURROW_EMULATOR_SANITIZE=1 builds one that watches its own memory, many times slower.
set -eu
cd "$(dirname "$0")/.."

if [ "$(uname -s)" != Linux ]; then
    echo 'tools/emulator.sh: the emulator is for Linux' >&2
    exit 2
fi
folder=${1:-${CARGO_TARGET_DIR:-$HOME/.cache/bevy_burrow/target}/emulator}
sources="tools/emulator.sh tools/emulator/emulator.h tools/emulator/emulator.cpp src/backend/cuda/kernels.cu
    src/backend/cuda/kernels/*.cuh"
mkdir -p "$folder"
program=$(cd "$folder" && pwd)/burrow-emulator
# As on the device: no operation is fused. Words are read as halves, and the other way round.
flags='-std=c++17 -O2 -g -ffp-contract=off -fno-strict-aliasing -U_FORTIFY_SOURCE
    -Wall -Wextra -Wno-sign-compare -Wno-parentheses -Wno-unknown-pragmas'
if [ "${BURROW_EMULATOR_SANITIZE:-0}" = 1 ]; then
    program=$program-sanitized
    flags="$flags -DBURROW_SANITIZE -fsanitize=address,undefined -fno-sanitize-recover=undefined"
fi

is_fresh() {
    for source in $sources; do
        [ "$program" -nt "$source" ] || return 1
    done
}

if ! is_fresh; then
    compiler=
    for candidate in ${CXX:-} c++ g++ clang++; do
        if command -v "$candidate" >/dev/null 2>&1; then
            compiler=$candidate
            break
        fi
    done
    if [ -z "$compiler" ]; then
        echo 'tools/emulator.sh: there is no C++ compiler; install g++, or set CXX' >&2
        exit 2
    fi
    # Put in place at once: several tests may build it together.
    # shellcheck disable=SC2086 # flags are words
    "$compiler" $flags tools/emulator/emulator.cpp -o "$program.$$"
    mv "$program.$$" "$program"
fi
echo "$program"
