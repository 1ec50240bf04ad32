#!/usr/bin/env python3
"""Compiles src/backend/cuda/kernels.cu, with what it includes, to the PTX that the crate embeds. Needs no GPU.

    tools/ptx.py            writes src/backend/cuda/kernels.ptx
    tools/ptx.py --check    compares instead, and fails where they differ

The compiler is NVRTC of CUDA 12.0, always the same version, so that the result is the same on every machine. Where it is
missing, pip installs it into ~/.cache/bevy_burrow/nvrtc; BURROW_NVRTC names another folder.
"""

import argparse
import ctypes
import difflib
import os
import pathlib
import subprocess
import sys

WHEEL = "nvidia-cuda-nvrtc-cu12==12.0.140"
VERSION = (12, 0)
LIBRARY = "nvidia/cuda_nvrtc/lib/libnvrtc.so.12"
FOLDER = pathlib.Path(__file__).resolve().parent.parent / "src" / "backend" / "cuda"
# PTX 8.0 for Turing and later; the driver compiles it for the device it has. The last four: exactly rounded, nothing
# fused, as on the CPU.
OPTIONS = [
    "--gpu-architecture=compute_75",
    "--std=c++17",
    "--fmad=false",
    "--prec-div=true",
    "--prec-sqrt=true",
    "--ftz=false",
]


def fail(message):
    sys.exit(f"tools/ptx.py: {message}")


def compiler():
    """The library, installed if it is missing."""
    default = pathlib.Path.home() / ".cache" / "bevy_burrow" / "nvrtc"
    folder = pathlib.Path(os.environ.get("BURROW_NVRTC") or default)
    path = folder / LIBRARY
    if not path.exists():
        pip = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
        if subprocess.run([*pip, "--version"], capture_output=True).returncode != 0:
            fail(f"{WHEEL} is not in {folder}, and this Python has no pip to install it with (Debian: python3-pip)")
        print(f"Installing {WHEEL} into {folder}", file=sys.stderr)
        install = [*pip, "install", "--quiet", "--no-deps", "--only-binary=:all:", "--target", str(folder), WHEEL]
        if subprocess.run(install).returncode != 0 or not path.exists():
            fail(f"pip could not install {WHEEL}")
    try:
        nvrtc = ctypes.CDLL(str(path))
    except OSError as error:
        fail(f"NVRTC does not run on this machine: {error}")
    major, minor = ctypes.c_int(), ctypes.c_int()
    if nvrtc.nvrtcVersion(ctypes.byref(major), ctypes.byref(minor)) != 0 or (major.value, minor.value) != VERSION:
        fail(f"{path} is NVRTC {major.value}.{minor.value}, and {VERSION[0]}.{VERSION[1]} is needed")
    return nvrtc


def compiled():
    """The sources as PTX."""
    nvrtc = compiler()
    nvrtc.nvrtcGetErrorString.restype = ctypes.c_char_p

    def call(name, *arguments):
        code = getattr(nvrtc, name)(*arguments)
        if code != 0:
            fail(f"{name}: {nvrtc.nvrtcGetErrorString(code).decode()}")

    def text(kind):
        size = ctypes.c_size_t()
        call(f"nvrtcGet{kind}Size", program, ctypes.byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        call(f"nvrtcGet{kind}", program, buffer)
        return buffer.value.decode()

    def strings(values):
        return (ctypes.c_char_p * len(values))(*(value.encode() for value in values))

    # By the names that sources include them by, so that no path of this machine goes into the PTX.
    headers = {}
    for path in sorted((FOLDER / "kernels").glob("*.cuh")):
        headers[path.name] = headers[f"kernels/{path.name}"] = path.read_text()
    texts, names = strings(list(headers.values())), strings(list(headers))
    program, source = ctypes.c_void_p(), (FOLDER / "kernels.cu").read_text()
    call("nvrtcCreateProgram", ctypes.byref(program), source.encode(), b"kernels.cu", len(headers), texts, names)
    options = strings(OPTIONS)
    code = nvrtc.nvrtcCompileProgram(program, len(OPTIONS), options)
    log = text("ProgramLog").strip()
    if log:
        print(log, file=sys.stderr)
    if code != 0:
        fail("kernels.cu does not compile")
    return text("PTX")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    check = parser.parse_args().check
    target = FOLDER / "kernels.ptx"
    fresh = compiled()
    if not check:
        target.write_text(fresh)
        return
    kept = target.read_text() if target.exists() else ""
    if kept != fresh:
        lines = difflib.unified_diff(kept.splitlines(), fresh.splitlines(), "kernels.ptx", "compiled now", lineterm="")
        print("\n".join(list(lines)[:40]))
        fail("kernels.ptx is not what kernels.cu compiles to; run `make ptx` and commit the result")
    print("kernels.ptx is what kernels.cu compiles to")


if __name__ == "__main__":
    main()
