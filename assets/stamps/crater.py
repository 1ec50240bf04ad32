#!/usr/bin/env python3
"""Makes crater.png, which lies beside it: a rim, a peak in the middle, rays of what was thrown out; 16 bits of grey.

    python3 assets/stamps/crater.py
"""

import math
import pathlib
import random
import struct
import zlib

SIDE = 96
random.seed(19)
RAYS = [(random.uniform(0, math.tau), random.uniform(0.06, 0.16), random.uniform(0.3, 0.7)) for _ in range(11)]
WAVES = [(lobes, random.uniform(0, math.tau), 0.03 / math.sqrt(lobes)) for lobes in (2, 3, 5, 8, 13)]


def height(x, y):
    """0 to 1 at a place from -1 to 1: 0 on the floor and at the image's border, 1 on the rim."""
    far, angle = math.hypot(x, y), math.atan2(y, x)
    rim = 0.46 + sum(depth * math.sin(lobes * angle + phase) for lobes, phase, depth in WAVES)
    if far < rim:
        return max(0.9 * (far / rim) ** 5, 0.5 * math.exp(-((far / 0.11) ** 2)))
    thrown = 0.9 * (rim / far) ** 4
    for toward, width, strength in RAYS:
        beside = math.remainder(angle - toward, math.tau) / width
        thrown += strength * math.exp(-(beside**2)) * (1 - rim / far)
    fade = min(max((1 - far) / 0.35, 0), 1)
    return thrown * fade * fade * (3 - 2 * fade)


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


places = [2 * at / (SIDE - 1) - 1 for at in range(SIDE)]
rows = b"".join(
    # Each row opens with its filter: none.
    b"\0" + b"".join(struct.pack(">H", round(65535 * min(height(x, y), 1))) for x in places)
    for y in places
)
header = struct.pack(">IIBBBBB", SIDE, SIDE, 16, 0, 0, 0, 0)
png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")
pathlib.Path(__file__).with_suffix(".png").write_bytes(png)
