"""Place and direction of the clamp: its lines and the rod that leaves it, in one fit.

Two numbers are sought: where along the rod it leaves the clamp, and in which direction.
The lines at the clamp tell the place. The rod tells the direction, by its tangent
there, which on a bent rod hangs on the place. And the clamp's front tells the
direction: the rod leaves it squarely, as far as clamps are made so. Each has its
deviation; what they say together is the least squares of all three.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera.calibration import Calibration
from ..edge.clamp import FRONT_SEEN
from ..edge.crossings import EndFace
from ..edge.wall_light import WALL_PLACES
from ..find.ground import View
from .deviations import EDGE_MM, direction_rad, turned_by_shade, white_px
from .refine import Refined
from .setting import Setting
from .told_clamp import ToldClamp, surer_direction

Array = NDArray[np.float64]

LONE_DEG = 0.86
"""Turn by shade beside the root above which the rod says nothing of its direction: what
the front of the clamp tells, which may be the shade's, is then unchecked."""
APART = 3.0
"""Deviations by which rod and front may differ before one of them is doubted."""
_BASE_PX = 20.0
"""Length of a line over which the camera sees it straight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampFit:
    """Where the rod leaves the clamp, and in which direction.

    Parameters
    ----------
    s : float
        Arc length on the fitted curve, px.
    angle_deg : float
        Direction in the board frame.
    covariance : ndarray, shape (2, 2)
        Of place and direction, px and rad.
    flags : tuple of str
        Doubts by name.
    """

    s: float
    angle_deg: float
    covariance: Array
    flags: tuple[str, ...] = ()

    @property
    def angle_sd_deg(self) -> float:
        """Standard deviation of the direction."""
        return math.degrees(math.sqrt(self.covariance[1, 1]))


def fit_clamp(
    told: ToldClamp, refined: Refined, seen_in: View, setting: Setting,
    camera: Calibration,
) -> ClampFit:  # fmt: skip
    """Return place and direction by all that tells them; by a tag where it is surer.

    Parameters
    ----------
    told : ToldClamp
        The place, and what a tag tells.
    refined, seen_in, setting, camera
        The rod in pixels, the light it is seen in, what is known, and the camera.
    """
    curve, root = refined.fit.curve, told.root
    s = np.linspace(root.s, refined.tip.s, WALL_PLACES)
    view = setting.view(camera, *curve.at(s))
    wall = setting.wall_px(view, np.interp(s, curve.s, refined.width))
    rod_sd = direction_rad(refined, root.s, np.interp(curve.s, s, wall), seen_in)
    heading = float(view.heading[0])
    turn, turn_sd = _front(refined, setting, camera, heading)
    # y runs down in the picture: there the heading turns the other way.
    bend = -float(np.interp(root.s, curve.s, curve.kappa))
    edge = EDGE_MM * float(view.along[0])
    place_sd = math.hypot(root.sd, white_px(refined), edge)
    seen = FRONT_SEEN * refined.typical_width
    shift, covariance, apart = joint(place_sd, rod_sd, bend, turn, turn_sd, seen)
    if root.lines_differ and apart > APART:  # that front is not the clamp's
        shift, covariance, _ = joint(place_sd, rod_sd, bend, 0.0, math.inf, seen)
    own_sd_deg = math.degrees(math.sqrt(covariance[1, 1]))
    angle_deg, sd_deg, flags = surer_direction(
        told, math.degrees(heading + shift[1]), own_sd_deg
    )
    if sd_deg != own_sd_deg:
        shift[0], covariance = 0.0, np.diag([place_sd, math.radians(sd_deg)]) ** 2
    if root.lines_differ or apart > APART:
        flags = (*flags, "clamp_lines_differ")
    if turned_by_shade(refined) > math.radians(LONE_DEG):
        flags = (*flags, "direction_doubtful")
    return ClampFit(
        s=root.s + shift[0], angle_deg=angle_deg, covariance=covariance, flags=flags
    )


def joint(
    place_sd: float, rod_sd: float, bend: float, turn: float, turn_sd: float,
    seen: float,
) -> tuple[Array, Array, float]:  # fmt: skip
    """Return place and direction by least squares of what lines, rod and front tell.

    Parameters
    ----------
    place_sd : float
        Deviation of the place that the lines tell, px.
    rod_sd, bend : float
        Deviation of the rod's direction at a place, rad, and by how much it turns on
        the next pixel.
    turn, turn_sd : float
        By how much the front's direction is off the rod's where the lines tell the
        place, and its deviation, rad; infinite where no front is seen.
    seen : float
        Length of the front that is seen, px.

    Returns
    -------
    shift : ndarray, shape (2,)
        Of place and direction, px and rad.
    covariance : ndarray, shape (2, 2)
        Of these: wider by the part of `apart` above `APART`, and of a front askew.
    apart : float
        By how many deviations rod and front differ.

    Notes
    -----
    Beyond `APART` the clamp may not be square, or the rod's tangent may be wrong. A rod
    that is surer than the front is then believed alone. A front that is more askew than
    the deviations tell may be of something else, a shade or a chamfer, and its place is
    then off by as much as that turns it over its length.
    """
    rows = np.array([[1.0, 0.0], [-bend, 1.0], [0.0, 1.0]])
    weight = np.array([place_sd, rod_sd, turn_sd]) ** -2.0
    expected = math.hypot(place_sd * bend, rod_sd, turn_sd)
    apart = abs(turn) / expected
    if apart > APART and rod_sd < turn_sd:
        weight[2] = 0.0
    covariance = np.linalg.inv((rows.T * weight) @ rows)
    shift = covariance[:, 1] * weight[2] * turn
    askew = math.sqrt(max(turn**2 - expected**2, 0.0))
    moved = seen * askew * np.array([1.0, bend])
    covariance = covariance * max(1.0, apart / APART) ** 2 + np.outer(moved, moved)
    return shift, covariance, apart


def _front(
    refined: Refined, setting: Setting, camera: Calibration, heading: float
) -> tuple[float, float]:
    """Return by how much the front's direction is off a heading, and its deviation.

    At any height: planes of two heights are seen alike but for their scale.
    """
    front = None if refined.clamp is None else refined.clamp.front
    if front is None:
        return 0.0, math.inf
    right = _across(refined, front)
    seen = camera.to_mm(right, height_mm=setting.axis_height_mm)
    ahead = np.arctan2(*(seen[1] - seen[0])[::-1]) + 0.5 * np.pi
    turn = math.remainder(float(ahead) - heading, 2.0 * math.pi)
    return turn, math.hypot(math.radians(setting.clamp_square_sd_deg), front.skew_sd)


def _across(refined: Refined, line: EndFace) -> Array:
    """Return two points on a line across the rod, the second to its right, px."""
    points, theta = refined.fit.curve.at(np.array([line.s]))
    along = np.array([math.cos(theta[0]), math.sin(theta[0])])
    step = _BASE_PX * (np.array([-along[1], along[0]]) + line.skew * along)
    return points + np.array([[-1.0], [1.0]]) * step
