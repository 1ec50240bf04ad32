#!/bin/sh
# Installs what this machine lacks for building and running bevy_burrow; with nothing missing it only looks.
#
#   tools/setup.sh build          compiler, linker, Rust
#   tools/setup.sh run            the same, and what it takes to draw: Vulkan, and X11 libraries where a display is set
#   tools/setup.sh test           the same as run, and a C++ compiler, with which CUDA kernels are tested without a GPU
#   tools/setup.sh drive          the same as run, and what plays the examples: Python, Xvfb, xdotool
#   tools/setup.sh lint           the same as build, and rustfmt and clippy
#   tools/setup.sh peers          the same as build, and Python for the meshers that ours is compared with
#   tools/setup.sh ptx            Python, whose package index has the compiler of the CUDA kernels
#   tools/setup.sh instructions   the same as build, and valgrind, which counts instructions
#   tools/setup.sh skipped        nothing: says which tests find nothing to run on here, and pass for that
#
# With MORE=gamepad or MORE=sound in the environment, also what the feature of that name is compiled with.
#
# Debian and its kin: uses apt-get, as root or with sudo, and the official Rust installer. Elsewhere it says what to
# install. Else compiling needs no -dev packages.
set -eu

wanted_rust=1.95
goal=${1:-build}
PATH="$HOME/.cargo/bin:$PATH:/usr/sbin:/sbin"
packages=

say() { printf 'setup: %s\n' "$*" >&2; }
die() { say "$*"; exit 1; }
has() { command -v "$1" >/dev/null 2>&1; }
want() { case " $packages " in *" $1 "*) ;; *) packages="$packages $1" ;; esac; }

# want_library FILE PACKAGE: the package, unless the linker knows the library.
want_library() { ldconfig -p 2>/dev/null | grep -q "$1" || want "$2"; }

has_vulkan_driver() {
    for driver in /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json; do
        [ -e "$driver" ] && return 0
    done
    return 1
}

# Whether certificates are installed; only Linux keeps them in files.
has_certificates() {
    [ "$(uname -s)" = Linux ] || return 0
    for bundle in /etc/ssl/certs/ca-certificates.crt /etc/pki/tls/certs/ca-bundle.crt /etc/ssl/cert.pem; do
        [ -e "$bundle" ] && return 0
    done
    return 1
}

# Without permission to install, it lists what is missing and continues: the machine may have it under another name.
install_packages() {
    [ -n "$packages" ] || return 0
    root=
    [ "$(id -u)" -eq 0 ] || root=sudo
    if ! has apt-get || { [ -n "$root" ] && ! has "$root"; }; then
        say "please install (names as in Debian):$packages"
        return 0
    fi
    say "installing$packages"
    # One source of several may be out of order without being needed.
    $root apt-get update -qq || say "apt-get update failed; going on with the lists there are"
    # The names are words of this script.
    # shellcheck disable=SC2086
    $root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y -o Dpkg::Use-Pty=0 --no-install-recommends \
        $packages >/dev/null </dev/null || say "that failed; please install (names as in Debian):$packages"
}

rust_version() { rustc --version 2>/dev/null | sed -n 's/^rustc \([0-9]*\.[0-9]*\).*/\1/p'; }

# rust_is_new_enough: is rustc there, and at least the wanted version?
rust_is_new_enough() {
    have=$(rust_version)
    if [ -z "$have" ] || ! has cargo; then return 1; fi
    [ "${have%.*}" -gt "${wanted_rust%.*}" ] ||
        { [ "${have%.*}" -eq "${wanted_rust%.*}" ] && [ "${have#*.}" -ge "${wanted_rust#*.}" ]; }
}

install_rust() {
    rust_is_new_enough && return 0
    if has rustup && [ -z "$(rust_version)" ]; then
        die "rustup has no toolchain: run 'rustup default stable'"
    elif has rustup; then
        die "rustc is $(rust_version), but $wanted_rust is the least: run 'rustup update stable'"
    fi
    say "installing Rust for $(id -un) with its official installer"
    installer=$(mktemp)
    trap 'rm -f "$installer"' EXIT
    curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs -o "$installer" || die "the Rust installer cannot be had"
    RUSTUP_INIT_SKIP_PATH_CHECK=yes sh "$installer" -y --quiet --profile minimal --component rustfmt \
        --component clippy </dev/null
    rust_is_new_enough || die "rustc is '$(rust_version)' after installing, but $wanted_rust is the least"
}

# add_component NAME: what cargo calls so, from rustup; a distribution's Rust has it as a package.
add_component() {
    cargo "$1" --version >/dev/null 2>&1 && return 0
    has rustup || die "'cargo $1' is missing, and there is no rustup to add it"
    case $1 in fmt) rustup component add rustfmt ;; *) rustup component add "$1" ;; esac
}

# Reports skipped tests at the end of a run.
tell_skipped() {
    if ! nvidia-smi -L >/dev/null 2>&1 && { [ "$(uname -s)" != Linux ] || ! { has "${CXX:-c++}" || has g++ || has clang++; }; }; then
        say '*** SKIPPED: CUDA kernels were not tested: neither a GPU nor, on Linux, a C++ compiler (g++) for the emulator ***'
    fi
    if [ "$(uname -s)" = Linux ] && [ -z "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] && ! has_vulkan_driver; then
        say '*** SKIPPED: no picture was compared: no Vulkan driver (mesa-vulkan-drivers) ***'
    fi
    for program in Xvfb xdotool; do
        has "$program" || say "*** SKIPPED: the examples were not played by mouse and keys: no $program ***"
    done
}

case $goal in
    build | run | test | drive | lint | peers | ptx | instructions) ;;
    skipped)
        tell_skipped
        exit 0
        ;;
    *) die "unknown goal '$goal': build, run, test, drive, lint, peers, ptx, instructions or skipped" ;;
esac

has make || want make
if ! has cc; then
    want gcc
    want libc6-dev
fi
if ! rust_is_new_enough && ! has rustup; then
    has curl || want curl
    has_certificates || want ca-certificates
fi
if [ "$goal" = lint ] && rust_is_new_enough && ! has rustup; then
    cargo fmt --version >/dev/null 2>&1 || want rustfmt
    cargo clippy --version >/dev/null 2>&1 || want rust-clippy
fi
if [ "$goal" = test ]; then
    has c++ || want g++
    goal=run
fi
if [ "$goal" = drive ]; then
    has python3 || want python3
    has Xvfb || want xvfb
    has xdotool || want xdotool
    goal=run
fi
if [ "$goal" = run ] && [ "$(uname -s)" = Linux ]; then
    want_library libvulkan.so.1 libvulkan1
    # Any driver will do; without one, Mesa brings a software renderer too.
    has_vulkan_driver || want mesa-vulkan-drivers
    if [ -n "${DISPLAY:-}" ]; then
        want_library libX11.so.6 libx11-6
        want_library libX11-xcb.so.1 libx11-xcb1
        want_library libXcursor.so.1 libxcursor1
        want_library libXi.so.6 libxi6
        want_library libxcb.so.1 libxcb1
        want_library libxkbcommon.so.0 libxkbcommon0
        want_library libxkbcommon-x11.so.0 libxkbcommon-x11-0
    fi
fi
case ${MORE:-} in *gamepad*)
    has pkg-config || want pkg-config
    [ -e /usr/include/libudev.h ] || want libudev-dev
    ;;
esac
case ${MORE:-} in *sound*)
    has pkg-config || want pkg-config
    pkg-config --exists alsa 2>/dev/null || want libasound2-dev
    ;;
esac
if [ "$goal" = peers ]; then
    has python3 || want python3
    python3 -c 'import ensurepip, venv' 2>/dev/null || want python3-venv
fi
if [ "$goal" = ptx ]; then
    has python3 || want python3
    python3 -c 'import pip' 2>/dev/null || want python3-pip
fi
if [ "$goal" = instructions ]; then
    has valgrind || want valgrind
fi
install_packages
[ "$goal" != ptx ] || exit 0
has cc || die "a C compiler and linker is missing"
install_rust
if [ "$goal" = lint ]; then
    add_component fmt
    add_component clippy
fi
