"""One frame after the other: the last measurement tells where to look for the next.

A camera that watches a bench takes the rod's next picture before it has gone far. A
filter (`motion`) expects it somewhere and knows how surely; its edges are sought there,
without a look at the rest of the picture. Where they are not found, do not make the
same rod, or lie too far off for what was expected, the whole picture is searched as if
it were the first.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...core.errors import MagbendError
from ..camera.oriented import oriented
from ..curve.curve import Curve
from ..edge.state import BROKEN, LostError, Root
from ..find.candidate import Candidate
from ..find.ground import View, mixed
from ..find.track import Start, resample, start_curve
from ..measurement import Measurement
from ..picture.photo import Photo
from .bare import flattened
from .extract import measure
from .finish import finish
from .motion import begun, expected, moved_on
from .quality import is_as_before
from .setting import Setting

Array = NDArray[np.float64]

REACHES = 1.0, 3.0
"""How far from where it is expected the rod is sought, in its widths."""
CLOSE = 0.11
"""Standard deviation of where it is expected, in its widths, that edges bear."""

MORE_BENT, LITTLE_BENT = 1.2, 0.02
"""Turn of the rod from root to tip, over that in the last frame that was looked at, and
rad on top, for which it is again: joints show by how the rod bends."""

SAME_LENGTH, SAME_WIDTH = 0.04, 0.15
"""By what part a rod may be longer or wider than in the last frame, at most."""


def follow(
    photo: Photo, setting: Setting, last: Measurement | None = None
) -> Measurement:
    """Measure a frame of a film or a live view.

    Parameters
    ----------
    photo : Photo
        The frame, in linear light.
    setting : Setting
        Calibration, and what else is known; the same for all frames.
    last : Measurement, optional
        What the frame before gave. Without it, and where the rod is not found near to
        where it was, the whole picture is searched.

    Returns
    -------
    Measurement
        As of `measure`: failed, with flag and reason, where there is nothing to vouch
        for.

    Examples
    --------
    >>> import numpy as np
    >>> from magbend.vision import Setting, as_photo, follow
    >>> from magbend.vision.synthetic import curve, draw
    >>> found = None
    >>> for bend_deg in (20.0, 24.0):
    ...     frame = draw(
    ...         curve("arc", angle_deg=bend_deg), np.random.default_rng(0),
    ...         clamp_px=(500.0, 600.0), angle_deg=0.0,
    ...     )
    ...     setting = Setting(calibration=frame.truth.calibration)
    ...     found = follow(as_photo(frame.image), setting, found)
    >>> round(found.tip_angle_deg)
    24
    """
    if last is not None and last.ok:
        last = last if last.motion is not None else begun(last)
        try:
            found = _near(photo, setting, last)
        except (LostError, MagbendError):
            found = None  # of another size; a full search says so
        if found is not None:
            return found
    return begun(measure(photo, setting))


def _near(photo: Photo, setting: Setting, last: Measurement) -> Measurement | None:
    """Return the same rod as found where it is expected; None where it is not."""
    if last.motion is None:
        return None
    points, sd = expected(last.motion)
    looked = last.motion.looked
    bent = _turn(points) > MORE_BENT * _turn(looked.points_px) + LITTLE_BENT
    rod = Candidate(
        points_px=points, width_px=last.width_px, length_px=last.length_px,
        root=_root(last), contacts=1, ratio=0.0,
    )  # fmt: skip
    if setting.calibration is not None:
        photo = oriented(photo, setting.calibration)
        setting.calibration.check_size(*photo.size_px)
    if setting.bare is not None:
        photo = flattened(photo, setting.bare, setting.guide_px)
    view = mixed(photo, last.mix, -1.0 if last.inverted else 1.0)
    close = sd < CLOSE * last.width_px and "rough_edges" not in last.flags
    for reach in (0.0, *REACHES) if close else REACHES:
        try:
            start = _start(view, rod, reach) if reach else _expected(rod)
            if start is None:
                continue
            found = finish(
                photo, view, start, rod, setting, sd_px=reach or sd,
                last=None if bent else looked,
            )  # fmt: skip
        except (LostError, *BROKEN):
            continue
        if found.ok and _same(found.length_px, found.width_px, last):
            kept = not bent and is_as_before(found, looked)
            moved = moved_on(last.motion, found, looked if kept else found)
            if moved is not None:
                return moved
    return None


def _expected(rod: Candidate) -> Start:
    """Return a start right where the rod is expected."""
    s, points, theta = resample(rod.points_px, 0.0)
    line = Curve(s=s, points=points, theta=theta, kappa=np.gradient(theta, s[1]))
    return Start(curve=line, width=rod.width_px, rough=False, blur=1.0)


def _turn(points: Array) -> float:
    """Return by how much a polyline turns in all, rad."""
    _, _, theta = resample(points[::4], 0.0)
    return float(np.ptp(theta))


def _start(view: View, rod: Candidate, reach: float) -> Start | None:
    start = start_curve(
        view.grey, rod.points_px, reach * rod.width_px, sign=view.sign,
        follow=rod.root == "clamp",
    )  # fmt: skip
    if start is None or start.rough:
        return None
    width, length = start.width / rod.width_px, start.curve.s[-1] / rod.length_px
    if abs(width - 1.0) > SAME_WIDTH or abs(length - 1.0) > SAME_LENGTH:
        return None
    return replace(start, width=rod.width_px)


def _root(last: Measurement) -> Root:
    if "clamp_at_border" in last.flags:
        return "border"
    return "free" if "no_clamp" in last.flags else "clamp"


def _same(length_px: float, width_px: float, last: Measurement) -> bool:
    length, width = length_px / last.length_px - 1.0, width_px / last.width_px - 1.0
    return abs(length) < SAME_LENGTH and abs(width) < SAME_WIDTH
