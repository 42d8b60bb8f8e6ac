"""Pictures as telephones, grabbers and ImageJ leave them: read right, or refused."""

from __future__ import annotations

import io
import struct
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms

from magbend.core.errors import VisionError
from magbend.vision import (
    Setting,
    calibrate,
    extract,
    oriented,
    read_calibration,
    write_calibration,
)
from magbend.vision.batch.inputs import list_sources, read_source
from magbend.vision.camera.board import Board
from magbend.vision.picture.photo import as_photo, decode_photo, read_photo
from magbend.vision.picture.turn import turned

RENDERED = Path(__file__).parents[2] / "examples" / "photographs"
RAMP = np.tile(np.arange(256, dtype=np.uint8), (64, 1))
UNEVEN = np.random.default_rng(0).integers(0, 255, (40, 64), dtype=np.uint8)


def with_orientation(data: bytes, orientation: int) -> bytes:
    """Add an EXIF note to a JPEG; its pixels stay as they are."""
    exif = Image.Exif()
    exif[0x0112] = orientation
    note = exif.tobytes()
    segment = b"\xff\xe1" + (len(note) + 2).to_bytes(2, "big") + note
    return data[:2] + segment + data[2:]


@pytest.fixture(scope="module")
def camera():
    return calibrate(read_photo(RENDERED / "calib_D.jpg"), board=Board())


@pytest.fixture(scope="module")
def plain(camera):
    return extract(read_photo(RENDERED / "dev_03.jpg"), camera, rod_height_mm=0.9)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_every_orientation_is_turned_back_to_the_sensor(orientation):
    data = cv2.imencode(".jpg", UNEVEN)[1].tobytes()
    photo = decode_photo(with_orientation(data, orientation))
    assert photo.orientation == orientation
    back = turned(photo, 1)
    np.testing.assert_array_equal(back.grey, decode_photo(data).grey)
    again = turned(back, orientation)
    np.testing.assert_array_equal(again.grey, photo.grey)


@pytest.mark.parametrize("orientation", [3, 6])
def test_a_turned_photograph_is_measured_as_the_sensor_saw_it(
    camera, plain, orientation
):
    data = with_orientation((RENDERED / "dev_03.jpg").read_bytes(), orientation)
    found = extract(decode_photo(data), camera, rod_height_mm=0.9)
    assert found.length_mm == pytest.approx(plain.length_mm, abs=1e-9)
    assert found.tip_mm == pytest.approx(plain.tip_mm, abs=1e-9)


def test_a_calibration_from_a_turned_board_fits_turned_photographs(plain):
    board = with_orientation((RENDERED / "calib_D.jpg").read_bytes(), 3)
    camera = calibrate(decode_photo(board), board=Board())
    assert camera.orientation == 3
    rod = with_orientation((RENDERED / "dev_03.jpg").read_bytes(), 3)
    for data in (rod, (RENDERED / "dev_03.jpg").read_bytes()):
        found = extract(decode_photo(data), camera, rod_height_mm=0.9)
        assert found.length_mm == pytest.approx(plain.length_mm, abs=0.01)


def test_an_old_calibration_refuses_what_it_cannot_know(camera, tmp_path):
    write_calibration(camera, tmp_path / "c.json")
    assert read_calibration(tmp_path / "c.json").orientation == 1
    old = replace(camera, orientation=None)
    photo = read_photo(RENDERED / "dev_03.jpg")
    assert oriented(photo, old) is photo
    with pytest.raises(VisionError, match="calibrate again"):
        oriented(replace(photo, orientation=3), old)


def test_a_motion_photo_is_its_photograph(camera, plain):
    data = (RENDERED / "dev_03.jpg").read_bytes()
    behind = b"\x00\x00\x00\x18ftypmp42" + b"\xff\xda" * 8 + b"video"
    np.testing.assert_array_equal(
        decode_photo(data + behind).grey, decode_photo(data).grey
    )
    with pytest.raises(VisionError, match="cut off or damaged"):
        decode_photo(data[: len(data) // 2])
    with pytest.raises(VisionError, match="cut off or damaged"):
        decode_photo(data[: len(data) // 2] + behind)


@pytest.mark.parametrize("bits", [8, 16])
def test_white_is_zero_is_no_negative(bits):
    values = RAMP if bits == 8 else RAMP.astype(np.uint16) * 257
    buffer = io.BytesIO()
    top = np.iinfo(values.dtype).max
    tifffile.imwrite(buffer, top - values, photometric="miniswhite")
    light = decode_photo(buffer.getvalue()).grey
    np.testing.assert_allclose(light, as_photo(RAMP).grey, atol=1e-6)


def test_twelve_bits_in_sixteen_ask_what_they_are(plain, camera):
    grey = read_photo(RENDERED / "dev_03.jpg").grey
    twelve = np.round(grey * 4095.0).astype(np.uint16)
    data = cv2.imencode(".tif", twelve)[1].tobytes()
    with pytest.raises(VisionError, match=r"4095: 12 bits in a 16-bit.*--linear"):
        decode_photo(data)
    found = extract(decode_photo(data, linear=True), camera, rod_height_mm=0.9)
    assert found.width_mm == pytest.approx(plain.width_mm, rel=0.005)
    np.testing.assert_allclose(
        decode_photo(data, linear=False).grey.max(), as_photo(
            np.full((20, 20), int(twelve.max()) << 4, np.uint16)
        ).grey.max(), rtol=1e-6,
    )  # fmt: skip


def grey_profile(gamma: float) -> bytes:
    """A grey ICC profile (version 2.4) whose curve is a power."""
    text = b"grey\x00"
    desc = b"desc\x00\x00\x00\x00" + struct.pack(">I", len(text)) + text + bytes(78)
    curve = b"curv\x00\x00\x00\x00" + struct.pack(">IH", 1, round(gamma * 256))
    white = b"XYZ \x00\x00\x00\x00" + struct.pack(">3i", 63190, 65536, 54061)
    body, table = b"", b""
    for name, tag in ((b"desc", desc), (b"kTRC", curve), (b"wtpt", white)):
        tag += bytes(-len(tag) % 4)
        table += name + struct.pack(">II", 128 + 4 + 36 + len(body), len(tag))
        body += tag
    size = 128 + 4 + len(table) + len(body)
    head = struct.pack(
        ">I4sI4s4s4s", size, b"    ", 0x02400000, b"mntr", b"GRAY", b"XYZ "
    )
    head += bytes(12) + b"acsp" + bytes(28) + struct.pack(">3i", 63190, 65536, 54061)
    return head + bytes(128 - len(head)) + struct.pack(">I", 3) + table + body


def test_a_profile_with_another_curve_is_undone():
    buffer = io.BytesIO()
    Image.fromarray(RAMP).save(buffer, "PNG", icc_profile=grey_profile(1.8))
    light = decode_photo(buffer.getvalue()).grey[0]
    truth = (np.arange(256) / 255.0) ** 1.8
    np.testing.assert_allclose(light[16:], truth[16:], atol=0.012)
    assert np.abs(as_photo(RAMP).grey[0] - truth).max() > 0.05  # what it would be else
    buffer = io.BytesIO()
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    colour = Image.fromarray(RAMP).convert("RGB")
    colour.save(buffer, "PNG", icc_profile=profile)
    np.testing.assert_array_equal(
        decode_photo(buffer.getvalue()).grey, as_photo(RAMP).grey
    )
    sixteen = io.BytesIO()
    tifffile.imwrite(
        sixteen, RAMP.astype(np.uint16) * 257, iccprofile=grey_profile(1.8),
        photometric="minisblack",
    )  # fmt: skip
    with pytest.raises(VisionError, match=r"colour profile 'grey'.*save it as sRGB"):
        decode_photo(sixteen.getvalue())


def test_pages_of_a_tiff_are_photographs_of_their_own(tmp_path):
    pages = np.stack([RAMP, RAMP[:, ::-1], 255 - RAMP])
    tifffile.imwrite(tmp_path / "stack.tif", pages, photometric="minisblack")
    sources = list_sources([tmp_path])
    assert [source.image for source in sources] == [
        "stack_000000", "stack_000001", "stack_000002"
    ]  # fmt: skip
    for source, page in zip(sources, pages, strict=True):
        np.testing.assert_array_equal(read_source(source).grey, as_photo(page).grey)


def test_a_picture_of_a_kind_that_is_not_read_is_named(tmp_path):
    (tmp_path / "a.CR2").write_bytes(b"II*\x00raw")
    (tmp_path / "notes.txt").write_text("no picture")
    (source,) = list_sources([tmp_path])
    with pytest.raises(VisionError, match=r"a.CR2: CR2 is not read; convert it"):
        read_source(source)


def test_heic_is_read_upright_with_its_orientation(tmp_path):
    heif = pytest.importorskip("pillow_heif")
    heif.register_heif_opener()
    path = tmp_path / "a.heic"
    picture = Image.fromarray(np.repeat(RAMP[..., None], 3, 2))
    picture.save(path, quality=100)
    photo = read_photo(path)
    assert photo.size_px == (256, 64)
    np.testing.assert_allclose(photo.grey, as_photo(RAMP).grey, atol=0.03)
    with pytest.raises(VisionError, match="cut off or damaged"):
        decode_photo(path.read_bytes()[:600], source="a.heic")


def test_linear_files_are_read_as_light(camera, plain):
    grey = read_photo(RENDERED / "dev_03.jpg").grey
    data = cv2.imencode(".tif", np.round(grey * 65535.0).astype(np.uint16))[1].tobytes()
    right = extract(decode_photo(data, linear=True), camera, rod_height_mm=0.9)
    assert right.width_mm == pytest.approx(plain.width_mm, rel=0.003)
    assert Setting(linear=True).fingerprint() != Setting().fingerprint()
