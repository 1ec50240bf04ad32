#!/bin/sh
# Counts the instructions of fixed workloads (benches/instructions.rs) and compares them with benches/instructions.txt.
#
#   tools/instructions.sh            fails where a count grew by more than 3 %, and says what shrank
#   tools/instructions.sh --update   writes the counts as the new baseline
#   tools/instructions.sh --profile NAME   shows where one workload spends them: functions, with what they call
#
# Counts depend on the compiler and the C library: the baseline names those it was made with, and under others they are
# shown but nothing fails. What the library would choose by the processor at hand it does not choose here. Where valgrind
# can't be had, nothing is counted and nothing fails, unless BURROW_REQUIRE is set.
set -eu
cd "$(dirname "$0")/.."

baseline=benches/instructions.txt
allowed_percent=3
update=false profile=
case "$#:${1:-}" in
    0:) ;;
    1:--update) update=true ;;
    2:--profile) profile=$2 ;;
    *)
        echo "usage: tools/instructions.sh [--update | --profile NAME]" >&2
        exit 2
        ;;
esac

PATH="$HOME/.cargo/bin:$PATH"
CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$HOME/.cache/bevy_burrow/target}
export PATH CARGO_TARGET_DIR
tools/setup.sh instructions || true
if ! command -v valgrind >/dev/null 2>&1; then
    echo 'valgrind is not installed: instructions are not counted'
    [ -z "${BURROW_REQUIRE:-}" ]
    exit
fi

cargo bench --no-default-features --features cuda --bench instructions --no-run
# Cargo alone knows the binary's name.
bench=$(cargo bench --no-default-features --features cuda --bench instructions --no-run --message-format=json 2>/dev/null |
    sed -n 's/.*"name":"instructions".*"executable":"\([^"]*\)".*/\1/p')
counts=$(mktemp)
trap 'rm -f "$counts" "$counts.log"' EXIT

# callgrind NAME FILE: does a workload, and leaves in the file what each function did.
callgrind() {
    GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX512VL,-AVX512F,-AVX2,-AVX,-ERMS,-FSRM \
        valgrind --tool=callgrind --toggle-collect='*counted_workload*' --callgrind-out-file="$2" "$bench" "$1" 2>&1
}

if [ -n "$profile" ]; then
    if ! "$bench" | grep -qxF "$profile"; then
        echo "there is no workload $profile" >&2
        exit 2
    fi
    callgrind "$profile" "$counts" >"$counts.log" || { cat "$counts.log" >&2; exit 1; }
    callgrind_annotate --inclusive=yes "$counts" | sed -n 's/ \[[^]]*\]$//; /%).*bevy_burrow/s/???://p' | head -n 40
    exit 0
fi

# count NAME: the workload's name and its instructions.
count() {
    callgrind "$1" /dev/null |
        awk -v name="$1" '/Collected :/ { count = $NF } { last = $0 }
            END { if (!count) { print name ": " last > "/dev/stderr"; exit 1 } print name, count }'
}

for name in $("$bench"); do
    count "$name" >>"$counts"
done
LC_ALL=C sort -o "$counts" "$counts"
library=$(getconf GNU_LIBC_VERSION 2>/dev/null || echo 'another C library')
compiler="# instructions, $(rustc --version), $(rustc -vV | sed -n 's/^host: //p'), $library"

if $update; then
    { echo "$compiler"; cat "$counts"; } >"$baseline"
    cat "$baseline"
    exit 0
fi

fatal=1
if ! grep -qxF "$compiler" "$baseline"; then
    printf '%s\n%s\n' "$(head -n 1 "$baseline")" "$compiler"
    echo 'SKIPPED: another compiler or C library than those of the baseline, so nothing fails; --update makes a new one'
    fatal=0
fi
awk -v fatal="$fatal" -v allowed="$allowed_percent" '
    /^#/ { next }
    NR == FNR { baseline[$1] = $2; next }
    !($1 in baseline) { printf "%-22s %13d  not in the baseline\n", $1, $2; failed = 1; next }
    {
        change = 100 * ($2 / baseline[$1] - 1)
        verdict = change > allowed ? "  more than " allowed " %: FAILED" : change < -allowed ? "  better: --update keeps it" : ""
        printf "%-22s %13d  %+7.2f %%%s\n", $1, $2, change, verdict
        failed = failed || change > allowed
        delete baseline[$1]
    }
    END {
        for (name in baseline) { printf "%-22s in the baseline, but no workload\n", name; failed = 1 }
        exit failed && fatal
    }' "$baseline" "$counts"
