"""Photographs of a board to a `Calibration`: plane, lens, and how well known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.checks import finite, positive
from ...core.errors import InputError, VisionError
from ..picture.photo import Photo
from ..picture.srgb import encode_srgb
from ..picture.turn import turned
from .board import Board, find_corners
from .bundle import Bundle, Corners, default_prior, fit_bundle
from .calibration import Calibration, View, scale_calibration

Array = NDArray[np.float64]

BAD_VIEW = 3.0
"""A lens view is dropped when its RMS is this many times the median of all views."""

FLAT = 0.02
"""RMS of the plane's corners, in sides of a square, above which no board lay flat."""

_TURN = np.diag([1.0, -1.0, -1.0])  # from our board frame to OpenCV's


@dataclass(frozen=True, slots=True)
class _Seen:
    """One photograph with its corners, or the reason why it has none."""

    name: str
    corners: Corners | None
    why_not: str = ""


def calibrate(
    plane: Photo,
    lens: Sequence[Photo] = (),
    *,
    board: Board,
    rod_height_mm: float | None = None,
    camera_height_mm: float | None = None,
    focal_px: float | None = None,
) -> Calibration:
    """Calibrate a camera from photographs of a board.

    Parameters
    ----------
    plane : Photo
        The board in the measuring plane; it alone is enough.
    lens : sequence of Photo
        The same board tilted by 20 to 40 degrees in different ways: they give the focal
        length and the distortion of the lens. Views that do not fit are dropped.
    board : Board
        What was printed.
    rod_height_mm : float, optional
        Height of the rod's axis above the board's plane, kept for later.
    camera_height_mm, focal_px : float, optional
        What the user knows: distance from the lens to the plane (2 % is enough), or
        focal length over pixel size.

    Returns
    -------
    Calibration
        Its `camera_height_sd_mm` says how well the height above the plane is known,
        on which the correction for the rod's height rests.

    Raises
    ------
    VisionError
        If the plane's photograph shows no board, a mirrored one, or one whose corners
        are not those of a flat board.

    Notes
    -----
    A view squarely from above says little about the focal length; then a broad prior
    decides and `camera_height_sd_mm` is large. The plane itself is well known all the
    same. The board is taken for square: if its print is stretched by 0.1 % in one
    direction, a single view misreads its height. See `bundle` for the fit.
    """
    if rod_height_mm is not None:
        finite(rod_height_mm, "rod_height_mm", "mm")
    for value, name, unit in (
        (camera_height_mm, "camera_height_mm", "mm"), (focal_px, "focal_px", "px"),
    ):  # fmt: skip
        if value is not None:
            positive(value, name, unit)
    first = _see(plane, board, plane.size_px)
    if first.corners is None:
        raise VisionError(f"{plane.source}: {first.why_not}")
    others = [
        _see(turned(photo, plane.orientation), board, plane.size_px) for photo in lens
    ]
    seen = [first, *others]
    used = [i for i, one in enumerate(seen) if one.corners is not None]

    def fit(chosen: list[int]) -> Bundle:
        views = [c for i in chosen if (c := seen[i].corners) is not None]
        prior = default_prior(
            plane.size_px,
            views=len(views),
            focal_px=focal_px,
            distance_mm=camera_height_mm,
        )
        return fit_bundle(views, plane.size_px, prior)

    bundle = fit(used)
    rms = {i: _rms(r) for i, r in zip(used, bundle.residuals_px, strict=True)}
    limit = BAD_VIEW * float(np.median(list(rms.values())))
    kept = [i for i in used if i == 0 or rms[i] <= limit]
    if len(kept) < len(used):
        bundle = fit(kept)
        rms |= {i: _rms(r) for i, r in zip(kept, bundle.residuals_px, strict=True)}
    views = tuple(
        View(
            name=one.name,
            rms_px=rms.get(i, math.nan),
            corners=0 if one.corners is None else len(one.corners.points_px),
            used=i in kept,
            why_not=one.why_not
            or ("" if i in kept else f"RMS above {BAD_VIEW:g} times the median"),
        )
        for i, one in enumerate(seen)
    )
    source = _source(len(kept), camera_height_mm, focal_px)
    return _calibration(bundle, plane, board, views, source, rod_height_mm)


def _see(photo: Photo, board: Board, size_px: tuple[int, int]) -> _Seen:
    """Find the board's corners in a photograph, in OpenCV's board frame."""
    if photo.size_px != size_px:
        width, height = photo.size_px
        why = f"is {width} x {height} px, the plane's is {size_px[0]} x {size_px[1]} px"
        return _Seen(photo.source, None, why)
    white = float(np.quantile(photo.grey[::4, ::4], 0.99))
    grey = encode_srgb(np.asarray(photo.grey / max(white, 1e-6), dtype=np.float32))
    try:
        ids, points = find_corners(grey, board)
    except VisionError as error:
        return _Seen(photo.source, None, str(error))
    corners = Corners(board_mm=board.corners_mm(ids) * [1.0, -1.0], points_px=points)
    return _Seen(photo.source, corners)


def _rms(residuals: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(residuals**2, axis=1))))


def _source(views: int, camera_height_mm: float | None, focal_px: float | None) -> str:
    if camera_height_mm is not None:
        return "given"
    if focal_px is not None:
        return "focal length given"
    return "lens views" if views > 1 else "perspective of one view"


def _calibration(
    bundle: Bundle, plane: Photo, board: Board, views: tuple[View, ...], source: str,
    rod_height_mm: float | None,
) -> Calibration:  # fmt: skip
    calibration = Calibration(
        image_size_px=plane.size_px,
        focal_px=(bundle.focal_px, bundle.focal_px),
        centre_px=bundle.centre_px,
        distortion=bundle.distortion,
        rotation=bundle.rotations[0] @ _TURN,
        translation_mm=bundle.translations[0],
        camera_height_sd_mm=0.0,
        camera_height_source=source,
        scale_relative_sd=bundle.scale_relative_sd,
        tilt_sd_deg=math.degrees(bundle.tilt_sd),
        rms_px=views[0].rms_px,
        rod_height_mm=rod_height_mm,
        print_scale=board.print_scale,
        board=board.describe(),
        views=views,
        orientation=plane.orientation,
    )
    height = calibration.camera_height_mm
    if height <= 0.0:
        raise VisionError(
            f"{plane.source}: the board appears mirrored; photograph its printed side, "
            "not through the paper or a mirror"
        )
    _check_flat(calibration, board, plane.source)
    if bundle.distance_relative_sd > 0.3 and source == "perspective of one view":
        source = "hardly known: one view squarely from above"
    return Calibration(
        **{
            name: getattr(calibration, name)
            for name in Calibration.__dataclass_fields__
            if name not in ("camera_height_sd_mm", "camera_height_source")
        },
        camera_height_sd_mm=height * bundle.distance_relative_sd,
        camera_height_source=source,
    )


def _check_flat(calibration: Calibration, board: Board, source: str) -> None:
    square_mm = board.square_mm * board.print_scale
    square_px = square_mm / calibration.mm_per_px(calibration.centre_px, height_mm=0.0)
    if calibration.rms_px > FLAT * square_px:
        raise VisionError(
            f"{source}: its corners lie {calibration.rms_px:.1f} px (RMS) off a flat "
            f"board with squares of {square_px:.0f} px; lay the board flat, focus on "
            "it, and say which board it is"
        )


def calibrate_known_length(
    size_px: tuple[int, int],
    *,
    from_px: tuple[float, float],
    to_px: tuple[float, float],
    length_mm: float,
    click_sd_px: float = 1.0,
    camera_height_mm: float | None = None,
    rod_height_mm: float | None = None,
) -> Calibration:
    """Calibrate from one known length: the fallback where there is no board.

    Parameters
    ----------
    size_px : tuple of int
        Width and height of the photographs.
    from_px, to_px : tuple of float
        Its two ends in the photograph, such as two ticks of a ruler.
    length_mm : float
        The length between them.
    click_sd_px : float
        Standard deviation of each end in pixels.
    camera_height_mm : float, optional
        Height of the camera above the ruler's plane; without it height is not
        corrected.
    rod_height_mm : float, optional
        Height of the rod's axis above that plane.

    Raises
    ------
    InputError
        If the ends lie closer than 10 pixels or outside the picture, or a number
        cannot be.
    """
    positive(length_mm, "length_mm", "mm")
    ends = [finite(value, "an end", "px") for value in (*from_px, *to_px)]
    width, height = size_px
    for x, y in (ends[:2], ends[2:]):
        if not (-0.5 <= x <= width - 0.5 and -0.5 <= y <= height - 0.5):
            raise InputError(
                "the ends of the known length must lie in the photograph of "
                f"{width} x {height} px; instead received {x:g},{y:g}"
            )
    distance = math.hypot(ends[2] - ends[0], ends[3] - ends[1])
    if distance < 10.0:
        raise InputError(
            "the ends of the known length must lie at least 10 px apart; "
            f"instead received {distance:.3g} px"
        )
    return scale_calibration(
        mm_per_px=length_mm / distance,
        image_size_px=size_px,
        camera_height_mm=camera_height_mm,
        scale_relative_sd=math.sqrt(2.0) * click_sd_px / distance,
        rod_height_mm=rod_height_mm,
        source=f"known length: {length_mm:g} mm over {distance:.6g} px",
    )
