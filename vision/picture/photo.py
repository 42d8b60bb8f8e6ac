"""Photographs as linear light: the only place that decodes pictures.

A camera's grey value is not proportional to light: 8-bit and 16-bit pictures carry the
sRGB curve (IEC 61966-2-1). Half-level edges found without undoing it make a rod 5 %
thinner, and the stiffness goes with the fourth power of the side. So everything after
this module sees grey values proportional to light, paper about 0.7, black about 0.02.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.errors import VisionError
from ...core.jpeg import is_damaged

MAX_PIXELS = 64_000_000
MIN_SIDE = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Photo:
    """A picture in linear light.

    Parameters
    ----------
    grey : ndarray, shape (height, width), float32
        Light, 0 to 1 for integer pictures; row 0 at the top, pixel (0, 0) is the centre
        of the top left pixel.
    source : str
        Name for messages and tables.
    clipped : float
        Fraction of pixels at the top of the scale.
    decode : callable, optional
        Gives the pixels in colour, as `as_photo` takes them; see `colour`.
    """

    grey: NDArray[np.float32]
    source: str = "array"
    clipped: float = 0.0
    decode: Callable[[], NDArray[Any]] | None = field(
        default=None, repr=False, compare=False
    )

    def colour(self) -> NDArray[np.float32] | None:
        """Return linear blue, green and red, (h, w, 3); None for a grey picture.

        A file is decoded for it once more: most photographs are measured without.
        """
        if self.decode is None:
            return None
        pixels = self.decode()
        if pixels.ndim != 3 or pixels.shape[2] < 3:
            return None
        return _linear(np.ascontiguousarray(pixels[..., :3]), linear=False)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height, in px."""
        return int(self.grey.shape[1]), int(self.grey.shape[0])


def read_photo(path: Path | str, *, linear: bool = False) -> Photo:
    """Read a picture file (PNG, JPEG, TIFF, BMP ...; 8 or 16 bit, grey or colour).

    The orientation that a camera notes in EXIF is applied; transparent pixels are laid
    on white.

    Parameters
    ----------
    path : Path or str
        The file.
    linear : bool
        True for pictures whose values are proportional to light already (raw or
        machine-vision files); otherwise the sRGB curve is undone.

    Raises
    ------
    VisionError
        If the file is missing, empty, cut off, no picture, or too small or too large.
    """
    path = Path(path)
    refuse_special(path)
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise VisionError(f"{path}: there is no such file") from None
    except OSError as error:
        raise VisionError(f"{path}: cannot be read: {error.strerror}") from None
    return decode_photo(data, source=path.name, linear=linear)


def refuse_special(path: Path) -> None:
    """Refuse folders, and devices and pipes, whose reading may never end.

    Raises
    ------
    VisionError
        If something stands there that is no file.
    """
    if path.exists() and not path.is_file():
        raise VisionError(f"{path}: cannot be read: it is a folder or pipe, not a file")


def decode_photo(data: bytes, *, source: str = "data", linear: bool = False) -> Photo:
    """Decode the bytes of a picture file; see `read_photo`.

    Raises
    ------
    VisionError
        If the bytes are no whole picture of a size that can be measured.
    """
    if not data:
        raise VisionError(f"{source}: the file is empty; copy it from the camera again")
    _check_whole(data, source)
    pixels = _decode(data, source, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH)
    if data[:8] == _PNG and data[25] in (4, 6):
        pixels = _with_alpha(data, source, pixels)
    photo = as_photo(pixels, source=source, linear=linear)
    if linear or pixels.ndim != 2:  # transparent pixels are white there
        return replace(photo, decode=None)
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
    return replace(photo, decode=partial(_decode, data, source, flags))


def _decode(data: bytes, source: str, flags: int) -> NDArray[Any]:
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:
        pixels = None
    if pixels is None:
        raise VisionError(
            f"{source}: not a picture that can be decoded; "
            "give a PNG, JPEG, TIFF or BMP file"
        )
    return np.asarray(pixels)


def _with_alpha(data: bytes, source: str, upright: NDArray[Any]) -> NDArray[Any]:
    """Return a PNG with its transparency, which OpenCV never turns as EXIF asks."""
    pixels = _decode(data, source, cv2.IMREAD_UNCHANGED)
    alpha = pixels[..., -1]
    if int(alpha.min()) == np.iinfo(alpha.dtype).max:
        return upright
    if b"eXIf" in data:
        raise VisionError(
            f"{source}: is partly transparent, and EXIF may turn it; "
            "save it without transparency"
        )
    return pixels


def as_photo(
    pixels: NDArray[Any], *, source: str = "array", linear: bool = False
) -> Photo:
    """Take an array as a photograph.

    Parameters
    ----------
    pixels : ndarray, shape (height, width) or (height, width, 1 | 3 | 4)
        uint8 or uint16 with the sRGB curve (unless `linear`), or float in linear light,
        white at 1. Colour in OpenCV's order (blue, green, red[, alpha]).
    source : str
        Name for messages.
    linear : bool
        True if integer values are proportional to light.

    Raises
    ------
    VisionError
        If the shape, the type or the values are not those of a picture.
    """
    pixels = np.asarray(pixels)
    grey = _to_grey(pixels, source)
    height, width = grey.shape
    if min(height, width) < MIN_SIDE or height * width > MAX_PIXELS:
        raise VisionError(
            f"{source}: a photograph must be at least {MIN_SIDE} x {MIN_SIDE} px and "
            f"at most {MAX_PIXELS / 1e6:.0f} megapixels; instead received "
            f"{width} x {height} px"
        )
    light = _linear(grey, linear=linear)
    top = 1.0 if grey.dtype.kind == "f" else np.iinfo(grey.dtype).max
    if top == 1.0 and not bool(np.isfinite(light).all()):
        raise VisionError(f"{source}: the picture holds NaN or infinity")
    full = grey >= top if top == 1.0 else grey == top
    clipped = float(cv2.countNonZero(full.view(np.uint8))) / grey.size
    decode = None if linear or pixels.ndim != 3 else partial(np.asarray, pixels)
    return Photo(grey=light, source=source, clipped=clipped, decode=decode)


def _linear(values: NDArray[Any], *, linear: bool) -> NDArray[np.float32]:
    """Return the light of pixel values of any type that a photograph may have."""
    if values.dtype == np.uint8:
        return np.asarray(cv2.LUT(values, _table(8, linear)), np.float32)
    if values.dtype == np.uint16:
        return _table(16, linear)[values]
    return np.ascontiguousarray(values, dtype=np.float32)


_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8"
_DAMAGED = "{source}: the picture is cut off or damaged; copy it from the camera again"


@cache
def _table(bits: int, linear: bool) -> NDArray[np.float32]:
    """Light of each code: the sRGB curve of IEC 61966-2-1, or a straight line."""
    code = np.arange(2**bits) / (2**bits - 1)
    if not linear:
        code = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    return np.asarray(code, dtype=np.float32)


def _to_grey(pixels: NDArray[Any], source: str) -> NDArray[Any]:
    if pixels.dtype not in (np.uint8, np.uint16, np.float32, np.float64):
        raise VisionError(
            f"{source}: a photograph must hold 8-bit, 16-bit or float values; "
            f"instead received {pixels.dtype}"
        )
    if pixels.ndim == 3 and pixels.shape[2] == 1:
        pixels = pixels[:, :, 0]
    if pixels.ndim == 2 and pixels.size:
        return pixels
    if pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or not pixels.size:
        raise VisionError(
            f"{source}: a photograph must be grey or colour; "
            f"instead received an array of shape {pixels.shape}"
        )
    if pixels.dtype == np.float64:
        pixels = pixels.astype(np.float32)
    if pixels.shape[2] == 3:
        return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY))
    return _on_white(pixels)


def _on_white(pixels: NDArray[Any]) -> NDArray[Any]:
    grey = np.asarray(cv2.cvtColor(pixels, cv2.COLOR_BGRA2GRAY))
    top = 1.0 if pixels.dtype == np.float32 else float(np.iinfo(pixels.dtype).max)
    opaque = pixels[:, :, 3].astype(np.float32) / top
    if float(opaque.min()) >= 1.0:
        return grey
    mixed = grey * opaque + top * (1.0 - opaque)
    return np.asarray(mixed if top == 1.0 else np.rint(mixed)).astype(pixels.dtype)


def _check_whole(data: bytes, source: str) -> None:
    """Refuse what decoders patch up: PNG and JPEG files that are cut off or damaged."""
    if data[:8] == _PNG:
        size, whole = _png_size(data), _png_whole(data)
    elif data[:2] == _JPEG:
        size = _jpeg_size(data)
        whole = data.rfind(b"\xff\xd9") > data.rfind(b"\xff\xda") > 0
        whole = whole and not is_damaged(data)
    else:
        return
    if size is None or not whole:
        raise VisionError(_DAMAGED.format(source=source))
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
