"""What a picture file says of itself: orientation, depth, polarity, pages, profile.

Read by Pillow from the header, while OpenCV decodes the pixels: OpenCV reads a 16-bit
TIFF whose white is zero as its negative, takes the first of several pages without a
word, and knows no colour profiles.
"""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import VisionError, how_to_install

if TYPE_CHECKING:
    from PIL.Image import Image

_ORIENTATION = 0x0112
_PHOTOMETRIC = 262
_SAME_CURVE = ("srgb", "display p3", "c2")
"""Profiles whose curve is that of sRGB; their other primaries do not shift edges."""

HEIF = (b"ftypheic", b"ftypheix", b"ftypmif1", b"ftypmsf1", b"ftyphevc")


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """What the header of a picture says.

    Parameters
    ----------
    orientation : int
        EXIF's 1 to 8: how the sensor's picture is turned to be upright; 1 if not said.
    pages : int
        Pictures in the file.
    white_is_zero : bool
        Of a TIFF.
    profile : bytes
        ICC profile with another curve than sRGB's; empty where there is none.
    profile_name : str
        What it calls itself.
    """

    orientation: int = 1
    pages: int = 1
    white_is_zero: bool = False
    profile: bytes = b""
    profile_name: str = ""


def read_header(data: bytes) -> Header:
    """Return what a picture file says of itself; the plain `Header` if nothing."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return _header(data)
    except Exception:  # Pillow raises whatever it meets; OpenCV then has its say
        return Header()


def count_pages(path: Path) -> int:
    """Return how many pictures a TIFF holds; 1 for other files and unreadable ones."""
    if path.suffix.lower() not in (".tif", ".tiff") or not path.is_file():
        return 1
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(path) as picture:
                return int(getattr(picture, "n_frames", 1))
    except Exception:  # it fails in its row
        return 1


def _header(data: bytes) -> Header:
    from PIL import Image

    with Image.open(io.BytesIO(data)) as picture:
        orientation = int(picture.getexif().get(_ORIENTATION, 1))
        profile, name = _profile(picture)
        is_tiff = picture.format == "TIFF"
        tags: Any = getattr(picture, "tag_v2", {})
        return Header(
            orientation=orientation if 1 <= orientation <= 8 else 1,
            pages=int(getattr(picture, "n_frames", 1)) if is_tiff else 1,
            white_is_zero=is_tiff and tags.get(_PHOTOMETRIC) == 0,
            profile=profile,
            profile_name=name,
        )


def _profile(picture: Image) -> tuple[bytes, str]:
    profile = picture.info.get("icc_profile") or b""
    if not profile:
        return b"", ""
    from PIL import ImageCms

    try:
        read = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        name = ImageCms.getProfileDescription(read).strip()
    except (ImageCms.PyCMSError, OSError):
        return b"", ""
    if name.lower().startswith(_SAME_CURVE):
        return b"", name
    return profile, name


def by_profile(pixels: NDArray[Any], header: Header, source: str) -> NDArray[Any]:
    """Return blue, green and red of 8 bits with the curve of sRGB, not of the profile.

    Raises
    ------
    VisionError
        If the picture has 16 bits, which Pillow does not convert, or the profile is
        damaged.
    """
    from PIL import Image, ImageCms

    if pixels.dtype != np.uint8:
        raise VisionError(
            f"{source}: has the colour profile {header.profile_name!r}, whose curve is "
            "not that of sRGB; save it as sRGB"
        )
    own = ImageCms.ImageCmsProfile(io.BytesIO(header.profile))
    is_grey = own.profile.xcolor_space.strip() == "GRAY"
    values = pixels[..., 1] if is_grey else pixels[..., 2::-1]
    try:
        picture = Image.fromarray(np.ascontiguousarray(values))
        target = ImageCms.createProfile("sRGB")
        done = ImageCms.profileToProfile(picture, own, target, outputMode="RGB")
    except ImageCms.PyCMSError as error:
        raise VisionError(
            f"{source}: its colour profile {header.profile_name!r} cannot be used: "
            f"{error}"
        ) from None
    return np.ascontiguousarray(np.asarray(done)[..., ::-1])


def decode_heif(data: bytes, source: str) -> tuple[NDArray[Any], int]:
    """Decode a HEIC file (the extra ``heic``), upright, and say how it was turned.

    Raises
    ------
    VisionError
        If the package is missing or the file is damaged.
    """
    try:
        import pillow_heif
    except ModuleNotFoundError:
        raise VisionError(
            f"{source}: is a HEIC picture; {how_to_install('heic')}, or save it as JPEG"
        ) from None
    try:
        file = pillow_heif.open_heif(io.BytesIO(data), convert_hdr_to_8bit=True)
        rgb = np.asarray(file.to_pillow().convert("RGB"))
    except Exception as error:
        raise VisionError(
            f"{source}: the picture is cut off or damaged; copy it from the camera "
            f"again ({error})"
        ) from None
    noted = file.info.get("original_orientation") or 1
    return np.ascontiguousarray(rgb[..., ::-1]), int(noted)
