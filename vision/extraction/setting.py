"""What is known beside a photograph, and what it says of a rod in pixels."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...core.specimen import Specimen
from ..camera.calibration import Calibration
from ..camera.projection import LocalView, local_view
from ..curve.curve import Curve, arc_lengths
from ..find.sought import Clamp, Sought
from ..picture.photo import Photo

Array = NDArray[np.float64]

UNKNOWN_CLAMP_MM = 5.0
"""A clamp of unknown height may rise so far above the rod's axis."""

CLAMP_SQUARE_SD_DEG = 0.25
"""A front 10 mm wide that is out of square by 0.04 mm, as printed ones may be."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """How photographs are measured: what is known beside them.

    Parameters
    ----------
    calibration : Calibration or None
        The camera; None measures in pixels only, flagged ``uncalibrated``.
    rod_height_mm : float or None
        Height of the rod's axis above the board's plane; None takes the calibration's.
    invert : bool or None
        True for a light rod on a dark background; None looks for itself.
    joints_mm : tuple of float
        Arc lengths at which the stiffness jumps, and so the curvature may.
    length_mm : float or None
        Nominal free length; a measured length 2 % off is flagged ``length_mismatch``.
    length_sd_mm : float or None
        How well that is known: then a length is off that differs by three deviations.
    side_mm : float or None
        Nominal side of its section: tells the rod from other long thin things.
    is_round : bool or None
        Whether its section is a circle: it is seen no wider than it is, from whatever
        side, and has no walls. None where it is not told: the rod is taken for square
        then, and the deviations include that it may be round, or flat.
    height_share : float
        Height of its section over the side that the camera sees.
    colour : str or None
        What it looks like on white paper, ``#rrggbb``: tells it from its shade too.
    clamp : {"auto", "none"}
        ``none`` also measures a rod that floats freely, from one end to the other.
    clamp_height_mm : float or None
        Height of the clamp's top above the board's plane. Needed only where the camera
        looks over the clamp so that it hides the root (flag ``root_hidden``).
    clamp_square_sd_deg : float
        How squarely to the clamp's front the rod leaves it: standard deviation.
    bare : Photo or None
        The same scene without rod and clamp: its light is divided out.
    guide_px : tuple of tuple of float
        Corners of the guide that a rod slides out of: `bare` is an empty channel then,
        and the guide counts as the clamp (`bare.flattened`).
    linear : bool or None
        Whether the values of the files are proportional to light (`read_photo`).
    """

    calibration: Calibration | None = None
    rod_height_mm: float | None = None
    invert: bool | None = None
    joints_mm: tuple[float, ...] = ()
    length_mm: float | None = None
    length_sd_mm: float | None = None
    side_mm: float | None = None
    is_round: bool | None = None
    height_share: float = 1.0
    colour: str | None = None
    clamp: Clamp = "auto"
    clamp_height_mm: float | None = None
    clamp_square_sd_deg: float = CLAMP_SQUARE_SD_DEG
    bare: Photo | None = None
    guide_px: tuple[tuple[float, float], ...] = ()
    linear: bool | None = None

    @property
    def axis_height_mm(self) -> float:
        """Height of the rod's axis above the board's plane, as far as it is known."""
        if self.rod_height_mm is not None:
            return self.rod_height_mm
        return (self.calibration and self.calibration.rod_height_mm) or 0.0

    def fingerprint(self) -> str:
        """Return a digest that changes with everything that changes a result."""
        data = asdict(replace(self, bare=None))
        if self.bare is not None:
            data["bare"] = hashlib.sha256(self.bare.grey.tobytes()).hexdigest()
        text = json.dumps(data, sort_keys=True, default=np.ndarray.tolist)
        return hashlib.sha256(text.encode()).hexdigest()

    def sought(self, size_px: tuple[int, int]) -> Sought:
        """Return what is known of the rod in a picture of a size."""
        known = Sought(invert=self.invert, clamp=self.clamp, colour=self.colour)
        if self.calibration is None:
            return known
        middle = (0.5 * size_px[0], 0.5 * size_px[1])
        scale = self.calibration.mm_per_px(middle, height_mm=self.axis_height_mm)
        return replace(
            known,
            width_px=(self.side_mm or 0.0) / scale,
            length_px=(self.length_mm or 0.0) / scale,
        )

    def joints_px(self, curve: Curve) -> Sequence[float]:
        """Return the joints as arc lengths in px on a curve."""
        if not self.joints_mm:
            return ()
        if self.calibration is None:
            if self.length_mm is None:
                return ()
            scale = curve.s[-1] / self.length_mm
            return [scale * joint for joint in self.joints_mm]
        points = self.calibration.to_mm(curve.points, height_mm=self.axis_height_mm)
        s_mm = arc_lengths(points)
        return [float(np.interp(joint, s_mm, curve.s)) for joint in self.joints_mm]

    def walls_px(
        self, points: Array, theta: Array, width_px: float
    ) -> tuple[Array, Array]:
        """Return how wide the side walls are seen, positive on the left; see `refine`.

        And the gap below them, alike. Only with a calibration.
        """
        if self.calibration is None:
            return np.zeros(len(points)), np.zeros(len(points))
        view = self.view(self.calibration, points, theta)
        wall = self.wall_px(view, width_px)
        return wall, view.rise_across * self.axis_height_mm - 0.5 * wall

    def silhouette(self, view: LocalView) -> Array:
        """Return the pixels between the edges of a rod per mm of its side."""
        if self.is_round:
            return np.hypot(view.across, view.rise_across)
        return view.across + self.height_share * np.abs(view.rise_across)

    def wall_px(self, view: LocalView, width_px: Array | float) -> Array:
        """Return how wide a side wall is seen of a rod of a width in pixels."""
        if self.is_round:
            return np.zeros_like(view.across)
        rise = self.height_share * view.rise_across
        return np.asarray(rise * width_px / self.silhouette(view))

    def face_px(self, curve: Curve) -> float:
        """Return how much of a clamp's face may be seen at the root of a curve."""
        height = self.clamp_height_mm or self.axis_height_mm + UNKNOWN_CLAMP_MM
        return self._lean_px(curve) * height

    def foot_px(self, curve: Curve) -> float:
        """Return how much of it is seen below the axis."""
        return self._lean_px(curve) * self.axis_height_mm

    def _lean_px(self, curve: Curve) -> float:
        """Return how much is seen of each mm of the height of a clamp's face."""
        if self.calibration is None:
            return 0.0
        ends = curve.points[:1], curve.theta[:1]
        return max(0.0, -float(self.view(self.calibration, *ends).rise_along[0]))

    def view(self, camera: Calibration, points: Array, theta: Array) -> LocalView:
        """Return how the camera sees the rod's axis at points and angles in px."""
        seen: LocalView = local_view(camera.camera, points, theta, self.axis_height_mm)
        return seen


def with_specimen(setting: Setting, specimen: Specimen) -> Setting:
    """Return a setting that knows a specimen, where it does not say otherwise itself.

    Parameters
    ----------
    setting : Setting
        What is known already; it is kept.
    specimen : Specimen
        Tells shape, side, length, joints and colour.
    """
    section = specimen.cross_sections[0]
    own_sd_mm = specimen.length_sd_mm if setting.length_mm is None else None
    return replace(
        setting,
        length_sd_mm=setting.length_sd_mm or own_sd_mm,
        side_mm=setting.side_mm or specimen.side_mm,
        length_mm=setting.length_mm or specimen.length_mm,
        joints_mm=setting.joints_mm or specimen.joints_mm,
        is_round=section.is_round,
        height_share=section.height_mm / section.width_mm,
        colour=setting.colour or specimen.colour,
    )
