from __future__ import annotations

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from magbend.core.errors import VisionError
from magbend.core.jpeg import is_damaged
from magbend.vision.picture.photo import decode_photo

SIZE = (203, 150)  # no multiple of a block


def scene() -> Image.Image:
    """A dark line down noisy paper: where it stands tells whether a picture shifted."""
    grey = np.random.default_rng(0).normal(200.0, 2.0, SIZE[::-1])
    grey[:, 96:107] = 30.0
    return Image.fromarray(np.repeat(grey.round().astype(np.uint8)[..., None], 3, 2))


def saved(mode: str = "RGB", **options) -> bytes:
    buffer = io.BytesIO()
    scene().convert(mode).save(buffer, "JPEG", quality=88, **options)
    return buffer.getvalue()


KINDS = [
    {"subsampling": 0}, {"subsampling": 1}, {"subsampling": 2}, {"optimize": True},
    {"restart_marker_blocks": 5}, {"restart_marker_rows": 1}, {"progressive": True},
    {"mode": "L"}, {"mode": "CMYK"}, {"mode": "L", "restart_marker_rows": 2},
]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_whole_files_are_whole(kind):
    assert not is_damaged(saved(**kind))


@pytest.mark.parametrize("padding", [b"\xff\xff", b"\0", b"\0" * 200])
def test_padding_before_a_marker_is_allowed(padding):
    data = saved()
    assert data.endswith(b"\xff\xd9")
    assert not is_damaged(data[:-2] + padding + b"\xff\xd9")
    assert is_damaged(data[:-2] + b"\x12\x34" + padding + b"\xff\xd9")


@pytest.mark.parametrize("kind", KINDS[:6], ids=str)
@pytest.mark.parametrize("lost", [40, 400])
def test_lost_bytes_are_noticed(kind, lost):
    data = saved(**kind)
    start = data.index(b"\xff\xda") + 20
    for place in np.linspace(start, len(data) - lost - 4, 7).astype(int):
        with pytest.raises(VisionError, match="cut off or damaged"):
            decode_photo(data[:place] + data[place + lost :])


@pytest.mark.parametrize("lost", [0, 3])
def test_a_small_fault_shifts_no_picture_that_is_taken(lost):
    """Where the codes fall in step again, the rest may be shaded, but has not moved."""
    data = saved(subsampling=2)
    rng = np.random.default_rng(1)
    start = data.index(b"\xff\xda") + 20
    taken = 0
    for place in rng.integers(start, len(data) - 4, 150):
        changed = bytearray(data)
        changed[place] ^= int(rng.integers(1, 256))
        del changed[place : place + lost]
        try:
            grey = decode_photo(bytes(changed)).grey
        except VisionError:
            continue
        taken += 1
        darkest = cv2.blur(grey, (11, 1))[:, 8:-8].argmin(axis=1) + 8
        assert np.mean(np.abs(darkest - 101) <= 3) > 0.8
    assert taken < 100


def test_what_cannot_be_followed_is_left_to_the_decoder():
    for data in (b"\xff\xd8", b"\xff\xd8\xff\xda\x00\x02", saved(progressive=True)):
        assert not is_damaged(data)
