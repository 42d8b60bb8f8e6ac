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
from ..edge.crossings import EndFace
from ..edge.wall_light import WALL_PLACES
from ..find.ground import View
from .deviations import EDGE_MM, is_dark, white_px
from .refine import Refined
from .setting import Setting
from .told_clamp import ToldClamp, surer_direction

Array = NDArray[np.float64]

SUPPLE, SUPPLE_FREEDOM = 1.2, 5.0
"""Factor on the fit's own deviation of the direction at the clamp for a curve of so
many free numbers, and with the root of more: they were chosen by the same points."""
BENT_BACK, BACK, BENT = 1.5, 0.25, 0.01
"""Factor for a rod that is bent both ways, the lesser way by this share at least, and
by so much over its width: no single force makes that, and what is known of moments
helps less at the root."""
TURN_SHADE, TURN_WALL, TURN_PALE_WALL = 0.35, 0.05, 0.4
"""Shares of the shade's pull, and of the side wall that is seen (on a rod that is not
dark: its light is not known), by which the midline is off all along, with one sign."""
LONE_DEG = 1.0
"""Turn by shade beside the root above which the rod says nothing of its direction: what
the front of the clamp tells, which may be the shade's, is then unchecked."""
DRIFT_SHADE, DRIFT_RELIT, DRIFT_WHITE, DRIFT_REACH = 0.15, 2.0, 0.03, 1.5
DRIFT_BENT, DRIFT_PALE_BENT = 0.17, 0.4
"""Errors that neighbours share over so many widths: of the shade's pull; of what an
edge may move where the light on the rod changes, as in the shade of its clamp; of the
blur where the paper is white; and, px, by the angle that a rod turns over its width,
for then the light on its sides changes."""
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
    rod_sd = _rod_sd(refined, np.interp(curve.s, s, wall), seen_in)
    heading = float(view.heading[0])
    turn, turn_sd = _front(refined, setting, camera, heading)
    # y runs down in the picture: there the heading turns the other way.
    bend = -float(np.interp(root.s, curve.s, curve.kappa))
    edge = EDGE_MM * float(view.along[0])
    place_sd = math.hypot(root.sd, white_px(refined), edge)
    shift, covariance, apart = joint(place_sd, rod_sd, bend, turn, turn_sd)
    own_sd_deg = math.degrees(math.sqrt(covariance[1, 1]))
    angle_deg, sd_deg, flags = surer_direction(
        told, math.degrees(heading + shift[1]), own_sd_deg
    )
    if sd_deg != own_sd_deg:
        shift[0], covariance = 0.0, np.diag([place_sd, math.radians(sd_deg)]) ** 2
    if root.lines_differ or apart > APART:
        flags = (*flags, "clamp_lines_differ")
    if _turned_by_shade(refined) > math.radians(LONE_DEG):
        flags = (*flags, "direction_doubtful")
    return ClampFit(
        s=root.s + shift[0], angle_deg=angle_deg, covariance=covariance, flags=flags
    )


def joint(
    place_sd: float, rod_sd: float, bend: float, turn: float, turn_sd: float
) -> tuple[Array, Array, float]:
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

    Returns
    -------
    shift : ndarray, shape (2,)
        Of place and direction, px and rad.
    covariance : ndarray, shape (2, 2)
        Of these: wider by the part of `apart` above `APART`.
    apart : float
        By how many deviations rod and front differ.

    Notes
    -----
    Beyond `APART` the clamp may not be square, or the rod's tangent may be wrong. A rod
    that is surer than the front is then believed alone.
    """
    rows = np.array([[1.0, 0.0], [-bend, 1.0], [0.0, 1.0]])
    weight = np.array([place_sd, rod_sd, turn_sd]) ** -2.0
    apart = abs(turn) / math.hypot(place_sd * bend, rod_sd, turn_sd)
    if apart > APART and rod_sd < turn_sd:
        weight[2] = 0.0
    covariance = np.linalg.inv((rows.T * weight) @ rows)
    shift = covariance[:, 1] * weight[2] * turn
    return shift, covariance * max(1.0, apart / APART) ** 2, apart


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


def _rod_sd(refined: Refined, wall: Array, seen_in: View) -> float:
    """Return the standard deviation of the rod's own direction at a place, rad.

    `wall` is how wide the side wall is seen, px, positive on the left.
    """
    fit, width = refined.fit, float(refined.width[0])
    facing, bent = (
        (TURN_WALL, DRIFT_BENT) if is_dark(seen_in)
        else (TURN_PALE_WALL, DRIFT_PALE_BENT)
    )  # fmt: skip
    drift = np.hypot(bent * fit.curve.kappa * width, DRIFT_SHADE * refined.shaded)
    drift = np.hypot(drift, DRIFT_RELIT * refined.relit)
    white = DRIFT_WHITE * refined.saturated * refined.blur
    both = sorted((fit.curve.kappa.max(), -fit.curve.kappa.min()))
    free = BENT_BACK if both[0] > max(BACK * both[1], BENT / width) else 1.0
    supple = SUPPLE * math.sqrt(fit.freedom / SUPPLE_FREEDOM)
    return math.hypot(
        free * supple * fit.sigma_theta[0],
        free * fit.turned(np.hypot(drift, white), DRIFT_REACH * width),
        _turned_by_shade(refined),
        facing * fit.lever @ wall,
    )


def _turned_by_shade(refined: Refined) -> float:
    """Return how far shade beside the root may turn the rod's own direction, rad."""
    return TURN_SHADE * abs(float(refined.fit.lever @ refined.shaded))
