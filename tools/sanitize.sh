#!/bin/sh
# Runs the tests of the CUDA kernels under a watcher of memory and races: compute-sanitizer where there is a card, else the
# sanitizers of a C++ compiler in the emulator.
#
#   BURROW_WORLDS=20 tools/sanitize.sh
set -eu
cd "$(dirname "$0")/.."

export BURROW_WORLDS="${BURROW_WORLDS:-20}"
check() {
    cargo test --no-default-features --features cuda --lib backend
}

if command -v compute-sanitizer >/dev/null 2>&1 && nvidia-smi -L >/dev/null 2>&1; then
    host=$(rustc -vV | sed -n 's/^host: //p' | tr 'a-z-' 'A-Z_')
    for tool in memcheck racecheck; do
        export "CARGO_TARGET_${host}_RUNNER=compute-sanitizer --tool $tool --error-exitcode 9"
        check
    done
else
    echo 'tools/sanitize.sh: no card, or no compute-sanitizer: the emulator watches its own memory instead'
    BURROW_EMULATOR_SANITIZE=1 check
fi
