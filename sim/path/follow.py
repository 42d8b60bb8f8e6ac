"""The quasi-static path of a rod while something slowly goes and returns.

From the equilibrium that `solve` finds at the first value each next one is reached by
Newton from the one before, in steps that are halved where Newton would have to jump.
Where no smaller step helps the equilibrium has met another and both are gone: a fold.
There the rod snaps: to the equilibrium that grows from no load, to the nearest stable
one of a uniform field (all are known), or into the magnet. What it loses in energy is
dissipated, and the way back need not be the way there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.checks import finite, listed, shown, whole
from ...core.errors import InputError, SolverError
from ...core.progress import Progress, silent
from ...core.specimen import Specimen
from ...core.units import rad_from_deg
from ..equilibria.find import find_equilibria
from ..fields import (
    PULLED_IN,
    STABLE,
    UNSTABLE,
    Field,
    Support,
    as_field,
    check_case,
    check_plain,
    refuse_outside,
)
from ..planar.near import LOST, TOUCHING, settle
from ..planar.outcomes import GONE, OK_UNSTABLE, TOUCHES
from ..planar.solver import ORDER, STEP, failure, solve_planar
from ..scaling import field_array, rod_array, stations
from .cases import QUANTITIES, Case
from .energy import energy_uJ

Array = NDArray[np.float64]

MIN_STEP = 1e-7
"""Of a leg of the path: a fold is found to within it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PathPoint:
    """One point of a path.

    Parameters
    ----------
    value : float
        Of what changes.
    status : str
        ``stable``, ``unstable`` or ``pulled in: no equilibrium``.
    centreline : Centreline or None
        The shape; None where there is no equilibrium.
    morse_index : int
        Unstable directions in the plane; -1 where there is no equilibrium.
    energy_uJ : float
        Elastic, magnetic and of the weight, in microjoules; NaN without a shape.
    work_uJ : float
        What it took to come here from the first point, done on the rod by what changes
        (the hand that moves the magnet, the field that turns); NaN from where the rod
        had no shape.
    snapped : bool
        Whether the rod has jumped here from the point before.
    """

    value: float
    status: str
    centreline: Centreline | None
    morse_index: int
    energy_uJ: float
    work_uJ: float = 0.0
    snapped: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PathFold:
    """A place where the followed equilibrium ends.

    Parameters
    ----------
    value : float
        Of what changes.
    direction : str
        ``rising`` or ``falling``: how it changed there.
    kind : str
        ``fold``; ``contact``, where the rod meets a magnet; or ``index``, where the
        equilibrium goes on but loses or gains a stable direction.
    tip_mm : tuple of float
        The tip just before.
    turning : tuple of float
        The singular direction: dx, dy of the tip, of unit length, in which the
        equilibrium gives way.
    """

    value: float
    direction: str
    kind: str
    tip_mm: tuple[float, float]
    turning: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Path:
    """What `follow_path` found.

    Parameters
    ----------
    quantity : str
        What changes, with its unit.
    points : tuple of PathPoint
    folds : tuple of PathFold
    dissipated_uJ : float
        What the rod loses in all its snaps from shape to shape, in microjoules.
    """

    quantity: str
    points: tuple[PathPoint, ...]
    folds: tuple[PathFold, ...]
    dissipated_uJ: float


def follow_path(
    specimen: Specimen,
    field: Field,
    *,
    support: Support | None = None,
    progress: Progress = silent,
    points: int = 61,
    steps: int = 60,
    **waypoints: Sequence[float],
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
    **waypoints : sequence of float
        One of `path.cases.QUANTITIES`, such as ``gap_mm=(120.0, 30.0, 120.0)``.

    Raises
    ------
    InputError
        If none or several quantities are named, there are fewer than two waypoints, or
        the case is not planar.

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
    quantity, stops = _waypoints(waypoints)
    steps = whole(steps, 1, 100_000, "steps")

    def case(value: float) -> Case:
        return QUANTITIES[quantity].at(specimen, field, support, value)

    walk = _Walk(case, points)
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


def _waypoints(given: dict[str, Sequence[float]]) -> tuple[str, list[float]]:
    if len(given) != 1 or not set(given) <= set(QUANTITIES):
        raise InputError(
            f"a path must have waypoints of one of {', '.join(QUANTITIES)}; instead "
            f"received {', '.join(given) or 'none'}"
        )
    quantity, values = next(iter(given.items()))
    stops = listed(values)
    if stops is None or len(stops) < 2:
        raise InputError(
            f"{quantity} must be at least two waypoints in "
            f"{QUANTITIES[quantity].unit}; instead received {shown(values)}"
        )
    unit = QUANTITIES[quantity].unit
    return quantity, [finite(value, quantity, unit) for value in stops]


class _Walk:
    """The rod on its way: where it is now, and the folds behind it."""

    def __init__(self, case: Callable[[float], Case], points: int) -> None:
        self.case = case
        self.s = stations(points)
        self.folds: list[PathFold] = []
        self.dissipated_uJ = 0.0
        self.lost_uJ = 0.0  # in the last step; NaN if there was no shape to lose to
        self.u: Array | None = None
        self.behind: tuple[float, Array] | None = None  # where it was just before
        self.index = 0
        self.is_begun = False

    def start(self, value: float, *, snapped: bool = False) -> PathPoint:
        """Return the equilibrium that grows from no load, or that there is none."""
        arrays = self._arrays(value)
        outcome, self.index, *_, u = solve_planar(*arrays, stations(61), ORDER, STEP)
        self.u = u if outcome <= OK_UNSTABLE else None
        if self.u is not None:
            return self._point(value, snapped=snapped)
        if outcome != GONE and not (self.is_begun and outcome == TOUCHES):
            specimen, field, _ = self.case(value)
            raise failure(outcome, specimen, field, 0.0)
        return PathPoint(
            value=value, status=PULLED_IN, centreline=None, morse_index=-1,
            energy_uJ=math.nan, snapped=snapped,
        )  # fmt: skip

    def go(self, a: float, b: float) -> PathPoint:
        """Return the point at `b`, after that at `a`."""
        self.is_begun = True
        self.lost_uJ = 0.0
        if self.u is None:
            return self.start(b)
        at, jump, before = a, b - a, self.u
        while at != b:
            ahead = b if abs(b - at) <= abs(jump) else at + jump
            index, u, _ = self._settle(ahead, self.s[[0, -1]], self._guess(at, ahead))
            if index == self.index:
                before, self.behind = self.u, (at, self.u)
                self.u, at = u, ahead
                jump *= 2.0
                continue
            jump *= 0.5
            if abs(jump) > MIN_STEP * abs(b - a):
                continue
            if index < 0:
                kind = "contact" if index == TOUCHING else "fold"
                return self._snap(at, b, kind, before)
            # Too short for a jump: it is this equilibrium whose index changes.
            self._note(at, b, "index", before)
            self.index, self.u, at, jump = index, u, ahead, b - a
        return self._point(b)

    def _guess(self, at: float, ahead: float) -> Array:
        """Return where Newton begins: straight on, but no farther than twice as far.

        A rod many boundary layers long lets Newton converge from next to nothing away;
        from where the rod was, its steps would be as small as that.
        """
        u = np.array(self.u)
        if self.behind is not None:
            value, before = self.behind
            if at != value and abs(ratio := (ahead - at) / (at - value)) <= 2.0:
                u += ratio * (u - before)
        return u

    def _arrays(self, value: float) -> tuple[Array, Array, float, float]:
        specimen, field, support = self.case(value)
        L = specimen.length_mm
        clamp = rad_from_deg(support.clamp_angle_deg)
        margin = 0.5 * max(specimen.sides_mm) / L
        return rod_array(specimen, support), field_array(field, L), clamp, margin

    def _settle(
        self, value: float, s: Array, guess: Array | None = None
    ) -> tuple[int, Array, Array]:
        """Return index (below 0: none), unknowns and shape next to where the rod is."""
        u = np.array(self.u if guess is None else guess)
        out = np.empty((4, len(s)))
        index = settle(
            *self._arrays(value), np.ascontiguousarray(s), ORDER, STEP, u, out
        )
        return int(index), u, out

    def _point(self, value: float, *, snapped: bool = False) -> PathPoint:
        specimen, field, support = self.case(value)
        index, _, out = self._settle(value, self.s)
        if index == LOST:
            raise SolverError(
                f"the path was lost at {value:.6g}: Newton's method does not find its "
                "shape again there; try more steps, or solve each place alone"
            )
        refuse_outside(field, out[0], out[1], specimen.length_mm)
        line = self._line(out, specimen)
        return PathPoint(
            value=value, status=STABLE if self.index == 0 else UNSTABLE,
            centreline=line, morse_index=self.index, snapped=snapped,
            energy_uJ=energy_uJ(specimen, field, support, line),
        )  # fmt: skip

    def _snap(self, at: float, b: float, kind: str, before: Array) -> PathPoint:
        """Return where the rod is at `b` after its equilibrium has ended at `at`."""
        last = self._note(at, b, kind, before)
        self.behind = None
        point = self.start(b, snapped=True)
        other = self._nearest_uniform(b, last)
        if other is not None:
            self.u, self.index = other, 0
            point = self._point(b, snapped=True)
        if point.centreline is not None:
            self.lost_uJ = last.energy_uJ - self._energy_uJ(at, point)
            self.dissipated_uJ += max(0.0, self.lost_uJ)
        return point

    def _energy_uJ(self, at: float, point: PathPoint) -> float:
        """Return the energy of the new shape where the old one ended, just before."""
        index, _, out = self._settle(at, self.s)
        if index != self.index:
            return point.energy_uJ
        specimen, field, support = self.case(at)
        return energy_uJ(specimen, field, support, self._line(out, specimen))

    def _line(self, out: Array, specimen: Specimen) -> Centreline:
        x, y, theta, kappa = out
        L = specimen.length_mm
        return Centreline._trusted(self.s * L, x * L, y * L, theta, kappa / L)

    def _nearest_uniform(self, value: float, last: PathPoint) -> Array | None:
        """Return the unknowns of the nearest stable equilibrium of a uniform field."""
        specimen, field, support = self.case(value)
        uniform = field.uniform
        if uniform is None or any(support.gravity_m_s2) or last.centreline is None:
            return None
        tip, L = last.centreline.tip_mm, specimen.length_mm
        found = find_equilibria(specimen, uniform, support=support)
        stable = [one for one in found if one.morse_index == 0]
        if not stable:
            return None
        best = min(stable, key=lambda one: math.dist(one.tip_mm, tip))
        return np.array(
            [best.theta_tip_rad, best.tip_mm[0] / L, best.tip_mm[1] / L, 0.0]
        )

    def _note(self, at: float, b: float, kind: str, before: Array) -> PathPoint:
        """Keep a fold: the tip moved from `before` to here as the step came to it."""
        point = self._point(at)
        u = np.array(self.u)
        turn = u[1:3] - before[1:3]
        turn /= max(float(np.hypot(*turn)), 1e-300)
        tip_mm = point.centreline.tip_mm if point.centreline else (math.nan, math.nan)
        self.folds.append(
            PathFold(
                value=at, direction="rising" if b > at else "falling", kind=kind,
                tip_mm=tip_mm, turning=(float(turn[0]), float(turn[1])),
            )
        )  # fmt: skip
        return point
