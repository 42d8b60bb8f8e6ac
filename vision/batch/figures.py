"""The processing steps as one figure: raw, binarised, edges, centreline."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError, VisionError
from ...core.files import write_bytes
from ..extraction.extract import measure
from ..extraction.setting import Setting
from ..find.binarise import binarise
from ..measurement import Measurement
from ..picture.photo import Photo
from ..picture.srgb import encode_srgb

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

_AXIS, _LEFT, _RIGHT = "#d9480f", "#1971c2", "#2f9e44"


def figure_of_steps(photo: Photo, setting: Setting, path: Path) -> None:
    """Draw how one photograph is measured, as the paper's figure on bending tests.

    Parameters
    ----------
    photo : Photo
        A photograph that can be measured.
    setting : Setting
        As for `measure`.
    path : Path
        The figure: ``.pdf``, ``.svg`` or ``.png``.

    Raises
    ------
    InputError
        If the suffix is none of these.
    VisionError
        If the photograph cannot be measured.
    """
    from matplotlib.figure import Figure

    kind = figure_kind(path)
    found = measure(photo, setting)
    if not found.ok:
        raise VisionError(f"{photo.source}: cannot be measured: {found.reason}")
    figure = Figure(figsize=(9.0, 7.6))
    (raw, black), (edges, line) = figure.subplots(2, 2)
    figure.subplots_adjust(
        left=0.08, right=0.98, bottom=0.07, top=0.95, wspace=0.22, hspace=0.28
    )
    window = _window(found, photo.size_px)
    _raw(raw, photo, window)
    _binarised(black, photo, setting, window)
    _edges(edges, photo, found)
    _centreline(line, found)
    for axes in (raw, black, edges, line):
        axes.tick_params(labelsize=8)
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, dpi=200)
    write_bytes(path, buffer.getvalue())


def figure_kind(path: Path) -> str:
    """Return the kind of file that a figure's path asks for.

    Raises
    ------
    InputError
        If the suffix is not one of ``.pdf``, ``.svg`` and ``.png``.
    """
    kind = path.suffix.lower().lstrip(".")
    if kind not in ("pdf", "svg", "png"):
        raise InputError(
            f"{path}: a figure is written as .pdf, .svg or .png; "
            f"instead received {path.suffix!r}"
        )
    return kind


def _title(axes: Axes, text: str) -> None:
    axes.set_title(text, loc="left", fontsize=9)


def _window(found: Measurement, size_px: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return left, right, top, bottom around the rod, in pixels."""
    points = found.points_px
    margin = 0.15 * found.length_px
    low = np.maximum(points.min(axis=0) - margin, 0.0).astype(int)
    high = np.minimum(points.max(axis=0) + margin, np.array(size_px) - 1.0).astype(int)
    return int(low[0]), int(high[0]), int(low[1]), int(high[1])


def _raw(axes: Axes, photo: Photo, window: tuple[int, int, int, int]) -> None:
    _title(axes, "a  photograph")
    _show(axes, photo, window)


def _show(axes: Axes, photo: Photo, window: tuple[int, int, int, int]) -> None:
    left, right, top, bottom = window
    part = photo.grey[top : bottom + 1, left : right + 1]
    white = max(float(np.quantile(part, 0.995)), 1e-6)
    axes.imshow(
        encode_srgb(np.asarray(part / white, dtype=np.float32)),
        cmap="gray",
        vmin=0,
        vmax=255,
        extent=(left - 0.5, right + 0.5, bottom + 0.5, top - 0.5),
        interpolation="nearest",
    )
    axes.set_xlabel("x (px)", fontsize=8)
    axes.set_ylabel("y (px)", fontsize=8)


def _binarised(
    axes: Axes, photo: Photo, setting: Setting, window: tuple[int, int, int, int]
) -> None:
    _title(axes, "b  binarised (relative to the paper's light)")
    binary = binarise(photo.grey, invert=setting.invert)
    left, right, top, bottom = window
    if binary is not None:
        height, width = binary.mask.shape
        factor = binary.factor
        axes.imshow(
            1 - binary.mask,
            cmap="gray",
            vmin=0,
            vmax=1,
            extent=(-0.5, width * factor - 0.5, height * factor - 0.5, -0.5),
            interpolation="nearest",
        )
    axes.set_xlim(left - 0.5, right + 0.5)
    axes.set_ylim(bottom + 0.5, top - 0.5)
    axes.set_xlabel("x (px)", fontsize=8)
    axes.set_ylabel("y (px)", fontsize=8)


def _edges(axes: Axes, photo: Photo, found: Measurement) -> None:
    """Show the last piece before the tip, close up, with its edges and axis."""
    _title(axes, "c  edges and axis near the tip")
    tip = np.array(found.tip_px)
    reach = max(3.0 * found.width_px, 20.0)
    width, height = photo.size_px
    left, top = np.maximum(np.floor(tip - reach), 0).astype(int)
    right, bottom = np.minimum(np.ceil(tip + reach), (width - 1, height - 1)).astype(
        int
    )
    _show(axes, photo, (int(left), int(right), int(top), int(bottom)))
    points = found.points
    for side, colour in (("left", _LEFT), ("right", _RIGHT)):
        if f"{side}_x_px" in points:
            axes.plot(
                points[f"{side}_x_px"], points[f"{side}_y_px"], ".", ms=2.5, c=colour
            )
    axes.plot(points["x_px"], points["y_px"], "-", lw=1.0, c=_AXIS)
    axes.plot(*tip, "+", ms=9, c=_AXIS)
    axes.set_xlim(left - 0.5, right + 0.5)
    axes.set_ylim(bottom + 0.5, top - 0.5)


def _centreline(axes: Axes, found: Measurement) -> None:
    points = found.points
    calibrated = found.pose is not None
    _title(axes, "d  centreline" + (", specimen frame" if calibrated else ""))
    unit = "mm" if calibrated else "px"
    axes.plot(points[f"x_{unit}"], points[f"y_{unit}"], "-", lw=1.4, c=_AXIS)
    axes.plot(points[f"x_{unit}"][0], points[f"y_{unit}"][0], "ks", ms=4)
    axes.set_aspect("equal", adjustable="datalim")
    if not calibrated:
        axes.invert_yaxis()
    axes.grid(True, lw=0.3)
    axes.set_xlabel(f"x ({unit})", fontsize=8)
    axes.set_ylabel(f"y ({unit})", fontsize=8)
