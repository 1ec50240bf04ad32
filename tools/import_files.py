#!/usr/bin/env python3
"""Writes the files of tests/fixtures/import, and what independent readers find in them.

Needs numpy, Pillow, tifffile, imagecodecs and OpenEXR. Run it from the repository's root after a change:

    python3 -m venv /tmp/venv && /tmp/venv/bin/pip install numpy Pillow tifffile imagecodecs OpenEXR
    /tmp/venv/bin/python tools/import_files.py

`table.json` lists each file with the options that it is read with, and either its size and the hash of its samples as
numpy, Pillow, tifffile or OpenEXR read them, or a word of the error that refuses it.
"""

import io
import json
import pathlib
import struct
import zlib

import numpy as np
import OpenEXR
import tifffile
from PIL import Image

FOLDER = pathlib.Path("tests/fixtures/import")
TABLE = []


def fnv(samples):
    """FNV-1a of the samples as f32, low byte first; every NaN alike."""
    samples = np.ascontiguousarray(samples, dtype="<f4").copy()
    samples[np.isnan(samples)] = np.float32(np.nan)
    words = samples.view("<u4").ravel()
    words[np.isnan(samples.ravel())] = 0x7FC00000
    state = 0xCBF29CE484222325
    for byte in words.tobytes():
        state = ((state ^ byte) * 0x100000001B3) & 0xFFFFFFFFFFFFFFFF
    return f"{state:016x}"


def keep(name, data, samples=None, error=None, notes=(), **options):
    """Writes a file, and enters what is expected of it."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    (FOLDER / name).write_bytes(data)
    entry = {"file": name, "options": {"voids": "keep", **options}}
    if error is None:
        height, width = samples.shape
        voids = int(np.isnan(np.asarray(samples, dtype="f8")).sum())
        entry |= {"width": width, "height": height, "hash": fnv(samples), "voids": voids, "notes": list(notes)}
    else:
        entry["error"] = error
    TABLE.append(entry)


def hills(width, height, seed=1, top=1.0):
    """Smooth ground, 0 to top."""
    z, x = np.mgrid[0:height, 0:width]
    ground = np.sin(x / 7.0 + seed) + np.cos(z / 5.0 - seed) + 0.5 * np.sin((x + 2 * z) / 11.0)
    ground -= ground.min()
    return ground / ground.max() * top


# --- PNG ---------------------------------------------------------------------------------------------------------

ADAM7 = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]
CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def packed(row, bits):
    """A row of samples as bytes."""
    if bits == 16:
        return row.astype(">u2").tobytes()
    if bits == 8:
        return row.astype("u1").tobytes()
    text = "".join(format(int(value), f"0{bits}b") for value in row)
    text += "0" * (-len(text) % 8)
    return bytes(int(text[at : at + 8], 2) for at in range(0, len(text), 8))


def paeth(a, b, c):
    p = a + b - c
    pa, pb, pc = abs(p - a), abs(p - b), abs(p - c)
    return a if pa <= pb and pa <= pc else b if pb <= pc else c


def filtered(rows, step, kinds):
    out, before = b"", bytes(len(rows[0]) if rows else 0)
    for number, row in enumerate(rows):
        kind = kinds[number % len(kinds)]
        line = bytearray()
        for at, byte in enumerate(row):
            a = row[at - step] if at >= step else 0
            b = before[at]
            c = before[at - step] if at >= step else 0
            line.append((byte - [0, a, b, (a + b) // 2, paeth(a, b, c)][kind]) & 255)
        out += bytes([kind]) + bytes(line)
        before = row
    return out


def png(pixels, bits, color, interlaced=False, palette=None, extra=b"", parts=1, kinds=(0, 1, 2, 3, 4), size=None):
    """A PNG by hand: `pixels` is (height, width, channels)."""
    height, width = pixels.shape[:2]
    step = max(1, CHANNELS[color] * bits // 8)
    image = b""
    if interlaced:
        for x, y, dx, dy in ADAM7:
            part = pixels[y::dy, x::dx]
            if part.size:
                image += filtered([packed(row.ravel(), bits) for row in part], step, kinds)
    else:
        image = filtered([packed(row.ravel(), bits) for row in pixels], step, kinds)
    data = zlib.compress(image, 9)
    cuts = [len(data) * part // parts for part in range(parts + 1)]
    width, height = size or (width, height)
    head = struct.pack(">IIBBBBB", width, height, bits, color, 0, 0, int(interlaced))
    out = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + extra
    if palette is not None:
        out += chunk(b"PLTE", bytes(palette))
    for low, high in zip(cuts, cuts[1:]):
        out += chunk(b"IDAT", data[low:high])
    return out + chunk(b"IEND", b"")


def by_pillow(data, bits):
    """Samples as Pillow reads them: fewer than 8 bits are widened by it, which is undone."""
    image = Image.open(io.BytesIO(data))
    image.load()
    if bits < 8 and image.mode in ("1", "L"):
        return np.asarray(image.convert("L"), dtype="u2") // (255 // (2**bits - 1))
    if image.mode == "P":
        return np.asarray(image.convert("RGB"))[:, :, 0]
    samples = np.asarray(image)
    return samples[:, :, 0] if samples.ndim == 3 else samples


def png_files():
    for interlaced in (False, True):
        name = "interlaced" if interlaced else "plain"
        for bits in (1, 2, 4, 8, 16):
            grey = np.rint(hills(21, 13, bits, 2**bits - 1)).astype("u2")[:, :, None]
            data = png(grey, bits, 0, interlaced)
            keep(f"grey_{bits}_{name}.png", data, by_pillow(data, bits))
        for bits in (1, 2, 4, 8):
            grey = np.linspace(3, 250, 2**bits).astype("u1")
            index = np.rint(hills(19, 11, bits, 2**bits - 1)).astype("u2")[:, :, None]
            data = png(index, bits, 3, interlaced, np.repeat(grey[:, None], 3, 1).tobytes())
            keep(f"palette_{bits}_{name}.png", data, by_pillow(data, 8), notes=["GreyAsColour"])
        for bits in (8, 16):
            grey = np.rint(hills(15, 17, bits, 2**bits - 1)).astype("u2")
            alpha = np.rint(hills(15, 17, 5, 2**bits - 1)).astype("u2")
            for color, planes, notes in [
                (4, [grey, alpha], ["AlphaIgnored"]),
                (2, [grey, grey, grey], ["GreyAsColour"]),
                (6, [grey, grey, grey, alpha], ["AlphaIgnored", "GreyAsColour"]),
            ]:
                data = png(np.stack(planes, 2), bits, color, interlaced)
                # Pillow reads colours of 16 bits as 8: numpy's own array stands for them.
                samples = by_pillow(data, bits) if bits == 8 else grey
                keep(f"type{color}_{bits}_{name}.png", data, samples, notes=notes)
    grey = np.rint(hills(16, 16, 3, 65535)).astype("u2")
    extra = chunk(b"gAMA", struct.pack(">I", 45455)) + chunk(b"pHYs", struct.pack(">IIB", 2835, 2835, 1))
    data = png(grey[:, :, None], 16, 0, extra=extra, parts=5)
    keep("grey_16_parts.png", data, by_pillow(data, 16))
    data = png(grey[:, :, None], 16, 0, extra=chunk(b"tRNS", struct.pack(">H", 0)))
    keep("grey_16_transparent.png", data, by_pillow(data, 16), notes=["AlphaIgnored"])
    for width, height in ((1, 9), (9, 1), (1, 1), (2, 2)):
        grey = np.rint(hills(width, height, 2, 1.0) * 60000).astype("u2") if width * height > 1 else np.full((1, 1), 7)
        data = png(np.nan_to_num(grey).astype("u2")[:, :, None], 16, 0, True)
        keep(f"grey_16_{width}x{height}.png", data, by_pillow(data, 16))
    good = png(np.rint(hills(33, 33, 3, 65535)).astype("u2")[:, :, None], 16, 0)
    keep("cut.png", good[: len(good) // 2], error="cannot be decoded")
    keep("only_header.png", good[:33], error="cannot be decoded")
    keep("signature.png", good[:8], error="cannot be decoded")
    keep("checksum.png", good[:-14] + bytes([good[-14] ^ 1]) + good[-13:], error="cannot be decoded")
    wide = png(np.zeros((4, 4, 1), "u2"), 16, 0, size=(100000, 100000))
    keep("vast.png", wide, error="the limit is")
    keep("short.png", png(np.zeros((4, 4, 1), "u2"), 16, 0, size=(4, 400)), error="cannot be decoded")
    keep("nothing.png", png(np.zeros((4, 4, 1), "u2"), 16, 0, size=(0, 4)), error="cannot be decoded")
    keep("bits.png", good[:24] + b"\x07" + good[25:29] + struct.pack(">I", zlib.crc32(good[12:24] + b"\x07" + good[25:29])) + good[33:], error="cannot be decoded")
    colours = np.zeros((5, 5, 3), "u2")
    colours[3, 2] = (9, 9, 8)
    keep("colours.png", png(colours, 8, 2), error="first at sample (2, 3)")
    index = np.zeros((5, 5, 1), "u2")
    index[1, 4] = 1
    keep("palette_colours.png", png(index, 8, 3, palette=[0, 0, 0, 9, 0, 0]), error="first at sample (4, 1)")
    index[1, 4] = 9
    keep("palette_beyond.png", png(index, 8, 3, palette=[0, 0, 0, 9, 9, 9]), error="cannot be decoded")


# --- TIFF --------------------------------------------------------------------------------------------------------


def tiff(samples, **settings):
    out = io.BytesIO()
    big = settings.pop("bigtiff", False)
    order = settings.pop("byteorder", "<")
    pages = settings.pop("pages", 1)
    with tifffile.TiffWriter(out, bigtiff=big, byteorder=order) as writer:
        for _ in range(pages):
            writer.write(samples, **settings)
    return out.getvalue()


def keep_tiff(name, samples, notes=(), error=None, **settings):
    data = tiff(samples, **settings)
    read = None
    if error is None:
        read = tifffile.TiffFile(io.BytesIO(data)).pages[0].asarray()
        read = read[:, :, 0] if read.ndim == 3 else read
    keep(name, data, read, error, notes)


def tiff_files():
    ground = hills(37, 29, 4)
    of = {
        "u1": np.rint(ground * 255).astype("u1"),
        "i1": np.rint(ground * 200 - 100).astype("i1"),
        "u2": np.rint(ground * 65535).astype("u2"),
        "i2": np.rint(ground * 5000 - 400).astype("i2"),
        "u4": np.rint(ground * 65535 * 256).astype("u4"),
        "i4": np.rint(ground * 8e6 - 2e6).astype("i4"),
        "f2": (ground * 900).astype("f2"),
        "f4": (ground * 3000 - 111.125).astype("f4"),
        "f8": (ground * 3000).astype("f4").astype("f8"),
    }
    for kind, samples in of.items():
        for order, big in (("<", False), (">", False), ("<", True), (">", True)):
            name = f"{'big_' if big else ''}{kind}_{'le' if order == '<' else 'be'}.tif"
            keep_tiff(name, samples, byteorder=order, bigtiff=big)
    for kind in ("u2", "f4"):
        samples = of[kind]
        for compression in ("lzw", "zlib", "packbits"):
            keep_tiff(f"{kind}_{compression}.tif", samples, compression=compression)
        for compression in ("lzw", "zlib"):
            keep_tiff(f"{kind}_{compression}_predictor.tif", samples, compression=compression, predictor=True)
        keep_tiff(f"{kind}_strips.tif", samples, rowsperstrip=5)
        keep_tiff(f"{kind}_tiles.tif", samples, tile=(16, 16))
        keep_tiff(f"{kind}_tiles_zlib.tif", samples, tile=(16, 32), compression="zlib", predictor=True)
    keep_tiff("pages.tif", of["u2"], pages=3, notes=["FirstOfSeveral"])
    keep_tiff("equal_rgb.tif", np.stack([of["u1"]] * 3, 2), photometric="rgb", notes=["GreyAsColour"])
    other = np.stack([of["u1"]] * 3, 2)
    other[2, 3, 1] ^= 1
    keep_tiff("other_rgb.tif", other, photometric="rgb", error="first at sample (3, 2)")
    keep_tiff("two_bands.tif", np.stack([of["f4"]] * 2, 2), photometric="minisblack", planarconfig="contig", error="channels Multiband")
    keep_tiff("zstd.tif", of["u2"], compression="zstd", error="cannot be decoded")
    holes = of["f4"].copy()
    holes[3, 4] = holes[10, 11] = -9999.0
    tags = [
        (33550, "d", 3, (30.0, 30.0, 0.0), True),
        (33922, "d", 6, (0.0, 0.0, 0.0, 500000.0, 4600000.0, 0.0), True),
        (42113, "s", 6, "-9999", True),
    ]
    data = tiff(holes, extratags=tags)
    voids = holes.copy()
    voids[voids == -9999.0] = np.nan
    keep("geo.tif", data, voids)
    nan = of["f4"].copy()
    nan[5, 6] = np.nan
    keep_tiff("nan.tif", nan)
    good = tiff(of["f4"])
    for share in (1, 2, 3):
        keep(f"cut_{share}.tif", good[: len(good) * share // 4], error="")
    keep("only_header.tif", good[:8], error="cannot be decoded")


# --- EXR ---------------------------------------------------------------------------------------------------------


def exr(name, channels, compression=OpenEXR.ZIP_COMPRESSION, error=None, notes=(), chosen=None):
    path = "/tmp/import_file.exr"
    header = {"compression": compression, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(path)
    data = pathlib.Path(path).read_bytes()
    read = None
    if error is None:
        found = OpenEXR.File(path, separate_channels=True).channels()
        read = found[chosen or next(iter(channels))].pixels
    keep(name, data, read, error, notes)


def exr_files():
    ground = hills(31, 23, 6, 900.0)
    single, half, whole = ground.astype("f4"), ground.astype("f2"), np.rint(ground * 1000).astype("u4")
    for compression in ("NO", "RLE", "ZIPS", "ZIP", "PIZ"):
        exr(f"y_{compression.lower()}.exr", {"Y": single}, getattr(OpenEXR, f"{compression}_COMPRESSION"))
    exr("y_half.exr", {"Y": half})
    exr("y_uint.exr", {"Y": whole})
    exr("r_only.exr", {"R": single})
    exr("odd_name.exr", {"elevation": single})
    exr("equal_rgb.exr", {"R": single, "G": single, "B": single}, notes=["GreyAsColour"], chosen="R")
    exr("with_alpha.exr", {"Y": single, "A": half}, notes=["AlphaIgnored"])
    other = single.copy()
    other[4, 5] += 1
    exr("other_rgb.exr", {"R": single, "G": other, "B": single}, error="first at sample (5, 4)")
    exr("two.exr", {"left": single, "right": single}, error="channels left, right")
    good = (FOLDER / "y_zip.exr").read_bytes()
    keep("cut.exr", good[: len(good) // 2], error="cannot be decoded")
    keep("only_header.exr", good[:8], error="cannot be decoded")


# --- RAW, HGT, ASCII ---------------------------------------------------------------------------------------------


def raw_files():
    square, wide = hills(32, 32, 2), hills(48, 20, 3)
    of = {
        "u2": (lambda g: np.rint(g * 65535), {"Unsigned": 16}),
        "i2": (lambda g: np.rint(g * 6000 - 3000), {"Signed": 16}),
        "u4": (lambda g: np.rint(g * 65535) * 256, {"Unsigned": 32}),
        "i4": (lambda g: (np.rint(g * 60000) - 30000) * 128, {"Signed": 32}),
        "f4": (lambda g: g * 1000, {"Float": 32}),
    }
    for kind, (make, sample) in of.items():
        for order, name in (("<", "LittleEndian"), (">", "BigEndian")):
            end = name[0].lower()
            ground = make(wide).astype(order + kind)
            raw = {"size": [48, 20], "sample": sample, "byte_order": name}
            keep(f"{kind}_{end}e_said.raw", ground.tobytes(), ground, raw=raw)
            guessed = ["SampleGuessed", "SizeGuessed", {"ByteOrderGuessed": order == ">"}]
            ground = make(square).astype(order + kind)
            keep(f"{kind}_{end}e_guessed.raw", ground.tobytes(), ground, notes=guessed)
    ground = of["u2"][0](wide).astype("<u2")
    keep("wide_guessed.raw", ground.tobytes(), ground, notes=["SizeGuessed"])
    keep("header.raw", b"some header." + ground.tobytes(), ground, raw={"header": 12, "size": [48, 20]})
    keep("bottom_up.raw", ground[::-1].tobytes(), ground, raw={"size": [48, 20], "is_bottom_up": True})
    keep("transposed.raw", ground.tobytes(), ground.reshape(48, 20), raw={"size": [20, 48]}, notes=["LooksTransposed"])
    swapped = ground.byteswap()
    keep("swapped.raw", ground.tobytes(), swapped, raw={"size": [48, 20], "sample": {"Unsigned": 16}, "byte_order": "BigEndian"}, notes=["LooksByteSwapped"])
    keep("odd_length.raw", ground.tobytes()[:-1], error="no size and sample type fit")
    keep("prime.raw", of["u2"][0](hills(1009, 1, 2)).astype("<u2").tobytes(), error="no size and sample type fit")
    keep("wrong_size.raw", ground.tobytes(), raw={"size": [48, 21]}, error="correct `RawLayout::size`")
    keep("empty.raw", b"", error="no samples")
    holes = np.rint(hills(25, 25, 7, 2400) - 30).astype(">i2")
    holes[3:5, 7] = -32768
    found = holes.astype("f4")
    found[found == -32768] = np.nan
    keep("N46E007.hgt", holes.tobytes(), found, format="Hgt")
    keep("odd.hgt", holes.tobytes()[:-2], error="neither square", format="Hgt")


def ascii_files():
    ground = np.round(hills(13, 9, 8, 1500) - 100, 2)
    head = "ncols 13\nnrows 9\nxllcorner 500000\nyllcorner 4600000\ncellsize 25\nNODATA_value -9999\n"

    def text(samples, form="%.2f", split=" "):
        return "".join(split.join(form % value for value in row) + "\n" for row in samples)

    def kept(name, data, samples=None, **more):
        if samples is None and "error" not in more:
            skip = sum(line[:1].isalpha() for line in data.decode("utf-8-sig").splitlines())
            samples = np.array(data.decode("utf-8-sig").split("\n", skip)[skip].split(), dtype="f8").reshape(9, 13)
            samples[samples == -9999] = np.nan
        keep(name, data, samples, **more)

    good = (head + text(ground)).encode()
    kept("plain.asc", good)
    kept("windows.asc", good.replace(b"\n", b"\r\n"))
    kept("marked.asc", b"\xef\xbb\xbf" + good)
    kept("capitals.asc", good.replace(b"ncols", b"NCOLS").replace(b"cellsize", b"CELLSIZE"))
    kept("one_line.asc", (head + " ".join("%.2f" % value for value in ground.ravel())).encode())
    kept("exponents.asc", (head + text(ground, "%.6e", "\t")).encode())
    kept("centre.asc", good.replace(b"xllcorner", b"xllcenter").replace(b"yllcorner", b"yllcenter"))
    kept("dx_dy.asc", good.replace(b"cellsize 25", b"dx 25\ndy 30"))
    holes = ground.copy()
    holes[2, 3] = holes[8, 12] = -9999
    kept("voids.asc", (head + text(holes)).encode())
    kept("without_void_value.asc", (head.replace("NODATA_value -9999\n", "") + text(holes)).encode())
    kept("comma.asc", (head + text(ground).replace(".", ",")).encode(), error="decimal comma")
    kept("short.asc", good[:-30], error="ends after")
    kept("long.asc", good + b"5 6\n", error="continues after 117 samples")
    kept("no_rows.asc", good.replace(b"nrows 9\n", b""), error="without nrows")
    kept("word.asc", good.replace(b"\n", b"\nbogus 3\n", 1), error="unknown name")
    kept("letters.asc", good[:-9] + b"1.2x3\n", error="in place of a number")
    kept("vast.asc", good.replace(b"ncols 13", b"ncols 4000000000"), error="the limit is")
    kept("nan_size.asc", good.replace(b"ncols 13", b"ncols nan"), error="as ncols")


def other_files():
    for name, data, error in [
        ("photo.jpg", b"\xff\xd8\xff\xe0" + bytes(range(200)), "a JPEG"),
        ("packed.zip", b"PK\x03\x04" + bytes(100), "a ZIP archive"),
        ("packed.gz", b"\x1f\x8b\x08" + bytes(100), "a gzip archive"),
        ("page.html", b"<html><body>404 not found</body></html>", "HTML"),
        ("notes.txt", b"These are only words, no heights at all.\n", "a text"),
        ("pointer.tif", b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n", "Git LFS"),
        ("data.h5", b"\x89HDF\r\n\x1a\n" + bytes(100), "an HDF file"),
        ("image.webp", b"RIFF" + bytes(100), "RIFF"),
    ]:
        keep(name, data, error=error)


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    for old in FOLDER.iterdir():
        old.unlink()
    png_files()
    tiff_files()
    exr_files()
    raw_files()
    ascii_files()
    other_files()
    lines = ",\n".join(json.dumps(entry) for entry in TABLE)
    (FOLDER / "table.json").write_text(f"[\n{lines}\n]\n")
    print(len(TABLE), "files")
