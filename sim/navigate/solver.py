"""`navigate`: a rod pushed through a lumen, forth and back."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...core.checks import finite, listed, shown, size, whole, within
from ...core.errors import InputError, SolverError
from ...core.specimen import Specimen
from ..fields import Support, check_case
from ..tube.tube import Tube
from .branch import branches_of
from .case import Case, FieldOfWay
from .in_plane import PlanarWalk
from .in_tube import SpatialPassage, TubeWalk, tube_case
from .lumen import Lumen
from .mesh import ELEMENTS, sections_of
from .passage import Passage

NO_SUPPORT = Support()
MOST_STEPS = 20_000
"""Steps over the length of the rod."""
DEEP = 3.0
"""Sides of the rod behind a wall beyond which a point has come round the wall's end."""


def navigate(
    specimen: Specimen,
    lumen: Lumen | Tube,
    field: FieldOfWay,
    *,
    way_mm: float | Sequence[float] | None = None,
    step_mm: float = 0.5,
    friction: float = 0.0,
    support: Support = NO_SUPPORT,
    push_limit_N: float = math.inf,
    elements: int = ELEMENTS,
    tip: tuple[float, float, float] | None = None,
    refine: bool = True,
    branches: bool = False,
) -> Passage:
    """Push a rod through a lumen.

    Parameters
    ----------
    specimen : Specimen
        The rod; the largest of its sides is its thickness everywhere.
    lumen : Lumen or Tube
        Walls, entry, and whether the rod is fed or pushed; or a tube in space, into
        which it is fed. The frame is the specimen's: a magnet's gap counts from the
        point (length of the rod, 0).
    field : UniformField, MagnetField or callable
        What bends the rod; or a function of the insertion in mm that returns it.
    way_mm : float or sequence of float, optional
        Insertions to go to, one after the other, in mm: (30, 5) is forth and back. The
        whole rod, if not given.
    step_mm : float
        Step of the insertion, in mm, up to the rod's length; where the rod snaps it is
        refined by itself.
    friction : float
        Coefficient of Coulomb friction along the wall; it acts on the rod's axis.
    support : Support
        Weight, in a planar lumen within the plane; and a factor on the magnetic load.
    push_limit_N : float
        Push force at which one gives up, in N.
    elements : int
        Elements of the whole rod.
    tip : tuple of float, optional
        x and y in mm and angle in degrees of a tip that is held: a rod clamped at both
        ends, fed in from one.
    refine : bool
        Whether to solve the last step again on elements of half the size, for the
        error; with friction the whole way.
    branches : bool
        Whether to follow the branches that the rod leaves in snaps, by arc length
        through folds and unstable states; in a planar lumen, without friction.

    Returns
    -------
    Passage
        Every step, what happened on the way, and how it ended; of a tube a
        `SpatialPassage`.

    Raises
    ------
    InputError
        If a value cannot be, the lumen is narrower than the rod, or the entry is not
        within it.
    SolverError
        If not even the first step has an equilibrium that could be found.

    Examples
    --------
    >>> from magbend.sim import UniformField, gmc
    >>> from magbend.sim.navigate import channel, navigate
    >>> bend = channel("bend", width_mm=3.0, legs=[(10.0, 0.0), (20.0, 45.0)])
    >>> passage = navigate(gmc(2), bend, UniformField(flux_mT=0.0))
    >>> passage.outcome
    'inserted'
    """
    check_case(specimen, field(0.0) if callable(field) else field, support)
    _check_clamp(support)
    friction = within(friction, 0.0, 2.0, "friction", "")
    elements = whole(elements, 2, 400, "elements")
    limit_N = _limit(push_limit_N)
    step_mm = within(
        size(step_mm, "step_mm", "mm"), specimen.length_mm / MOST_STEPS,
        specimen.length_mm, "step_mm", "mm",
    )  # fmt: skip
    if branches:
        _check_branches(lumen, friction)
    walk: PlanarWalk | TubeWalk
    if isinstance(lumen, Tube):
        _check_tip(lumen, tip)
        made = tube_case(specimen, lumen, field, support, friction, elements)
        walk = TubeWalk(made, step_mm, limit_N)
    else:
        walk = planar_walk(
            specimen, lumen, field, step_mm=step_mm, friction=friction,
            support=support, limit_N=limit_N, elements=elements, tip=tip,
        )  # fmt: skip
    for target_mm in _way(way_mm, specimen.length_mm):
        if not walk.go_to(target_mm):
            break
    if not walk.steps:
        raise SolverError(
            f"the first {step_mm:g} mm of {specimen.name!r} in lumen {lumen.name!r} "
            f"have no equilibrium ({walk.outcome}); try another entry or a weaker field"
        )
    record = SpatialPassage if isinstance(lumen, Tube) else Passage
    return record(
        lumen=lumen.name,
        specimen=specimen.name,
        outcome=walk.outcome,
        steps=tuple(walk.steps),  # type: ignore[arg-type]
        events=tuple(walk.events),
        error_mm=walk.error_mm() if refine else math.nan,
        branches=branches_of(walk) if branches and isinstance(walk, PlanarWalk) else (),
    )


def planar_walk(
    specimen: Specimen,
    lumen: Lumen,
    field: FieldOfWay,
    *,
    step_mm: float,
    friction: float,
    support: Support = NO_SUPPORT,
    limit_N: float = math.inf,
    elements: int = ELEMENTS,
    tip: tuple[float, float, float] | None = None,
) -> PlanarWalk:
    """Return a rod before its way through a planar lumen; parameters as of `navigate`.

    Raises
    ------
    InputError
        If it cannot enter, or would be lifted out of the plane.
    """
    _check_plane(lumen, support)
    lumen.check_rod(max(specimen.sides_mm))
    case = Case(
        specimen=specimen,
        lumen=lumen,
        field=field,
        sections=sections_of(specimen, support),
        walls=lumen.packed(specimen.length_mm, DEEP * max(specimen.sides_mm)),
        pieces=lumen.pieces,
        friction=friction,
        elements=elements,
        tip=tip,
    )
    return PlanarWalk(case, step_mm, limit_N)


def _way(way_mm: object, longest_mm: float) -> tuple[float, ...]:
    """Return the insertions to go to."""
    given = (longest_mm,) if way_mm is None else listed(way_mm) or (way_mm,)
    least = 1e-3 * longest_mm
    return tuple(within(w, least, longest_mm, "way_mm", "mm") for w in given)  # type: ignore[arg-type]


def _limit(push_limit_N: float) -> float:
    if push_limit_N == math.inf:
        return push_limit_N
    return size(finite(push_limit_N, "push_limit_N", "N"), "push_limit_N", "N")


def _check_branches(lumen: Lumen | Tube, friction: float) -> None:
    """Refuse to follow branches where there are none that one could."""
    if friction != 0.0:
        raise InputError(
            f"friction must be 0 to follow branches; instead received {friction:g}: "
            "with it a state depends on the way to it"
        )
    if isinstance(lumen, Tube):
        raise InputError(
            "branches are followed in planar lumens; instead received tube "
            f"{lumen.name!r}: leave them out"
        )


def _check_tip(tube: Tube, tip: object) -> None:
    """Refuse a held tip, which only a planar lumen has."""
    if tip is not None:
        raise InputError(
            f"tip must be None in tube {tube.name!r}: only planar lumens hold a tip; "
            f"instead received {shown(tip)}"
        )


def _check_plane(lumen: object, support: Support) -> None:
    """Refuse what is no lumen, or weight that would lift the rod out of its plane."""
    if not isinstance(lumen, Lumen):
        raise InputError(
            "lumen must be a Lumen, as channel(...) is, or a Tube; instead received "
            f"{shown(lumen)}"
        )
    if not support.in_plane:
        raise InputError(
            "gravity_m_s2 must be within the plane of the lumen, z 0; instead received "
            f"{support.gravity_m_s2[2]:g} m/s2: a floor would carry it"
        )


def _check_clamp(support: Support) -> None:
    if support.clamp_angle_deg != 0.0:
        raise InputError(
            "clamp_angle_deg must be 0 in a lumen, whose entry tells the direction; "
            f"instead received {support.clamp_angle_deg:g} deg"
        )
