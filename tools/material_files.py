#!/usr/bin/env python3
"""Writes the files of tests/fixtures/materials, and what numpy and Pillow find in them.

Needs numpy and Pillow. Run it from the repository's root after a change:

    python3 -m venv /tmp/venv && /tmp/venv/bin/pip install numpy Pillow
    /tmp/venv/bin/python tools/material_files.py

`table.json` lists splat maps and id maps with their options, and the base, overlay and blend of every sample as bytes in
a row, in hexadecimal FNV-1a; or a word of the error that refuses them.
"""

import io
import json
import pathlib
import struct
import zlib

import numpy as np
from PIL import Image

FOLDER = pathlib.Path("tests/fixtures/materials")
TABLE = []


def fnv(data):
    state = 0xCBF29CE484222325
    for byte in data:
        state = ((state ^ byte) * 0x100000001B3) & 0xFFFFFFFFFFFFFFFF
    return f"{state:016x}"


def keep(name, data):
    (FOLDER / name).write_bytes(data)
    return name


def pillow(array, mode=None):
    file = io.BytesIO()
    Image.fromarray(array, mode).save(file, "PNG")
    return file.getvalue()


def png16(array):
    """A PNG of 16 bits with any number of channels, which Pillow does not write."""
    height, width, channels = array.shape
    color = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    rows = b"".join(b"\0" + array[z].astype(">u2").tobytes() for z in range(height))
    chunk = lambda kind, body: struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    head = struct.pack(">IIBBBBB", width, height, 16, color, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def read_by_pillow(data):
    """The channels of an 8-bit file as Pillow reads them, as 16 bits."""
    array = np.asarray(Image.open(io.BytesIO(data)))
    array = array.reshape(array.shape[0], array.shape[1], -1)
    return array.astype(np.uint32) * 257


def splats(name, files, layers, deep=None, weights=None, error=None, notes=()):
    names = [keep(f"{name}_{number}.png", data) for number, data in enumerate(files)]
    entry = {"splats": names, "layers": layers, "deep": deep, "notes": list(notes)}
    if error:
        TABLE.append(entry | {"error": error})
        return
    if weights is None:
        weights = np.concatenate([read_by_pillow(data) for data in files], axis=2)
    height, width, _ = weights.shape
    used = [channel for channel, layer in enumerate(layers) if layer is not None]
    own = weights[:, :, used].astype(np.int64)
    ids = np.array([layers[channel] for channel in used])
    # The first of the greatest, as argmax has it.
    first = own.argmax(axis=2)
    most = np.take_along_axis(own, first[:, :, None], 2)[:, :, 0]
    rest = own.copy()
    np.put_along_axis(rest, first[:, :, None], -1, 2)
    second = rest.argmax(axis=2)
    next_most = np.take_along_axis(rest, second[:, :, None], 2)[:, :, 0].clip(0)
    strongest, other = ids[first], ids[second]
    blend = np.where(next_most > 0, next_most * 255 // np.maximum(most + next_most, 1), 0)
    if deep is not None:
        columns = np.stack([np.full_like(strongest, deep), strongest, np.full_like(strongest, 255)], 2)
    else:
        columns = np.stack([strongest, np.where(next_most > 0, other, strongest), blend], 2)
    TABLE.append(entry | {"width": width, "height": height, "hash": fnv(columns.astype(np.uint8).tobytes())})


def ids(name, data, materials=None, ids=(), colours=(), deep=None, error=None):
    entry = {"ids": keep(f"{name}.png", data), "of": list(ids), "colours": list(colours), "deep": deep, "notes": []}
    if error:
        TABLE.append(entry | {"error": error})
        return
    height, width = materials.shape
    base = materials if deep is None else np.full_like(materials, deep)
    blend = np.full_like(materials, 0 if deep is None else 255)
    columns = np.stack([base, materials, blend], 2).astype(np.uint8)
    TABLE.append(entry | {"width": width, "height": height, "hash": fnv(columns.tobytes())})


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(5)
    byte = lambda *size: random.integers(0, 256, size, dtype=np.uint8)
    rgba = lambda: byte(9, 13, 4)
    splats("one", [pillow(rgba())], [1, 2, 3, 4])
    splats("deep", [pillow(rgba())], [1, 2, 3, 4], deep=7)
    splats("four", [pillow(rgba()) for _ in range(4)], list(range(16)))
    splats("ignored", [pillow(rgba()), pillow(rgba())], [1, None, 3, 4, None, 6], notes=["LayerMissing"])
    splats("colours", [pillow(byte(7, 5, 3)), pillow(byte(7, 5, 3))], [9, 8, 7, 6, 5, 4])
    splats("masks", [pillow(byte(6, 6)) for _ in range(3)], [10, 11, 12])
    # Few values: many samples have equal weights.
    splats("ties", [pillow(random.integers(0, 3, (16, 16, 4), dtype=np.uint8) * 85)], [4, 3, 2, 1], notes=["NoWeight"])
    opaque = byte(5, 5, 4)
    opaque[:, :, 3] = 255
    splats("opaque", [pillow(opaque)], [1, 2, 3, 4], notes=["LooksOpaque"])
    splats("not_opaque", [pillow(opaque)], [1, 2, 3, None])
    empty = byte(5, 5, 4)
    empty[:, :, 1] = 0
    splats("empty", [pillow(empty)], [1, 2, 3, 4], notes=["LayerEmpty"])
    wide = random.integers(0, 65536, (5, 8, 4), dtype=np.uint16)
    splats("wide", [png16(wide)], [1, 2, 3, 4], weights=wide)
    grey = random.integers(0, 65536, (5, 8, 2), dtype=np.uint16)
    both = np.concatenate([wide, grey[:, :, :1]], axis=2)
    splats("mixed", [png16(wide), png16(grey)], [1, 2, 3, 4, 5], weights=both, notes=["AlphaIgnored"])
    narrow = byte(5, 8)
    splats(
        "bits", [png16(wide), pillow(narrow)], [1, 2, 3, 4, 5],
        weights=np.concatenate([wide.astype(np.uint32), narrow[:, :, None].astype(np.uint32) * 257], axis=2),
    )
    splats("sizes", [pillow(rgba()), pillow(byte(9, 12, 4))], [1, 2], error="is 12 x 9, but the first is 13 x 9")
    splats("few", [pillow(byte(4, 4, 3))], [1, 2, 3, 4], error="name a material or `None`")
    splats("many", [pillow(rgba()) for _ in range(5)], list(range(17)), error="1 to 16 layers")
    splats("none", [pillow(rgba())], [None, None], error="1 to 16 layers")
    splats("ground", [pillow(rgba())], [1, 255], error="0 to 254")
    indexed = Image.fromarray(byte(6, 6) % 4, "P")
    indexed.putpalette([0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0, 255])
    file = io.BytesIO()
    indexed.save(file, "PNG")
    splats("palette", [file.getvalue()], [1], error="palette")
    splats("cut", [pillow(rgba())[:120]], [1], error="decoded")
    splats("no_png", [b"P5 3 3 255 123456789"], [1], error="not a PNG file")
    splats("nothing", [b""], [1], error="no samples")

    kinds = byte(11, 6) % 9
    ids("plain_ids", pillow(kinds), kinds)
    ids("deep_ids", pillow(kinds), kinds, deep=3)
    named = [[number, 20 + number] for number in range(9)]
    ids("named_ids", pillow(kinds), kinds + 20, ids=named)
    ids("unnamed_ids", pillow(kinds), ids=named[:4], error="has no material")
    pixels = np.asarray(indexed)
    ids("palette_ids", file.getvalue(), pixels)
    table = [[[0, 0, 0], 5], [[255, 0, 0], 6], [[0, 255, 0], 7], [[0, 0, 255], 8]]
    ids("palette_colours", file.getvalue(), pixels + 5, colours=table)
    ids("true_colours", pillow(np.asarray(indexed.convert("RGB"))), pixels + 5, colours=table)
    ids("unknown_colour", pillow(np.asarray(indexed.convert("RGB"))), colours=table[:2], error="the colour (0, ")
    classes = random.integers(0, 3, (4, 7), dtype=np.uint16) * 1000
    ids("wide_ids", png16(classes[:, :, None]), classes // 1000 + 1, ids=[[0, 1], [1000, 2], [2000, 3]])
    ids("too_wide_ids", png16(classes[:, :, None]), error="has no material")
    (FOLDER / "table.json").write_text(json.dumps(TABLE, indent=1) + "\n")
    print(len(TABLE), "entries,", sum(file.stat().st_size for file in FOLDER.iterdir()), "bytes")


main()
