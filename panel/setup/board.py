"""The calibration board under the live camera: corners, coverage, tilt, calibration."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.errors import InputError, MagbendError, VisionError
from ...core.files import write_bytes

if TYPE_CHECKING:
    from ...vision import Board
    from ..panel import Panel

FOLDER = "board"
PLANE = "plane.png"
MOST_LENS = 12
GOOD_TILT_DEG = (15.0, 45.0)
SIDES = ("left", "right", "top", "bottom")


def board_of(print_scale: float = 1.0) -> Board:
    """Return the board of the project, as large as it came out of the printer."""
    from ...vision import Board

    return Board(print_scale=print_scale)


def look(panel: Panel) -> dict[str, Any]:
    """Return what the live picture shows of the board, and what is wanted next."""
    from ...vision import find_corners

    image = _grey(panel.snapshot().image)
    board = board_of()
    across, down = board.inner
    try:
        ids, points = find_corners(image, board)
    except VisionError as error:
        return {"corners_px": [], "of": across * down, "why": str(error)}
    low, high = points.min(axis=0), points.max(axis=0)
    height, width = image.shape
    tilt_deg, toward = tilt(board.corners_mm(ids), points, (width, height))
    return {
        "corners_px": np.round(points, 1).tolist(),
        "of": across * down,
        "covers_percent": 100.0 * float(np.prod(high - low)) / (width * height),
        "tilt_deg": tilt_deg,
        "toward": toward,
        "next": wanted_next(panel.workspace.folder),
        "size_px": [width, height],
    }


def tilt(
    corners_mm: Any, points_px: Any, size_px: tuple[int, int]
) -> tuple[float, str]:
    """Return a board's tilt in degrees, and which of its sides is the nearest.

    The focal length is taken as the picture's width: good to a few degrees, enough to
    say how to hold the board.
    """
    import cv2

    width, height = size_px
    camera = np.array(
        [[width, 0.0, width / 2.0], [0.0, width, height / 2.0], [0.0, 0.0, 1.0]]
    )
    corners = np.column_stack([corners_mm, np.zeros(len(corners_mm))])
    good, turned, _ = cv2.solvePnP(corners, points_px, camera, None)
    if not good:
        return float("nan"), ""
    normal = cv2.Rodrigues(turned)[0][:, 2]
    normal = normal if normal[2] < 0.0 else -normal
    angle = float(np.degrees(np.arccos(np.clip(-normal[2], -1.0, 1.0))))
    across, up = normal[0], normal[1]
    if abs(across) > abs(up):
        return angle, "left" if across > 0.0 else "right"
    return angle, "top" if up > 0.0 else "bottom"


def wanted_next(folder: Path) -> str:
    """Return in words which view of the board is wanted next."""
    if not (folder / FOLDER / PLANE).is_file():
        return "lay the board flat where the rod will be, and take the flat picture"
    taken = {path.stem.rpartition("_")[2] for path in (folder / FOLDER).glob("lens_*")}
    missing = [side for side in SIDES if side not in taken]
    if missing:
        low, high = GOOD_TILT_DEG
        return (
            f"for the lens: lift the board's {missing[0]} side by {low:.0f} to "
            f"{high:.0f} degrees (not needed for a first calibration)"
        )
    return "every side was lifted once: calibrate"


def take(panel: Panel, kind: str) -> str:
    """Keep the live picture as a photograph of the board; return what was kept.

    Raises
    ------
    InputError
        If the kind is neither ``plane`` nor ``lens``.
    VisionError
        If the board is not seen, or lies flat where it should be tilted.
    """
    if kind not in ("plane", "lens"):
        raise InputError(f"a picture of the board is plane or lens; not {kind!r}")
    picture = panel.snapshot()
    seen = look(panel)
    if not seen["corners_px"]:
        raise VisionError(str(seen["why"]))
    name = PLANE
    if kind == "lens":
        low, _ = GOOD_TILT_DEG
        if not seen["tilt_deg"] >= low:
            raise VisionError(
                f"the board must be tilted by {low:g} degrees or more for the lens; "
                f"instead it is by {seen['tilt_deg']:.0f}"
            )
        count = len(list((panel.workspace.folder / FOLDER).glob("lens_*")))
        if count >= MOST_LENS:
            raise InputError(f"{MOST_LENS} tilted pictures are enough; calibrate")
        name = f"lens_{count + 1}_{seen['toward']}.png"
    from ...rig import encode_png

    folder = panel.workspace.folder / FOLDER
    folder.mkdir(exist_ok=True)
    write_bytes(folder / name, encode_png(picture.image))
    return name


def forget(panel: Panel) -> None:
    """Delete the photographs of the board, to begin anew."""
    for path in (panel.workspace.folder / FOLDER).glob("*.png"):
        path.unlink()


def calibrate(
    panel: Panel, *, rod_height_mm: float | None, print_scale: float
) -> dict[str, Any]:
    """Calibrate from the photographs of the board; write ``calibration.json``.

    Raises
    ------
    VisionError, InputError
        If they do not do.
    """
    from ...vision import calibrate as fit
    from ...vision import read_photo, write_calibration

    folder = panel.workspace.folder / FOLDER
    if not (folder / PLANE).is_file():
        raise MagbendError("take a picture of the board lying flat first")
    lens = [read_photo(path) for path in sorted(folder.glob("lens_*.png"))]
    calibration = fit(
        read_photo(folder / PLANE), lens, board=board_of(print_scale),
        rod_height_mm=rod_height_mm,
    )  # fmt: skip
    write_calibration(calibration, panel.workspace.calibration_path)
    return {
        "text": f"calibrated: {calibration.rms_px:.3f} px RMS, tilt "
        f"{calibration.tilt_deg:.1f} deg",
        "views": [
            {"name": view.name, "rms_px": view.rms_px, "why_not": view.why_not}
            for view in calibration.views
        ],
    }


def _grey(image: Any) -> Any:
    import cv2

    from ..bench.sight import as_bytes

    bytes_ = as_bytes(image)
    return bytes_ if bytes_.ndim == 2 else cv2.cvtColor(bytes_, cv2.COLOR_BGR2GRAY)
