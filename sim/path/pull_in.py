"""Where rods are pulled in: the gap at which an approaching magnet takes them.

As a magnet comes nearer its rod may lose its equilibrium, in a fold or by touching it,
and find no other. Each rod is followed from the largest gap (`follow_path`): what grows
from no load at one gap may be another equilibrium, which ends elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import listed, positive, shown, within
from ...core.cross_section import SIZES
from ...core.errors import InputError
from ...core.progress import Progress, silent
from ...core.specimen import Specimen
from ..fields import Field, Support, as_field, check_case, check_plain, kinds_of
from .follow import follow_path

Array = NDArray[np.float64]

STEPS = 24
"""Points of a path."""
IN_PROPORTION = ("length_mm", "E_MPa")
"""Set for the whole rod and for its root's section, the others in proportion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PullIn:
    """What `pull_in_gaps` found.

    Parameters
    ----------
    names : tuple of str
        The two properties, with their units.
    x, y : ndarray, shapes (n,), (m,)
        Values of the first and of the second.
    gap_mm : ndarray, shape (m, n)
        Gap at which the rod is pulled in as the magnet comes nearer; NaN where it is
        not at any gap of the range that leaves the straight rod clear of the magnet,
        infinite where it is at all of them.
    range_mm : tuple of float
        Smallest and largest gap looked at.
    """

    names: tuple[str, str]
    x: Array
    y: Array
    gap_mm: Array
    range_mm: tuple[float, float]


def pull_in_gaps(
    specimen: Specimen,
    field: Field,
    over: Mapping[str, Sequence[float]],
    *,
    range_mm: tuple[float, float] = (5.0, 200.0),
    progress: Progress = silent,
) -> PullIn:
    """Return the gap at which a rod is pulled in, over two of its properties.

    Parameters
    ----------
    specimen : Specimen
        The rod whose other properties they have; weightless, clamped along +x.
    field : Field, or sources
        In the plane; one of them waits for its gap.
    over : mapping of two names to values
        ``remanence_mT`` and the sizes of its shape (``side_mm``, ...), of all sections;
        ``length_mm``, of the whole rod, and ``E_MPa``, of the section at the root, with
        the other sections in proportion.
    range_mm : tuple of float
        Smallest and largest gap to be looked at.
    progress : callable
        Called as ``progress(done, total)``.

    Raises
    ------
    InputError
        If a name or value cannot be, or no source waits for a gap.

    Examples
    --------
    >>> from magbend.sim import Cuboid, gmc, pull_in_gaps
    >>> found = pull_in_gaps(gmc(2), Cuboid(sides_mm=55.0, remanence_T=1.3),
    ...                      {"remanence_mT": [-100.0], "E_MPa": [5.0, 10.0]})
    >>> found.gap_mm.round(1).tolist()
    [[26.5], [25.8]]
    """
    field = as_field(field)
    check_case(specimen, field, Support())
    check_plain(specimen)
    if not field.follows_gap:
        raise InputError(
            "a source of the field must wait for its gap_mm in mm (neither centre_mm "
            f"nor gap_mm) to come nearer; instead received {kinds_of(field)}"
        )
    low, high = (within(value, 1e-6, 1e6, "range_mm", "mm") for value in range_mm)
    if not low < high:
        raise InputError(
            f"range_mm must rise from the smallest to the largest gap in mm; instead "
            f"received {low:g} to {high:g} mm"
        )
    names, x, y = _properties(specimen, over)
    gap_mm = np.empty((len(y), len(x)))
    for i, k in np.ndindex(gap_mm.shape):
        rod = _with(_with(specimen, names[0], float(x[k])), names[1], float(y[i]))
        gap_mm[i, k] = _pull_in(rod, field, low, high)
        progress(i * len(x) + k + 1, gap_mm.size)
    return PullIn(names=names, x=x, y=y, gap_mm=gap_mm, range_mm=(low, high))


def _pull_in(rod: Specimen, field: Field, low: float, high: float) -> float:
    """Return the gap at which the path from the largest gap has no shape any more."""
    path = follow_path(rod, field, gap_mm=(high, low), steps=STEPS, points=31)
    lost = [k for k, one in enumerate(path.points) if one.centreline is None]
    if not lost:
        return math.nan
    last = path.points[lost[0]].value
    ends = [fold.value for fold in path.folds if fold.value >= last]
    return ends[-1] if lost[0] > 0 else math.inf


def _properties(
    specimen: Specimen, over: Mapping[str, Sequence[float]]
) -> tuple[tuple[str, str], Array, Array]:
    """Return the two names and their values, checked."""
    known = ("remanence_mT", *IN_PROPORTION, *SIZES[specimen.shape])
    if not isinstance(over, Mapping) or len(over) != 2 or not set(over) <= set(known):
        raise InputError(
            f"over must name two of {', '.join(known)}; instead received {shown(over)}"
        )
    columns = []
    for name, given in over.items():
        values = listed(given)
        if not values:
            raise InputError(
                f"{name} must be at least one value; instead received {shown(given)}"
            )
        unit = name.rsplit("_", 1)[1]
        if name == "remanence_mT":
            checked = [within(value, -3e4, 3e4, name, unit) for value in values]
        else:
            checked = [positive(value, name, unit) for value in values]
        if any(b <= a for a, b in pairwise(checked)):
            raise InputError(f"{name} in {unit} must rise; instead received {values}")
        columns.append(np.array(checked))
    first, second = over
    return (first, second), columns[0], columns[1]


def _with(rod: Specimen, name: str, value: float) -> Specimen:
    """Return the rod with another value of a property (`pull_in_gaps`)."""
    if name in IN_PROPORTION:
        whole = rod.length_mm if name == "length_mm" else rod.sections[0].E_MPa
        sections = tuple(
            replace(one, **{name: getattr(one, name) * value / whole})
            for one in rod.sections
        )
        return replace(rod, sections=sections)
    own: dict[str, Any] = {name: None}
    common: dict[str, Any] = {name: value}
    sections = tuple(replace(one, **own) for one in rod.sections)
    return replace(rod, sections=sections, **common)
