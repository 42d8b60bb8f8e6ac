"""How well length, tip, width and the rod's direction are known: a list of causes.

What is measured in pixels has the deviations of its fit; the frame hangs on the clamp's
place (`root`) and direction; everything scales with the millimetres of a pixel. The
numbers are the likeliest for the errors on working scenes of the project's renderer
and on drawings by another; most are shares of something that a picture shows, so that
they vanish where it does.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..camera.calibration import Calibration
from ..camera.projection import LocalView
from ..curve.heading import sigma_heading
from ..curve.robust import median, quantile
from ..find.ground import View
from ..measurement import Measurement
from .refine import Refined
from .setting import Setting

Array = NDArray[np.float64]

EDGE_MM = 0.0005
"""Of every end, side and line: no edge is sharper."""

ALIKE_TIP = 3.0
"""Of an end, over what its lanes scatter by: they share shade, samples and levels."""
FACE_SEEN, FACE_HIDDEN = 0.08, 0.02
"""And in widths of its face: where the camera sees it, or it is not dark, so that its
light is not known; where its lower edge is hidden."""
PALE_TIP = 0.25
"""And in blurs, of a rod that is not dark."""

LIMB, LIMB_END = 0.09, 0.15
"""Of either side, and of an end, in blurs, unless the rod is told to be square: the
limb of a round one turns from the light, which is no step."""

WIDTH_BLUR, WIDTH_SHADE, WIDTH_GROWTH = 0.01, 0.6, 1.2
"""Of a width: in blurs, which are no Gaussian's; the share of a shade's pull that is
left in it; and over what edges differ with closer levels, as where a camera sharpened
its picture."""
WIDTH_FELT = 6.0
"""And in widths times the fourth power of the blur in widths: by so little do width and
blur change a profile differently, and so much is a lens out of focus no Gaussian."""
SIDE_FACE, PALE_FACE, WIDTH_FACE = 0.025, 0.5, 0.01
"""Of where a side ends whose face is seen, in widths of that face: on a dark rod, one
that is not dark, and what of it is left in a dark rod's width."""
PALE_PX = 0.2
"""Of a width that is not dark, whatever is seen of its sides."""

SUPPLE = 1.38
"""Of the direction at the clamp, over the fit's own: what is known of bending moments
holds roughly."""
ODD, BACK, LATE, BENT = 2.0, 0.25, 0.5, 0.01
"""Factor for a rod that is bent as no single force bends it: both ways, the lesser way
by this share at least, or its root by less than this share of its most; by so much over
its width. What is known of moments helps less at the root then. So it is beside paper
that is white, where edges are fitted to a part of their light."""
TURN_SHADE, TURN_WALL, TURN_PALE_WALL = 0.3, 0.13, 0.4
"""Shares of the shade's pull, and of the side wall that is seen (on a rod that is not
dark: its light is not known), by which the midline is off all along, with one sign."""
TURN_RELIT, TURN_UNEVEN, BESIDE, USUAL = 0.5, 0.3, 2.0, 0.9
"""Shares by which it is off of what an edge may move where the light on a rod changes
beside its clamp, within so many widths, by more than on this part of the rest, and of
what it is wider there than anywhere else: a shade may have moved one edge (a half is
all)."""

WHOLE, CUT_OFF = 0.05, 0.45
"""Of an edge beside paper that is white, in px and again in blurs where all its light
was fitted; else in blurs. With 1.5 times what makes it white, half level of what is
left lies 0.43 blurs off."""


def is_dark(seen_in: View) -> bool:
    """Whether a rod is seen dark in plain light, so that its faces' light is known."""
    return seen_in.sign > 0.0 and seen_in.plain


def faces_px(refined: Refined, wall: Array, seen_in: View, *, told: bool) -> Array:
    """Return the doubt of the midline by side faces, px, positive on the right.

    Parameters
    ----------
    refined : Refined
        The rod in pixels.
    wall : ndarray, shape (n,)
        How wide its side wall is seen, px, positive on the left.
    seen_in : View
        The light it is seen in.
    told : bool
        Whether its section is: else it may be round and have no such wall.
    """
    share = SIDE_FACE if is_dark(seen_in) else PALE_FACE
    moved = 0.0 if told else refined.walled
    return np.asarray(-np.sign(wall) * np.hypot(share * wall, moved))


def scale_sd(camera: Calibration, rod_height_mm: float) -> float:
    """Return how well the scale is known at the rod's height, relative."""
    if rod_height_mm == 0.0:
        return 0.0
    height = camera.camera_height_mm
    return abs(rod_height_mm) * camera.camera_height_sd_mm / height**2


def with_deviations(
    result: Measurement, refined: Refined, clamped: Array, view: LocalView,
    camera: Calibration, setting: Setting, faces: Array, *, dark: bool,
) -> Measurement:  # fmt: skip
    """Return a measurement with its standard deviations.

    Parameters
    ----------
    result : Measurement
        In mm.
    refined : Refined
        The rod in pixels.
    clamped : ndarray, shape (2, 2)
        Covariance of where it leaves the clamp and of its direction there, px and rad.
    view : LocalView
        How the camera sees its points.
    camera, setting : Calibration, Setting
        The camera, and what else is known.
    faces : ndarray, shape (n,)
        Doubt of the midline by side faces, px.
    dark : bool
        Whether the rod is seen dark in plain light.
    """
    own = camera.scale_relative_sd if math.isfinite(camera.scale_relative_sd) else 0.0
    scale = math.hypot(own, scale_sd(camera, setting.axis_height_mm))
    to_mm = np.array([1.0 / float(view.along[0]), 1.0])
    clamped = clamped * np.outer(to_mm, to_mm)
    clamp = math.sqrt(clamped[0, 0])
    soft = 0.0 if setting.is_round is False else refined.blur
    tip = _tip_px(result, refined, view, soft, dark=dark) / float(view.along[-1])
    width = _width_px(result, refined, view, soft, dark=dark) / median(view.across)
    untold = math.hypot(EDGE_MM, _section_mm(result, view, setting))
    return replace(
        result,
        length_sd_mm=math.hypot(clamp, tip, scale * result.length_mm),
        width_sd_mm=math.hypot(width, untold, scale * result.width_mm),
        clamp_sd_mm=clamp,
        tip_sd_mm=_tip_sd_mm(result, faces / view.along, clamped, tip, scale),
    )


def _tip_px(
    result: Measurement, refined: Refined, view: LocalView, soft: float, *, dark: bool
) -> float:
    """Return the deviation of where the end is, px; `soft` is the blur of a limb."""
    tip, rise = refined.tip, float(view.rise_along[-1])
    face = FACE_SEEN if rise < 0.0 or not dark else FACE_HIDDEN
    return math.hypot(
        ALIKE_TIP * tip.sigma,
        face * rise * result.width_mm,
        0.0 if dark else PALE_TIP * refined.blur,
        LIMB_END * soft,
        white_px(refined),
        EDGE_MM * float(view.along[-1]),
    )


def _width_px(
    result: Measurement, refined: Refined, view: LocalView, soft: float, *, dark: bool
) -> float:
    """Return the deviation of the width between the edges, px; see `_tip_px`."""
    wall = WIDTH_FACE if dark else PALE_FACE
    return math.hypot(
        median(refined.sigma_width) / math.sqrt(max(1.0, _widths(refined))),
        WIDTH_BLUR * refined.blur if dark else PALE_PX,
        WIDTH_SHADE * median(refined.shaded),
        WIDTH_GROWTH * refined.growth,
        wall * median(np.abs(view.rise_across)) * result.width_mm,
        2.0 * LIMB * soft,
        2.0 * white_px(refined),
        WIDTH_FELT * refined.blur**4 / refined.typical_width**3,
    )


def _section_mm(result: Measurement, view: LocalView, setting: Setting) -> float:
    """Return by how much a rod of untold section is wider if it is flat or round."""
    if setting.is_round is not None:
        return 0.0
    seen = median(np.abs(view.rise_across) / view.across)
    return setting.height_share * result.width_mm * seen


def white_px(refined: Refined) -> float:
    """Return the doubt of an edge because of white beside it, px."""
    unsure = WHOLE * (1.0 + refined.blur) if refined.whole else CUT_OFF * refined.blur
    return unsure * refined.saturated


def _widths(refined: Refined) -> float:
    return float(refined.fit.curve.s[-1]) / refined.typical_width


def _tip_sd_mm(
    result: Measurement, faces: Array, clamped: Array, tip: float, scale: float
) -> tuple[float, float]:
    """Return the tip's deviations along x and y of the specimen frame.

    What side faces shift alike at the root and at the tip moves the frame with the tip.
    A clamp that is taken too far out by d, and turned too far by f, moves the tip by
    y f - d along x, and by -x f along y.
    """
    own = result.points["sigma_mm"]
    across = np.sqrt(np.maximum(own**2 - faces**2, 0.0))
    beside = math.hypot(across[-1], faces[-1] - faces[0])
    end = math.radians(result.tip_angle_deg)
    x, y = result.tip_mm
    moves = np.array([[-1.0, y], [0.0, -x]])
    frame = np.diag(moves @ clamped @ moves.T)
    parts = np.array(
        [
            [tip * math.cos(end), tip * math.sin(end)],
            [beside * math.sin(end), beside * math.cos(end)],
            [0.0, across[0]],
            [scale * x, scale * y],
        ]
    )
    sd_x, sd_y = np.sqrt(np.sum(parts**2, axis=0) + frame)
    return float(sd_x), float(sd_y)


def direction_rad(refined: Refined, root: float, wall: Array, seen_in: View) -> float:
    """Return the deviation of the rod's own direction at its root.

    Parameters
    ----------
    refined : Refined
        The rod in pixels.
    root : float
        Where that is on its curve, px.
    wall : ndarray, shape (n,)
        How wide its side wall is seen, px, positive on the left.
    seen_in : View
        The light it is seen in.
    """
    fit = refined.fit
    before = max(float(fit.curve.s[0]) - root, 0.0)
    odd = refined.whole or is_oddly_bent(fit.curve.kappa, float(refined.width[0]))
    facing = TURN_WALL if is_dark(seen_in) else TURN_PALE_WALL
    return math.hypot(
        SUPPLE * (ODD if odd else 1.0) * sigma_heading(fit, before),
        turned_by_shade(refined),
        TURN_RELIT * fit.lever @ _relit_beside(refined),
        facing * fit.lever @ wall,
        TURN_UNEVEN * _turned_by_width(refined),
    )


def is_oddly_bent(kappa: Array, width: float) -> bool:
    """Whether no single force bends a rod so: both ways, or hardly at its root.

    Parameters
    ----------
    kappa : ndarray, shape (n,)
        Curvature from the root to the tip, per px.
    width : float
        Of the rod, px.
    """
    less, most = sorted((float(kappa.max()), float(-kappa.min())))
    bent, root = BENT / width, abs(float(kappa[0]))
    return less > max(BACK * most, bent) or (most > bent and root < LATE * most)


def turned_by_shade(refined: Refined) -> float:
    """Return how far shade beside the root may turn the rod's own direction, rad."""
    return TURN_SHADE * abs(float(refined.fit.lever @ refined.shaded))


def _relit_beside(refined: Refined) -> Array:
    """Return how far more light that changes beside the clamp may move an edge, px.

    More than it does on the rest of the rod, where it changes on both sides alike.
    """
    rest = refined.relit[_away(refined)]
    usual = quantile(rest, USUAL) if rest.size else 0.0
    return np.maximum(refined.relit - usual, 0.0)


def _turned_by_width(refined: Refined) -> float:
    """Return how much more the width beside the root would turn it than any other, rad.

    Were it all on one side: each part of the rod is laid to the root in turn.
    """
    fit, wider = refined.fit, refined.width - refined.typical_width
    turned = np.abs(np.correlate(wider, fit.lever, "full")[wider.size - 1 :])
    elsewhere = np.max(turned[_away(refined)], initial=0.0)
    return max(float(turned[0] - elsewhere), 0.0)


def _away(refined: Refined) -> NDArray[np.bool_]:
    """Return which points of a rod do not lie beside its clamp."""
    s = refined.fit.curve.s
    return np.asarray(s - s[0] > BESIDE * refined.typical_width)
