"""The photographs in the bench's folder, upright and small enough for a page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.door import file_below
from ...core.errors import InputError, MagbendError
from ..workspace import Workspace

if TYPE_CHECKING:
    from numpy.typing import NDArray

ENDINGS = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp"}
MOST = 400
_WIDEST_PX = 2400


def list_photos(workspace: Workspace) -> list[str]:
    """Return the photographs of runs, then those that lie in the bench's folder."""
    patterns = ("runs/*/images/*", "*", "*/*")
    found = [
        path.relative_to(workspace.folder).as_posix()
        for pattern in patterns
        for path in sorted(workspace.folder.glob(pattern), reverse=pattern[0] == "r")
        if path.suffix.lower() in ENDINGS and not path.name.startswith(".")
    ]
    return list(dict.fromkeys(found))[:MOST]


def photo_path(workspace: Workspace, name: str) -> Path:
    """Return a photograph by its path in the bench's folder.

    Raises
    ------
    InputError
        If it is none, or lies elsewhere.
    """
    path = file_below(workspace.folder, name)
    if path is None or path.suffix.lower() not in ENDINGS:
        raise InputError(f"there is no photograph {name!r} in {workspace.folder}")
    return path


def upright(path: Path) -> NDArray[Any]:
    """Return a photograph as it is looked at, eight bits a channel.

    Raises
    ------
    MagbendError
        If it cannot be read.
    """
    import cv2

    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise MagbendError(f"{path.name}: cannot be read as a picture")
    return image


def shrunk(image: NDArray[Any], width: str) -> bytes:
    """Return a picture as JPEG, no wider than asked for.

    Raises
    ------
    InputError
        If the width is none.
    """
    import cv2

    if not width.isdecimal() or not 16 <= int(width) <= _WIDEST_PX:
        raise InputError(f"width must be from 16 to {_WIDEST_PX} px")
    height, wide = image.shape[:2]
    if wide > int(width):
        size = (int(width), max(1, round(height * int(width) / wide)))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return bytes(cv2.imencode(".jpg", image)[1].tobytes())
