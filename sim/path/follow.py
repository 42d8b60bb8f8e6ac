"""The quasi-static path of a rod while something slowly goes and returns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from ...core.checks import finite, listed, shown, whole
from ...core.errors import InputError
from ...core.progress import Progress, silent
from ...core.specimen import Specimen
from ..fields import Field, Support, as_field, check_case, check_plain
from .cases import QUANTITIES, Case
from .records import Path
from .walk import Walk


def follow_path(
    specimen: Specimen,
    field: Field,
    *,
    support: Support | None = None,
    progress: Progress = silent,
    points: int = 61,
    steps: int = 60,
    **waypoints: float | Sequence[float],
) -> Path:
    """Follow a rod while one quantity goes through waypoints.

    Parameters
    ----------
    specimen, field, support
        As of `solve`, in the plane; `field` may wait for its gap.
    progress : callable
        Called as ``progress(done, total)``.
    points : int
        Of every shape.
    steps : int
        Points of the path on each leg between two waypoints.
    **waypoints : sequence of float, or a float
        One of `path.cases.QUANTITIES`, such as ``gap_mm=(120.0, 30.0, 120.0)``; others
        may be given as one number, at which they are kept: ``clamp_angle_deg=5.0``.

    Raises
    ------
    InputError
        If none or several quantities go through waypoints, there are fewer than two,
        one cannot be, or the case is not planar.

    Examples
    --------
    >>> from magbend.sim import Cuboid, follow_path, gmc
    >>> path = follow_path(gmc(2), Cuboid(sides_mm=55.0, remanence_T=1.3),
    ...                    gap_mm=(120.0, 60.0), steps=3)
    >>> [round(point.centreline.tip_mm[1], 2) for point in path.points]
    [1.01, 1.54, 2.46, 4.14]
    """
    support = support or Support()
    field = as_field(field)
    check_case(specimen, field, support)
    check_plain(specimen)
    if not (support.in_plane and field.in_plane):
        raise InputError(
            "gravity_m_s2[2] in m/s2, elevation_deg and z of sources must be 0 for a "
            "path, which is planar; instead received one that is not"
        )
    quantity, stops, kept = _waypoints(waypoints)
    steps = whole(steps, 1, 100_000, "steps")
    start: Case = specimen, field, support
    for name, value in kept.items():
        start = QUANTITIES[name].at(*start, value)

    def case(value: float) -> Case:
        return QUANTITIES[quantity].at(*start, value)

    for stop in stops:
        case(stop)  # refused here by the value that was given, not on the way to it
    walk = Walk(case, points)
    values = [stops[0]]
    for a, b in pairwise(stops):
        values.extend(np.linspace(a, b, steps + 1)[1:].tolist())
    found = [walk.start(values[0])]
    for k, (a, b) in enumerate(pairwise(values), start=1):
        point = walk.go(a, b)
        # Between snaps all work is stored; at a snap nothing moves but the rod.
        step_uJ = point.energy_uJ - found[-1].energy_uJ + walk.lost_uJ
        found.append(replace(point, work_uJ=found[-1].work_uJ + step_uJ))
        progress(k, len(values) - 1)
    return Path(
        quantity=quantity, points=tuple(found), folds=tuple(walk.folds),
        dissipated_uJ=walk.dissipated_uJ,
    )  # fmt: skip


def _waypoints(
    given: dict[str, float | Sequence[float]],
) -> tuple[str, list[float], dict[str, float]]:
    """Return the quantity that changes, its waypoints, and the values of those kept."""
    stops_of = {name: listed(values) for name, values in given.items()}
    changing = [name for name, stops in stops_of.items() if stops is not None]
    if len(changing) != 1 or not set(given) <= set(QUANTITIES):
        raise InputError(
            f"a path must have waypoints of one of {', '.join(QUANTITIES)}; instead "
            f"received {', '.join(given) or 'none'}"
        )
    quantity = changing[0]
    stops = stops_of.pop(quantity) or ()
    unit = QUANTITIES[quantity].unit
    if len(stops) < 2:
        raise InputError(
            f"{quantity} must be at least two waypoints in {unit}; instead received "
            f"{shown(given[quantity])}"
        )
    path = [finite(value, quantity, unit) for value in stops]
    if len(set(path)) == 1:
        raise InputError(
            f"{quantity} must change along a path; all {len(path)} waypoints are "
            f"{path[0]:g} {unit}"
        )
    kept: Any = {name: given[name] for name in stops_of}
    return (
        quantity,
        path,
        {name: finite(kept[name], name, QUANTITIES[name].unit) for name in kept},
    )
