#!/bin/sh
# Times our dense mesher beside VTK, scikit-image and PyMCubes: installs them outside the clone, builds, measures.
#
#   tools/peers.sh [--quick] [--fields sphere,caves] [--sizes 64,128] [--json FILE]
set -eu
cd "$(dirname "$0")/.."

tools/setup.sh peers
PATH="$HOME/.cargo/bin:$PATH"
CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$HOME/.cache/bevy_burrow/target}
export PATH CARGO_TARGET_DIR
environment=${BURROW_PEERS:-$HOME/.cache/bevy_burrow/peers}

# The copy is written last: an installation that was broken off is done again.
if ! cmp -s tools/peers.txt "$environment/peers.txt"; then
    python3 -m venv --clear "$environment"
    "$environment/bin/python" -m pip install --quiet --disable-pip-version-check -r tools/peers.txt
    cp tools/peers.txt "$environment/peers.txt"
fi

cargo bench --no-default-features --features cuda --bench meshers --no-run
# Cargo alone knows the binary's name.
bench=$(cargo bench --no-default-features --features cuda --bench meshers --no-run --message-format=json 2>/dev/null |
    sed -n 's/.*"name":"meshers".*"executable":"\([^"]*\)".*/\1/p')
exec "$environment/bin/python" tools/peers.py --bench "$bench" "$@"
