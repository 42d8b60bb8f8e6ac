"""The door of pictures: header size before decoding, damage before use."""

from __future__ import annotations

import contextlib
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from magbend.core.errors import CameraError
from magbend.core.picture import decode_picture, picture_size
from magbend.rig.camera.mjpeg import BrokenPictureError, decode_jpeg

PHOTO = Path(__file__).parents[2] / "examples/photographs/dev_12.jpg"
IMAGE = cv2.GaussianBlur(
    np.random.default_rng(5).integers(0, 255, (90, 160, 3), np.uint8), (0, 0), 2.0
)


def coded(ending: str) -> bytes:
    return cv2.imencode(ending, IMAGE)[1].tobytes()


@pytest.mark.parametrize("ending", [".png", ".jpg", ".bmp", ".tiff", ".webp", ".ppm"])
def test_the_header_tells_the_size_and_the_pixels_are_read(ending):
    data = coded(ending)
    assert picture_size(data) == (160, 90)
    assert decode_picture(data, "x", CameraError).shape == (90, 160, 3)
    for cut in (4, 12, 20, 28):
        with pytest.raises(CameraError):
            decode_picture(data[:cut], "x", CameraError)


def huge(ending: str) -> bytes:
    """A few bytes that claim a picture of many gigabytes."""
    side = 60_000
    if ending == ".png":
        head = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)

        def chunk(name: bytes, body: bytes) -> bytes:
            crc = zlib.crc32(name + body)
            return struct.pack(">I", len(body)) + name + body + struct.pack(">I", crc)

        body = zlib.compress(bytes(10_000))
        return b"\x89PNG\r\n\x1a\n" + b"".join(
            chunk(*one) for one in ((b"IHDR", head), (b"IDAT", body), (b"IEND", b""))
        )
    if ending == ".bmp":
        return coded(ending)[:18] + struct.pack("<ii", side, -side) + coded(ending)[26:]
    data = coded(ending)
    at = data.index(b"\xff\xc0") + 5
    return data[:at] + struct.pack(">HH", side, side) + data[at + 4 :]


@pytest.mark.parametrize("ending", [".png", ".bmp", ".jpg"])
def test_a_picture_that_claims_gigabytes_is_refused_before_it_is_decoded(ending):
    with pytest.raises(CameraError, match=r"at most 64 megapixels|cut off or damaged"):
        decode_picture(huge(ending), "x", CameraError)


def test_a_jpeg_with_bytes_cut_out_is_known_at_the_stream_too():
    generator = np.random.default_rng(6)
    data = PHOTO.read_bytes()
    start, known = data.index(b"\xff\xda") + 20, 0
    for _ in range(40):
        length = int(generator.integers(1, 400))
        at = int(generator.integers(start, len(data) - length - 2))
        with contextlib.suppress(BrokenPictureError):
            decode_jpeg(data[:at] + data[at + length :])
            known -= 1
        known += 1
    assert known >= 36  # a short cut may leave the codes in step
    assert decode_jpeg(data).ndim == 3


def test_what_is_no_picture_is_a_sentence():
    generator = np.random.default_rng(7)
    for start in (
        b"",
        b"BM",
        b"RIFF",
        b"II*\0",
        b"\x89PNG\r\n\x1a\n",
        b"\xff\xd8",
        b"x",
    ):
        for _ in range(20):
            data = start + generator.bytes(int(generator.integers(0, 200)))
            with pytest.raises(CameraError) as caught:
                decode_picture(data, "x", CameraError)
            assert "\n" not in str(caught.value)


def test_a_png_with_a_wrong_checksum_is_damaged_and_libpng_says_nothing(capfd):
    data = bytearray(coded(".png"))
    data[data.index(b"IDAT") + 8] ^= 0x55
    with pytest.raises(CameraError, match="cut off or damaged"):
        decode_picture(bytes(data), "x", CameraError)
    assert capfd.readouterr() == ("", "")
