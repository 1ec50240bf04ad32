#!/bin/sh
# Compares our dense mesher with VTK, scikit-image and PyMCubes: installs them outside the clone, builds, measures.
# With --gpu: with cupmb and isoext on an NVIDIA GPU, and scikit-image for scale.
#
#   tools/peers.sh [--gpu] [--quick] [--fields sphere,caves] [--sizes 64,128] [--json FILE]
set -eu
cd "$(dirname "$0")/.."

name=peers
if [ "${1:-}" = --gpu ]; then
    shift
    name=peers_gpu
    if ! nvidia-smi -L >/dev/null 2>&1; then
        echo "peers: --gpu needs an NVIDIA GPU with its driver, and nvidia-smi finds none" >&2
        exit 1
    fi
fi
tools/setup.sh peers
PATH="$HOME/.cargo/bin:$PATH"
CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$HOME/.cache/bevy_burrow/target}
export PATH CARGO_TARGET_DIR
environment=${BURROW_PEERS:-$HOME/.cache/bevy_burrow/$name}

# The copy is written last: an installation that was broken off is done again.
if ! cmp -s "tools/$name.txt" "$environment/$name.txt"; then
    python3 -m venv --clear "$environment"
    "$environment/bin/python" -m pip install --quiet --disable-pip-version-check -r "tools/$name.txt"
    if [ "$name" = peers_gpu ]; then
        # Is compiled here, with nvcc. Without it there is still the other peer.
        "$environment/bin/python" -m pip install --quiet --disable-pip-version-check isoext==1.0.0 ||
            echo "peers: isoext could not be built, which takes nvcc of CUDA 12.4 or newer and a C++ compiler" >&2
    fi
    cp "tools/$name.txt" "$environment/$name.txt"
fi

cargo bench --no-default-features --features cuda --bench meshers --no-run
# Cargo alone knows the binary's name.
bench=$(cargo bench --no-default-features --features cuda --bench meshers --no-run --message-format=json 2>/dev/null |
    sed -n 's/.*"name":"meshers".*"executable":"\([^"]*\)".*/\1/p')
exec "$environment/bin/python" "tools/$name.py" --bench "$bench" "$@"
