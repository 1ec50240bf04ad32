#!/bin/sh
# Runs the tests of the CUDA kernels under a watcher of memory and races: compute-sanitizer where there is a GPU, else the
# sanitizers of a C++ compiler in the emulator, many times slower, which tests blocks and bricks only.
#
#   BURROW_WORLDS=20 BURROW_RACE_WORLDS=1 tools/sanitize.sh
#
# Races are looked for in worlds of their own number: that takes many times as long as looking at memory.
set -eu
cd "$(dirname "$0")/.."

export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$HOME/.cache/bevy_burrow/target}"
check() {
    cargo test --no-default-features --features cuda --lib "$@"
}

# sanitize TOOL WORLDS
sanitize() {
    export "CARGO_TARGET_${host}_RUNNER=compute-sanitizer --tool $1 --error-exitcode 9" BURROW_WORLDS="$2"
    # Tests of drivers look at machines without a GPU.
    check backend::cuda -- --skip drivers
}

if command -v compute-sanitizer >/dev/null 2>&1 && nvidia-smi -L >/dev/null 2>&1; then
    host=$(rustc -vV | sed -n 's/^host: //p' | tr 'a-z-' 'A-Z_')
    sanitize memcheck "${BURROW_WORLDS:-20}"
    sanitize racecheck "${BURROW_RACE_WORLDS:-1}"
else
    echo 'tools/sanitize.sh: no GPU, or no compute-sanitizer: the emulator watches its own memory instead'
    export BURROW_EMULATOR_SANITIZE=1
    check backend::cuda::kernel_tests
fi
