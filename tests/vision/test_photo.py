from __future__ import annotations

import io
import struct
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from magbend.core.errors import VisionError
from magbend.vision.picture.photo import MAX_PIXELS, as_photo, decode_photo, read_photo

RAMP = np.tile(np.arange(256, dtype=np.uint8), (64, 1))


def encoded(pixels: np.ndarray, suffix: str) -> bytes:
    ok, data = cv2.imencode(suffix, pixels)
    assert ok
    return data.tobytes()


def test_srgb_curve_is_undone():
    light = as_photo(RAMP).grey[0]
    assert light[0] == 0.0
    assert light[255] == pytest.approx(1.0)
    # IEC 61966-2-1: code 188 is half the light to 0.3 %; code 10 lies on the line.
    assert light[188] == pytest.approx(0.5, rel=0.01)
    assert light[10] == pytest.approx(10 / 255 / 12.92, rel=1e-5)
    assert np.all(np.diff(light) > 0.0)


def test_8_and_16_bit_and_float_agree():
    eight = as_photo(RAMP).grey
    sixteen = as_photo(RAMP.astype(np.uint16) * 257).grey
    np.testing.assert_allclose(sixteen, eight, atol=1e-6)
    np.testing.assert_array_equal(as_photo(eight).grey, eight)


def test_linear_pictures_stay_linear():
    light = as_photo(RAMP, linear=True).grey[0]
    np.testing.assert_allclose(light, np.arange(256) / 255, atol=1e-7)


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tif"])
def test_files_are_read_as_they_are(tmp_path, suffix):
    path = tmp_path / f"ramp{suffix}"
    path.write_bytes(encoded(RAMP, suffix))
    photo = read_photo(path)
    np.testing.assert_array_equal(photo.grey, as_photo(RAMP).grey)
    assert photo.source == path.name
    assert photo.size_px == (256, 64)


def test_clipped_share_counts_white_pixels():
    assert as_photo(RAMP).clipped == pytest.approx(1 / 256)
    assert as_photo(np.full((20, 20), 255, np.uint8)).clipped == 1.0


def test_transparent_pixels_lie_on_white():
    pixels = np.zeros((20, 30, 4), np.uint8)
    pixels[:, :15, 3] = 255
    photo = decode_photo(encoded(pixels, ".png"))
    assert photo.grey[:, :15].max() == 0.0
    assert photo.grey[:, 15:].min() == pytest.approx(1.0)


def test_exif_orientation_is_applied():
    buffer = io.BytesIO()
    exif = Image.Exif()
    exif[0x0112] = 6  # turn by a quarter
    Image.fromarray(RAMP).save(buffer, "JPEG", exif=exif, quality=95)
    assert decode_photo(buffer.getvalue()).size_px == (64, 256)


def test_exif_turns_a_png_with_transparency_or_it_is_refused():
    exif = Image.Exif()
    exif[0x0112] = 6
    pixels = np.dstack([RAMP, RAMP, RAMP, np.full_like(RAMP, 255)])
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", exif=exif)
    assert decode_photo(buffer.getvalue()).size_px == (64, 256)
    pixels[0, 0, 3] = 0
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", exif=exif)
    with pytest.raises(VisionError, match="without transparency"):
        decode_photo(buffer.getvalue())


def test_cmyk_jpeg_is_read():
    buffer = io.BytesIO()
    Image.new("CMYK", (64, 48), (0, 0, 0, 0)).save(buffer, "JPEG", quality=95)
    photo = decode_photo(buffer.getvalue())
    assert photo.size_px == (64, 48)
    assert photo.grey.mean() > 0.9


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.99])
def test_files_that_are_cut_off_are_refused(suffix, share):
    noise = np.random.default_rng(0).integers(0, 255, (200, 300), dtype=np.uint8)
    data = encoded(noise, suffix)
    with pytest.raises(VisionError, match=r"cut off|not a picture"):
        decode_photo(data[: int(share * len(data))], source="a.jpg")


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "empty"),
        (b"%PDF-1.7\n1 0 obj\n", "not a picture"),
        (b"GIF89a", "not a picture"),
        (b"\x89PNG\r\n\x1a\n", "cut off"),
        (b"\xff\xd8\xff\xe0", "cut off"),
    ],
)
def test_what_is_no_picture_is_named(data, says):
    with pytest.raises(VisionError, match=f"scan.png: .*{says}"):
        decode_photo(data, source="scan.png")


def jpeg(pixels):
    return cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_a_loss_that_a_jpeg_hides_behind_its_end_marker_is_refused(share):
    noisy = np.random.default_rng(0).normal(180.0, 2.0, (240, 320))
    data = jpeg(noisy.round().astype(np.uint8))
    decode_photo(data)
    with pytest.raises(VisionError, match="cut off or damaged"):
        decode_photo(data[: int(share * len(data))] + b"\xff\xd9")


def test_a_drawing_that_ends_flat_is_whole():
    drawing = np.full((240, 320), 200, np.uint8)
    cv2.line(drawing, (100, 0), (130, 150), 30, 12)
    decode_photo(jpeg(drawing))
    decode_photo(jpeg(cv2.rotate(drawing, cv2.ROTATE_90_CLOCKWISE)))


def test_missing_file_and_folder_are_named(tmp_path):
    with pytest.raises(VisionError, match="no such file"):
        read_photo(tmp_path / "absent.png")
    with pytest.raises(VisionError, match="cannot be read"):
        read_photo(tmp_path)


def test_one_pixel_is_too_small():
    with pytest.raises(VisionError, match=r"at least 16 x 16.*1 x 1"):
        decode_photo(encoded(np.zeros((1, 1), np.uint8), ".png"))


def test_too_large_is_refused_before_it_is_decoded():
    side = int(MAX_PIXELS**0.5) + 1000
    head = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    chunks = b""
    for kind, body in ((b"IHDR", head), (b"IDAT", b"x"), (b"IEND", b"")):
        crc = zlib.crc32(kind + body)
        chunks += struct.pack(">I", len(body)) + kind + body + struct.pack(">I", crc)
    with pytest.raises(VisionError, match="megapixels"):
        decode_photo(b"\x89PNG\r\n\x1a\n" + chunks)


@pytest.mark.parametrize(
    "pixels",
    [
        np.zeros((20, 20, 2), np.uint8),
        np.zeros((20, 20), np.int32),
        np.zeros((0, 20), np.uint8),
        np.zeros(20, np.uint8),
        np.full((20, 20), np.nan),
        np.zeros((20, 20), bool),
    ],
)
def test_arrays_that_are_no_picture_are_refused(pixels):
    with pytest.raises(VisionError):
        as_photo(pixels)


@settings(max_examples=150, deadline=None)
@given(
    st.binary(max_size=200), st.sampled_from([b"", b"\xff\xd8", b"\x89PNG\r\n\x1a\n"])
)
def test_random_bytes_raise_nothing_but_our_error(data, head):
    with pytest.raises(VisionError):
        decode_photo(head + data)


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_damaged_files_raise_nothing_but_our_error(data):
    whole = bytearray(
        encoded(RAMP[:32, :64], data.draw(st.sampled_from([".png", ".jpg"])))
    )
    for _ in range(data.draw(st.integers(1, 6))):
        place = data.draw(st.integers(0, len(whole) - 1))
        whole[place] = data.draw(st.integers(0, 255))
    try:
        photo = decode_photo(bytes(whole))
    except VisionError:
        return
    assert np.isfinite(photo.grey).all()


def test_colour_is_there_when_it_is_asked_for(tmp_path):
    pixels = np.zeros((20, 30, 3), np.uint8)
    pixels[:, :10], pixels[:, 10:20], pixels[:, 20:] = (255, 0, 0), (0, 255, 0), 128
    path = tmp_path / "colour.png"
    assert cv2.imwrite(str(path), pixels)
    for photo in (as_photo(pixels), read_photo(path)):
        light = photo.colour()
        np.testing.assert_array_equal(light[5, 5], (1.0, 0.0, 0.0))
        np.testing.assert_array_equal(light[5, 15], (0.0, 1.0, 0.0))
        assert light[5, 25] == pytest.approx(0.2159, abs=1e-4)
    assert as_photo(pixels[..., 0]).colour() is None


def test_a_tiff_of_floats_is_light_in_grey_and_of_no_other_scale():
    light = as_photo(RAMP).grey
    photo = decode_photo(encoded(light, ".tif"))
    np.testing.assert_array_equal(photo.grey, light)
    assert photo.colour() is None
    with pytest.raises(VisionError, match="light from 0 to 1"):
        decode_photo(encoded(RAMP.astype(np.float32), ".tif"))
