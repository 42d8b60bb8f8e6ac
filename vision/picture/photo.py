"""Photographs as linear light: the only place that decodes pictures.

A camera's grey value is not proportional to light: 8-bit and 16-bit pictures carry the
sRGB curve (IEC 61966-2-1). Half-level edges found without undoing it make a rod 5 %
thinner, and the stiffness goes with the fourth power of the side. So everything after
this module sees grey values proportional to light, paper about 0.7, black about 0.02.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.errors import VisionError
from ...core.picture import MAX_PIXELS, PNG, check_whole
from .header import HEIF, Header, by_profile, decode_heif, read_header
from .sample import nearest_pixels

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
    orientation : int
        EXIF's 1 to 8, as the file notes it: how the sensor's picture was turned to be
        upright, as it is here; see `turn`.
    decode : callable, optional
        Gives the pixels in colour, as `as_photo` takes them; see `colour`. A file is
        decoded for it once more, the first time.
    """

    grey: NDArray[np.float32]
    source: str = "array"
    clipped: float = 0.0
    orientation: int = 1
    decode: Callable[[], NDArray[Any]] | None = field(
        default=None, repr=False, compare=False
    )

    def colour(
        self, window: tuple[slice, slice] = (slice(None), slice(None))
    ) -> NDArray[np.float32] | None:
        """Return linear blue, green and red, (h, w, 3); None for a grey picture.

        Parameters
        ----------
        window : tuple of slice
            The rows and columns that are wanted; those that there are.
        """
        if self.decode is None:
            return None
        pixels = self.decode()
        if pixels.ndim != 3 or pixels.shape[2] < 3:
            return None
        return _linear(np.ascontiguousarray(pixels[window][..., :3]), linear=False)

    def colour_at(self, points_px: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return linear blue, green and red of the nearest pixels; None if grey.

        Parameters
        ----------
        points_px : ndarray, shape (..., 2)
            Places (x, y); those beyond the picture are taken at its border.
        """
        pixels = None if self.decode is None else self.decode()
        if pixels is None or pixels.ndim != 3 or pixels.shape[2] < 3:
            return None
        values = np.ascontiguousarray(nearest_pixels(pixels, points_px)[..., :3])
        return np.asarray(_linear(values, linear=False), np.float64)

    def light_at(self, points_px: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the same, or the light of a grey picture; shape (..., 3) or (..., 1).

        Parameters
        ----------
        points_px : ndarray, shape (..., 2)
            Places (x, y); those beyond the picture are taken at its border.
        """
        colours = self.colour_at(points_px)
        if colours is not None:
            return colours
        return np.asarray(nearest_pixels(self.grey, points_px)[..., None], np.float64)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height, in px."""
        return int(self.grey.shape[1]), int(self.grey.shape[0])


def read_photo(path: Path | str, *, linear: bool | None = None, page: int = 0) -> Photo:
    """Read a picture file (PNG, JPEG, TIFF, BMP, HEIC ...; 8 or 16 bit).

    The orientation that a camera notes in EXIF is applied; transparent pixels are laid
    on white; a colour profile with another curve than that of sRGB is undone.

    Parameters
    ----------
    path : Path or str
        The file.
    linear : bool or None
        True for pictures whose values are proportional to light already (raw or
        machine-vision files), False for such with the sRGB curve. None takes the curve
        for granted, but not where 10, 12 or 14 bits lie in a file of 16.
    page : int
        Which picture of a TIFF with several.

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
    return decode_photo(data, source=path.name, linear=linear, page=page)


def refuse_special(path: Path) -> None:
    """Refuse folders, and devices and pipes, whose reading may never end.

    Raises
    ------
    VisionError
        If something stands there that is no file.
    """
    if path.exists() and not path.is_file():
        raise VisionError(f"{path}: cannot be read: it is a folder or pipe, not a file")


def decode_photo(
    data: bytes, *, source: str = "data", linear: bool | None = None, page: int = 0
) -> Photo:
    """Decode the bytes of a picture file; see `read_photo`.

    Raises
    ------
    VisionError
        If the bytes are no whole picture of a size that can be measured.
    """
    if not data:
        raise VisionError(f"{source}: the file is empty; copy it from the camera again")
    if data[4:12] in HEIF:
        pixels, orientation = decode_heif(data, source)
        return replace(as_photo(pixels, source=source), orientation=orientation)
    check_whole(data, source)
    header = read_header(data)
    pixels = _pixels(data, source, header, linear, page)
    photo = as_photo(pixels, source=source, linear=bool(linear))
    photo = replace(photo, orientation=header.orientation)
    if _keeps_colour(data) and not linear:
        return photo
    if linear or pixels.ndim != 2 or pixels.dtype.kind == "f":
        # Transparent pixels are white there; decoders know no colours in float.
        return replace(photo, decode=None)
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
    return replace(photo, decode=cache(partial(_decode, data, source, flags)))


def _pixels(
    data: bytes, source: str, header: Header, linear: bool | None, page: int
) -> NDArray[Any]:
    """Return the pixels, grey where that is all that is needed, in their full range."""
    if header.profile and not linear:
        flags = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
        return by_profile(_decode(data, source, flags, page), header, source)
    if _keeps_colour(data):
        return _decode(data, source, cv2.IMREAD_COLOR)
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH
    pixels = _decode(data, source, flags, page)
    if data[:8] == PNG and data[25] in (4, 6):
        pixels = _with_alpha(data, source, pixels)
    if pixels.dtype.kind == "f" and np.median(pixels) > 1.0:
        raise VisionError(
            f"{source}: holds floating point values of {float(np.median(pixels)):.3g} "
            "in the median; they must be light from 0 to 1 (white): save it with 8 or "
            "16 bits"
        )
    if pixels.dtype != np.uint16:
        return pixels
    if header.white_is_zero:
        pixels = np.iinfo(np.uint16).max - pixels
    return pixels << _spare_bits(pixels, source, linear)


def _keeps_colour(data: bytes) -> bool:
    """Whether a file is a PNG of 8 bits in colour, without transparency.

    To be decoded in grey takes it as long, and OpenCV then rounds down.
    """
    return data[:8] == PNG and data[24:26] == b"\x08\x02"


def _spare_bits(pixels: NDArray[Any], source: str, linear: bool | None) -> int:
    """Return how many of the 16 bits the camera left empty.

    Raises
    ------
    VisionError
        If some are empty, and nobody said whether the values are light.
    """
    top = int(pixels.max(initial=0))
    bits = next((bits for bits in (10, 12, 14) if top < 2**bits), 16)
    if bits == 16 or top < 256:  # full, or black
        return 0
    if linear is None:
        raise VisionError(
            f"{source}: holds no value above {2**bits - 1}: {bits} bits in a 16-bit "
            "file; say --linear if its values are proportional to light (a machine "
            "vision camera), or --no-linear if they carry the curve of a photograph"
        )
    return 16 - bits


def _decode(data: bytes, source: str, flags: int, page: int = 0) -> NDArray[Any]:
    coded = np.frombuffer(data, np.uint8)
    try:
        if page:
            found, pages = cv2.imdecodemulti(coded, flags, range=(page, page + 1))
            pixels = pages[0] if found and pages else None
        else:
            pixels = cv2.imdecode(coded, flags)
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
        return np.asarray(_table(16, linear)[values], np.float32)
    return np.ascontiguousarray(values, dtype=np.float32)


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
