#!/usr/bin/env python3
"""A real device that is spoken to like the emulator, so that the tests of the kernels run on it:

    BURROW_EMULATOR=tools/emulator/device.py cargo test --no-default-features --features cuda --lib cuda

It loads src/backend/cuda/kernels.ptx. Needs the driver, and nothing else of CUDA. With BURROW_DEVICE_TIMES=1 it tells how
long each launch takes on the device, and what registers and shared memory the kernels use.
"""

import ctypes
import os
import pathlib
import struct
import sys
import time

PTX = pathlib.Path(__file__).resolve().parent.parent.parent / "src" / "backend" / "cuda" / "kernels.ptx"
KERNELS = [b"scatter", b"edit", b"mesh"]
THREADS = 128
RUBBISH = 0xA5
TIMES = os.environ.get("BURROW_DEVICE_TIMES") == "1"

cuda = ctypes.CDLL("libcuda.so.1")
word = ctypes.c_uint64


def call(name, *arguments):
    code = getattr(cuda, name)(*arguments)
    if code != 0:
        text = ctypes.c_char_p()
        cuda.cuGetErrorString(code, ctypes.byref(text))
        sys.exit(f"device: {name}: {(text.value or b'unknown error').decode()}")


def read(length):
    data = sys.stdin.buffer.read(length)
    if len(data) != length:
        sys.exit(0)
    return data


def words(count):
    return struct.unpack(f"<{count}Q", read(8 * count))


def answer(data):
    sys.stdout.buffer.write(data)
    sys.stdout.buffer.flush()


def start():
    """The kernels, and two events."""
    device, context, module = ctypes.c_int(), ctypes.c_void_p(), ctypes.c_void_p()
    call("cuInit", 0)
    call("cuDeviceGet", ctypes.byref(device), 0)
    call("cuDevicePrimaryCtxRetain", ctypes.byref(context), device)
    call("cuCtxSetCurrent", context)
    begin = time.perf_counter()
    call("cuModuleLoadData", ctypes.byref(module), PTX.read_bytes() + b"\0")
    if TIMES:
        print(f"device: kernels loaded in {(time.perf_counter() - begin) * 1000:.0f} ms", file=sys.stderr)
    functions = []
    for name in KERNELS:
        function = ctypes.c_void_p()
        call("cuModuleGetFunction", ctypes.byref(function), module, name)
        functions.append(function)
        if TIMES:
            tell_needs(name, function)
    events = [ctypes.c_void_p(), ctypes.c_void_p()]
    for event in events:
        call("cuEventCreate", ctypes.byref(event), 0)
    return functions, events


def tell_needs(name, function):
    value, told = ctypes.c_int(), []
    for what, attribute in [("shared bytes", 1), ("local bytes", 3), ("registers", 4)]:
        call("cuFuncGetAttribute", ctypes.byref(value), attribute, function)
        told.append(f"{value.value} {what}")
    blocks = ctypes.c_int()
    call("cuOccupancyMaxActiveBlocksPerMultiprocessor", ctypes.byref(blocks), function, THREADS, ctypes.c_size_t(0))
    print(f"device: {name.decode()}: {', '.join(told)}, {blocks.value} blocks at a time", file=sys.stderr)


def allocate(size):
    address = word()
    if cuda.cuMemAlloc_v2(ctypes.byref(address), ctypes.c_size_t(max(size, 16))) != 0:
        return 0
    call("cuMemsetD8_v2", address, ctypes.c_ubyte(RUBBISH), ctypes.c_size_t(max(size, 16)))
    return address.value


def launch(functions, events, kernel, blocks, params):
    # The driver copies as many bytes as the kernel's parameter has.
    block = ctypes.create_string_buffer(params, len(params))
    pointers = (ctypes.c_void_p * 1)(ctypes.addressof(block))
    call("cuEventRecord", events[0], None)
    if blocks > 0:
        sizes = [ctypes.c_uint(size) for size in (blocks, 1, 1, THREADS, 1, 1, 0)]
        call("cuLaunchKernel", functions[kernel], *sizes, None, pointers, None)
    call("cuEventRecord", events[1], None)
    call("cuCtxSynchronize")
    if TIMES:
        spent = ctypes.c_float()
        call("cuEventElapsedTime", ctypes.byref(spent), *events)
        print(f"device: {KERNELS[kernel].decode()}: {blocks} blocks in {spent.value * 1000:.1f} us", file=sys.stderr)


def main():
    functions, events = start()
    while True:
        (request,) = words(1)
        if request == 1:
            (size,) = words(1)
            answer(struct.pack("<Q", allocate(size)))
        elif request == 2:
            call("cuMemFree_v2", word(*words(1)))
        elif request == 3:
            address, length = words(2)
            call("cuMemcpyHtoD_v2", word(address), read(length), ctypes.c_size_t(length))
        elif request == 4:
            address, length = words(2)
            data = ctypes.create_string_buffer(max(length, 1))
            call("cuMemcpyDtoH_v2", data, word(address), ctypes.c_size_t(length))
            answer(data.raw[:length])
        elif request == 5:
            kernel, blocks, length = words(3)
            launch(functions, events, kernel, blocks, read(length))
            answer(struct.pack("<Q", 0))
        elif request == 6:
            address, length, byte = words(3)
            call("cuMemsetD8_v2", word(address), ctypes.c_ubyte(byte), ctypes.c_size_t(length))
        else:
            sys.exit(f"device: no such request: {request}")


if __name__ == "__main__":
    main()
