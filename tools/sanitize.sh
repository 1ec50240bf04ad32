#!/bin/sh
# Runs the tests of the CUDA kernels under a watcher of memory and races: compute-sanitizer where there is a card, else the
# sanitizers of a C++ compiler in the emulator, many times slower, which tests blocks and bricks only.
#
#   BURROW_WORLDS=20 tools/sanitize.sh
set -eu
cd "$(dirname "$0")/.."

export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$HOME/.cache/bevy_burrow/target}"
check() {
    cargo test --no-default-features --features cuda --lib "$@"
}

if command -v compute-sanitizer >/dev/null 2>&1 && nvidia-smi -L >/dev/null 2>&1; then
    export BURROW_WORLDS="${BURROW_WORLDS:-20}"
    host=$(rustc -vV | sed -n 's/^host: //p' | tr 'a-z-' 'A-Z_')
    for tool in memcheck racecheck; do
        export "CARGO_TARGET_${host}_RUNNER=compute-sanitizer --tool $tool --error-exitcode 9"
        # Tests of drivers look at machines without a card.
        check backend::cuda -- --skip drivers
    done
else
    echo 'tools/sanitize.sh: no card, or no compute-sanitizer: the emulator watches its own memory instead'
    BURROW_EMULATOR_SANITIZE=1 check backend::cuda::kernel_tests
fi
