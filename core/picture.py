"""Whether a picture may be decoded: its size, and whether it is whole.

Decoders do not tell: they patch up what is cut off, and take the memory that a header
asks for.
"""

from __future__ import annotations

import re
import struct
import zlib
from typing import Any

from .errors import MagbendError, VisionError
from .jpeg import is_damaged

MAX_PIXELS = 64_000_000
_MOST_PAGES = 1000
_PNM = re.compile(rb"P[1-6](?:\s|#[^\n]*\n)+(\d{1,9})(?:\s|#[^\n]*\n)+(\d{1,9})\s")

PNG = b"\x89PNG\r\n\x1a\n"
JPEG = b"\xff\xd8"
DAMAGED = "{source}: the picture is cut off or damaged; copy it from the camera again"
_MARKER = re.compile(rb"\xff+[^\x00\xff\xd0-\xd7]")
"""A marker between coded data: no stuffed zero, no restart."""


def check_whole(
    data: bytes, source: str, kind: type[MagbendError] = VisionError
) -> None:
    """Refuse a picture before it is decoded: too large, or what decoders patch up.

    A few bytes can claim a picture of gigabytes, so the size in its header counts; and
    PNG and JPEG files that are cut off or damaged are refused.

    Raises
    ------
    MagbendError
        Of the given `kind`.
    """
    size = picture_size(data)
    if data[:8] == PNG:
        whole = size is not None and _png_whole(data)
    elif data[:2] == JPEG:
        end = _jpeg_end(data)
        whole = size is not None and end > 0 and not is_damaged(data[:end])
    else:
        whole = True  # other decoders refuse what is cut off
    if not whole:
        raise kind(DAMAGED.format(source=source))
    if size is not None and size[0] * size[1] > MAX_PIXELS:
        raise kind(
            f"{source}: a photograph must have at most {MAX_PIXELS / 1e6:.0f} "
            f"megapixels; instead received {size[0]} x {size[1]} px"
        )


def picture_size(data: bytes) -> tuple[int, int] | None:
    """Return width and height as the header of a picture says them, in px.

    None for kinds of files that are not known here (PNG, JPEG, BMP, TIFF, WebP and PNM
    are), and for headers that are damaged.
    """
    readers = (
        (PNG, _png_size), (JPEG, _jpeg_size), (b"BM", _bmp_size), (b"RIFF", _webp_size),
        (b"II*\0", _tiff_size), (b"MM\0*", _tiff_size), (b"P", _pnm_size),
    )  # fmt: skip
    for start, reader in readers:
        if data.startswith(start):
            try:
                return reader(data)
            except (struct.error, IndexError):
                return None
    return None


def decode_picture(data: bytes, source: str, kind: type[MagbendError]) -> Any:
    """Return the pixels of a picture file as they are stored, in OpenCV's order.

    Raises
    ------
    MagbendError
        Of the given `kind`, if it is no PNG, JPEG, BMP, TIFF, WebP or PNM, too large,
        cut off or damaged.
    """
    import cv2
    import numpy as np

    check_whole(data, source, kind)
    if picture_size(data) is None:
        raise kind(f"{source}: is not a picture that can be read")
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        pixels = None
    if pixels is None:
        raise kind(f"{source}: is not a picture that can be read")
    return np.asarray(pixels)


def _bmp_size(data: bytes) -> tuple[int, int] | None:
    width, height = struct.unpack("<ii", data[18:26])
    return abs(width), abs(height)


def _pnm_size(data: bytes) -> tuple[int, int] | None:
    found = _PNM.match(data[:1000])
    return (int(found.group(1)), int(found.group(2))) if found else None


def _webp_size(data: bytes) -> tuple[int, int] | None:
    if data[8:12] != b"WEBP":
        return None
    form = data[12:16]
    if form == b"VP8X":
        width, height = (int.from_bytes(data[i : i + 3], "little") for i in (24, 27))
        return width + 1, height + 1
    if form == b"VP8L":
        bits = int.from_bytes(data[21:25], "little")
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    width, height = struct.unpack("<HH", data[26:30])
    return width & 0x3FFF, height & 0x3FFF


def _tiff_size(data: bytes) -> tuple[int, int] | None:
    """Return the largest width and height that any directory of the file says."""
    order = "<" if data[:2] == b"II" else ">"
    (place,) = struct.unpack(f"{order}I", data[4:8])
    found = {256: 0, 257: 0}
    for _ in range(_MOST_PAGES):
        if not place:
            break
        (entries,) = struct.unpack(f"{order}H", data[place : place + 2])
        for entry in range(place + 2, place + 2 + 12 * entries, 12):
            tag, form = struct.unpack(f"{order}HH", data[entry : entry + 4])
            if tag in found:
                size = "H" if form == 3 else "I"
                value = data[entry + 8 : entry + 8 + struct.calcsize(size)]
                found[tag] = max(found[tag], *struct.unpack(f"{order}{size}", value))
        place += 2 + 12 * entries
        (place,) = struct.unpack(f"{order}I", data[place : place + 4])
    return (found[256], found[257]) if all(found.values()) else None


def _png_size(data: bytes) -> tuple[int, int] | None:
    if len(data) < 33 or data[12:16] != b"IHDR":
        return None
    width, height = struct.unpack(">II", data[16:24])
    return width, height


def _png_whole(data: bytes) -> bool:
    """Walk the chunks to IEND, as the file's own lengths and checksums tell."""
    place = 8
    while place + 12 <= len(data):
        (length,) = struct.unpack(">I", data[place : place + 4])
        end = place + 8 + length
        if end + 4 > len(data):
            return False
        if zlib.crc32(memoryview(data)[place + 4 : end]) != int.from_bytes(
            data[end : end + 4], "big"
        ):
            return False
        if data[place + 4 : place + 8] == b"IEND":
            return True
        place += 12 + length
    return False


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Find the frame header (SOFn) among the segments."""
    place = 2
    while place + 9 < len(data):
        if data[place] != 0xFF:
            return None
        marker = data[place + 1]
        if marker == 0xFF:
            place += 1
            continue
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack(">HH", data[place + 5 : place + 9])
            return width, height
        if marker == 0xDA:
            return None
        (length,) = struct.unpack(">H", data[place + 2 : place + 4])
        place += 2 + length
    return None


def _jpeg_end(data: bytes) -> int:
    """Return where the first picture ends; 0 where it does not.

    What stands behind it (the video of a motion photo, a depth map, a second picture)
    is no part of it.
    """
    place = 2
    while found := _MARKER.search(data, place):
        marker, place = data[found.end() - 1], found.end()
        if marker == 0xD9:
            return place
        if place + 2 > len(data):
            return 0
        place += int.from_bytes(data[place : place + 2], "big")
    return 0
