"""How a rod is followed from point to point of its path.

From the equilibrium that `solve` finds at the first value each next one is reached by
Newton from the one before, in steps that are halved where Newton would have to jump.
Where no smaller step helps the equilibrium has met another and both are gone: a fold.
There the rod snaps: to the equilibrium that grows from no load, to the nearest stable
one of a uniform field (all are known), or into the magnet. What it loses in energy is
dissipated, and the way back need not be the way there. Where mirrored shapes leave a
straight rod, it is the straight one that is followed.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.errors import SolverError
from ...core.specimen import Specimen
from ...core.units import rad_from_deg
from ..ending import STRAIGHT, buckled_tips
from ..equilibria.find import find_equilibria
from ..fields import PULLED_IN, STABLE, UNSTABLE, refuse_outside
from ..planar.follow import straight
from ..planar.near import LOST, TOUCHING, settle
from ..planar.outcomes import GONE, OK_UNSTABLE, TOUCHES
from ..planar.solver import ORDER, STEP, failure, solve_planar
from ..probe import flux_mT
from ..scaling import field_array, rod_array, stations
from .cases import Case
from .energy import energy_uJ
from .records import PathFold, PathPoint

Array = NDArray[np.float64]

MIN_STEP = 1e-7
"""Of a leg of the path: a fold is found to within it."""
ALONG = 1e-9
"""Part of a field across a straight rod that is rounding."""


class Walk:
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
        self.is_straight = False

    def start(self, value: float, *, snapped: bool = False) -> PathPoint:
        """Return the equilibrium that grows from no load, or that there is none."""
        arrays = self._arrays(value)
        outcome, self.index, *_, table, u = solve_planar(
            *arrays, stations(61), ORDER, STEP
        )
        self.u = u if outcome <= OK_UNSTABLE else None
        if self.u is not None:
            self.is_straight = bool(np.all(np.abs(table[3]) < STRAIGHT))
            return self._point(value, snapped=snapped)
        specimen, field, _ = self.case(value)
        if outcome != GONE and not (self.is_begun and outcome == TOUCHES):
            raise failure(outcome, specimen, field, 0.0)
        return PathPoint(
            value=value, status=PULLED_IN, centreline=None, morse_index=-1,
            energy_uJ=math.nan, snapped=snapped, field=field,
            length_mm=specimen.length_mm,
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
                self.is_straight = self.is_straight and self._may_be_straight(ahead)
                jump *= 2.0
                continue
            jump *= 0.5
            if abs(jump) > MIN_STEP * abs(b - a):
                continue
            if self.is_straight and index == LOST and self._may_be_straight(ahead):
                ahead, index, u = self._beyond(at, b)
            if index < 0:
                kind = "contact" if index == TOUCHING else "fold"
                return self._snap(at, b, kind, before)
            # Too short for a jump: it is this equilibrium whose index changes.
            if self.is_straight:
                self._note_bifurcation(at, b, a if index < self.index else b)
            else:
                self._note(at, b, "index", before)
            self.index, self.u, at, jump = index, u, ahead, b - a
        return self._point(b)

    def _guess(self, at: float, ahead: float) -> Array:
        """Return where Newton begins: straight on, but no farther than twice as far.

        A rod many boundary layers long lets Newton converge from next to nothing away;
        from where the rod was, its steps would be as small as that.
        """
        u = np.array(self.u)
        if self.is_straight:
            # As near a bifurcation as one likes: what it is must not hang on rounding.
            straight(self._arrays(ahead)[2], u)
        elif self.behind is not None:
            value, before = self.behind
            if at != value and abs(ratio := (ahead - at) / (at - value)) <= 2.0:
                u += ratio * (u - before)
        return u

    def _may_be_straight(self, value: float) -> bool:
        """Tell whether nothing bends the straight rod: no field, no weight across it.

        The field acts at joints and tip alone (the pole reduction).
        """
        specimen, field, support = self.case(value)
        clamp = rad_from_deg(support.clamp_angle_deg)
        along, across = (
            (math.cos(clamp), math.sin(clamp)),
            (-math.sin(clamp), math.cos(clamp)),
        )
        ends = np.array([*specimen.joints_mm, specimen.length_mm])
        places = np.column_stack([*np.outer(along, ends), 0.0 * ends])
        flux = flux_mT(field, places, length_mm=specimen.length_mm)[:, :2]
        pull = np.vstack([flux, support.gravity_m_s2[:2]])
        return bool(
            np.all(np.abs(pull @ across) <= ALONG * np.linalg.norm(pull, axis=1))
        )

    def _beyond(self, at: float, b: float) -> tuple[float, int, Array]:
        """Return where the straight rod is found again past a bifurcation."""
        for part in (1e-5, 1e-4, 1e-3, 1e-2):
            ahead = at + part * (b - at)
            index, u, _ = self._settle(ahead, self.s[[0, -1]], self._guess(at, ahead))
            if index >= 0:
                break
        return ahead, index, u

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
            energy_uJ=energy_uJ(specimen, field, support, line), field=field,
            length_mm=specimen.length_mm,
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
                value=at, direction=_direction(at, b), kind=kind,
                tip_mm=tip_mm, turning=(float(turn[0]), float(turn[1])),
            )
        )  # fmt: skip
        return point

    def _note_bifurcation(self, at: float, b: float, unstable: float) -> None:
        """Keep a bifurcation of the straight rod, with the shapes it buckles to.

        They are looked for at `unstable`, a value at which there are some.
        """
        case = self._arrays(unstable)
        L = self.case(unstable)[0].length_mm
        _, _, clamp, _ = self._arrays(at)
        x, y = math.cos(clamp), math.sin(clamp)
        here = self.case(at)[0].length_mm
        self.folds.append(
            PathFold(
                value=at, direction=_direction(at, b), kind="bifurcation",
                tip_mm=(x * here, y * here), turning=(-y, x),
                branches_mm=buckled_tips(case, L),
            )
        )  # fmt: skip


def _direction(at: float, b: float) -> str:
    return "rising" if b > at else "falling"
