"""Whether a picture file is whole, which decoders do not tell: they patch it up."""

from __future__ import annotations

import re
import struct

from ...core.errors import VisionError
from ...core.jpeg import is_damaged

MAX_PIXELS = 64_000_000

PNG = b"\x89PNG\r\n\x1a\n"
JPEG = b"\xff\xd8"
DAMAGED = "{source}: the picture is cut off or damaged; copy it from the camera again"
_MARKER = re.compile(rb"\xff+[^\x00\xff\xd0-\xd7]")
"""A marker between coded data: no stuffed zero, no restart."""


def check_whole(data: bytes, source: str) -> None:
    """Refuse what decoders patch up: PNG and JPEG files that are cut off or damaged."""
    if data[:8] == PNG:
        size, whole = _png_size(data), _png_whole(data)
    elif data[:2] == JPEG:
        size = _jpeg_size(data)
        end = _jpeg_end(data)
        whole = end > 0 and not is_damaged(data[:end])
    else:
        return
    if size is None or not whole:
        raise VisionError(DAMAGED.format(source=source))
    if size[0] * size[1] > MAX_PIXELS:
        raise VisionError(
            f"{source}: a photograph must have at most {MAX_PIXELS / 1e6:.0f} "
            f"megapixels; instead received {size[0]} x {size[1]} px"
        )


def _png_size(data: bytes) -> tuple[int, int] | None:
    if len(data) < 33 or data[12:16] != b"IHDR":
        return None
    width, height = struct.unpack(">II", data[16:24])
    return width, height


def _png_whole(data: bytes) -> bool:
    """Walk the chunks to IEND, as the file's own lengths tell."""
    place = 8
    while place + 12 <= len(data):
        (length,) = struct.unpack(">I", data[place : place + 4])
        if place + 12 + length > len(data):
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
