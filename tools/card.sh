#!/usr/bin/env bash
# Checks what a GPU draws, on a machine without Rust.
#
#   tools/card.sh pack [DIR]    builds the pictures' test, the digger and the benchmark of frames, plays the digger on this machine's
#                               renderer, and packs everything into DIR (out/card): copy it to a machine with a Vulkan driver
#   DIR/run.sh [OUT]            there: golden scenes, every way to draw the ground, and the digger's script, all searched for
#                               holes, and compared with the pictures of the machine that packed; OUT/report.txt has the rest
#   FRAMES=1 DIR/run.sh [OUT]   also measures the times of frames
#
# It fails if ground is missing in any picture, if a golden scene differs by more than 0.03 FLIP, or a picture of the digger by more
# than 0.05: renderers round mip levels and the edges of shadows otherwise, and bodies of physics land a millimetre apart.
set -euo pipefail
[ "${1:-}" = pack ] || { sed -n '2,13s/^# \{0,1\}//p' "$0"; exit 2; }
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PATH="$HOME/.cargo/bin:$PATH"
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$HOME/.cache/bevy_burrow/target}"
out=${2:-out/card}
flags=(--release --features examples)
cargo build "${flags[@]}" --example digger
# executable KIND NAME: builds a test or a benchmark, and prints where it is.
executable() {
    cargo test "${flags[@]}" "--$1" "$2" --no-run --message-format=json | python3 -c '
import json, sys
found = [message["executable"] for message in map(json.loads, sys.stdin) if message.get("executable")]
print(found[-1])'
}
golden=$(executable test golden)
frames=$(executable bench frame_times)
rm -rf "$out"
mkdir -p "$out/bin" "$out/lib" "$out/tests/golden" "$out/docs"
for program in "$golden:golden" "$frames:frame_times" "$CARGO_TARGET_DIR/release/examples/digger:digger"; do
    strip -o "$out/bin/${program##*:}" "${program%:*}"
done
cp -r assets "$out/assets"
cp -r tests/golden/pictures "$out/tests/golden/pictures"
"$CARGO_TARGET_DIR/release/examples/digger" --headless --low --width 640 --height 360 --out "$out/software"
cat >"$out/run.sh" <<'EOS'
#!/usr/bin/env bash
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
out=$(realpath -m "${1:-result}")
mkdir -p "$out"
# Programs look for their files here and not where they were built.
export CARGO_MANIFEST_DIR=$PWD BURROW_PROOF=$out/proof BURROW_REQUIRE=1 BURROW_FLIP=0.03 BURROW_COMBINATIONS=all
failed=
step() {
    local name=$1
    shift
    echo "=== $name: $*" | tee -a "$out/report.txt"
    "$@" 2>&1 | tee -a "$out/report.txt" || failed="$failed $name"
}
step digger bin/digger --headless --width 640 --height 360 --out "$out/digger"
step low bin/digger --headless --low --width 640 --height 360 --out "$out/low"
step compare env BURROW_FLIP=0.05 BURROW_COMPARE="software:$out/low" bin/golden --ignored --nocapture two_renderers
step golden bin/golden --nocapture --test-threads 1
if [ -n "${FRAMES:-}" ]; then
    step frames bin/frame_times 0 2560 1440
    step frames_again bin/frame_times 0 2560 1440
fi
echo "failed:${failed:- nothing}" | tee -a "$out/report.txt"
[ -z "$failed" ]
EOS
chmod +x "$out/run.sh"
du -sh "$out"
