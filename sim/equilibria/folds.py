"""Branches of equilibria over the load, by arc length, and the folds of pairs.

The unknowns are the scan variable v of the tip angle and the logarithm of the load; the
march gives the root angle with its exact derivatives by both, so that each step is a
tangent predictor and Newton's corrector across it (Keller, 1977). Every equilibrium at
the full load is followed towards no load, or round a fold and back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.errors import SolverError
from ...core.specimen import Specimen
from ..fields import Support, UniformField
from .uniform import PlanarRod, planar_rod, scan_rod, tip_angle_rad, tip_angles

Array = NDArray[np.float64]

STEP = 0.02
LONGEST = 0.1
LOWEST = 1e-3
"""Fraction of the load at which a branch that reaches it counts as followed to zero."""
TURN = 0.15
"""Largest turn of the tangent in one step, in rad."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fold:
    """A load at which a pair of equilibria begins (or, in graded rods, ends).

    Parameters
    ----------
    flux_mT : float
        Flux density.
    theta_tip_rad : float
        Tip angle of the equilibrium in which the pair meets.
    kind : str
        ``fold``; or ``pitchfork``, where the pair leaves a rod that stays straight
        (field exactly along it).
    """

    flux_mT: float
    theta_tip_rad: float
    kind: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Branch:
    """A connected curve of equilibria.

    Parameters
    ----------
    flux_mT, theta_tip_rad : ndarray, shape (n,)
        Flux density and tip angle along the curve.
    morse_index : ndarray of int, shape (n,)
        Unstable directions in the plane.
    folds : tuple of Fold
        On the curve, in its order.
    """

    flux_mT: Array
    theta_tip_rad: Array
    morse_index: NDArray[np.int64]
    folds: tuple[Fold, ...]


def find_folds(
    specimen: Specimen, field: UniformField, *, support: Support | None = None
) -> tuple[Fold, ...]:
    """Return the folds between no load and `field`, by rising flux density.

    Parameters
    ----------
    specimen, field, support
        As of `find_equilibria`; the direction of the field stays.

    Raises
    ------
    InputError
        As `find_equilibria`.
    SolverError
        If a branch could not be followed.
    """
    branches = trace_branches(specimen, field, support=support)
    folds = [fold for branch in branches for fold in branch.folds]
    return tuple(sorted(folds, key=lambda fold: abs(fold.flux_mT)))


def trace_branches(
    specimen: Specimen, field: UniformField, *, support: Support | None = None
) -> tuple[Branch, ...]:
    """Return the curves of equilibria from no load (a thousandth) to `field`.

    Parameters
    ----------
    specimen, field, support
        As of `find_equilibria`; the direction of the field stays.

    Returns
    -------
    tuple of Branch
        The curve that starts from the unloaded rod is among them.

    Raises
    ------
    InputError
        As `find_equilibria`.
    SolverError
        If a branch could not be followed.
    """
    rod = planar_rod(specimen, field, support or Support())
    ends = [end for end in tip_angles(rod) if np.isfinite(end[0])]
    branches: list[Branch] = []
    while ends:
        v, turn = ends.pop(0)
        path, folds = _trace(rod, v, turn)
        if path[-1, 1] == 0.0:  # came back to the full load: that end is done
            reached = path[-1, 0]
            ends = [e for e in ends if e[1] != turn or abs(e[0] - reached) > 1e-6]
        branches.append(_branch(rod, path, folds, turn, field.flux_mT))
    return tuple(branches)


def _branch(
    rod: PlanarRod, path: Array, folds: list[tuple[float, float, str]], turn: int,
    full_mT: float,
) -> Branch:  # fmt: skip
    return Branch(
        flux_mT=np.exp(path[:, 1]) * full_mT,
        theta_tip_rad=np.array([tip_angle_rad(rod, v, turn) for v in path[:, 0]]),
        morse_index=path[:, 2].astype(np.int64),
        folds=tuple(
            Fold(
                flux_mT=float(np.exp(mu)) * full_mT,
                theta_tip_rad=float(tip_angle_rad(rod, v, turn)),
                kind=kind,
            )
            for v, mu, kind in folds
        ),
    )


def _at(rod: PlanarRod, v: float, mu: float) -> Array:
    row: Array = scan_rod(rod, np.array([v]), float(np.exp(mu)))[0]
    return row


def _trace(
    rod: PlanarRod, v: float, turn: int
) -> tuple[Array, list[tuple[float, float, str]]]:
    """Follow one branch from mu = 0; return (v, mu, index) rows and folds."""
    goal = 2.0 * np.pi * turn - rod.pull_rad
    here = np.array([v, 0.0])
    row = _at(rod, *here)
    path = [(v, 0.0, row[3])]
    folds: list[tuple[float, float, str]] = []
    tangent = _tangent(row, np.array([0.0, -1.0]), 0.0)
    # Along one curve the gradient of the root angle stays on one side. Close to a
    # pitchfork, where curves nearly cross, a step onto another one shows by it.
    side = 0.0 if _symmetric(rod) else float(np.sign(tangent @ (-row[2], row[1])))
    step = STEP
    for _ in range(20000):
        moved = _correct(rod, goal, here + step * tangent, tangent)
        turned = None if moved is None else _tangent(moved[1], tangent, side)
        if moved is None or turned is None or turned @ tangent < np.cos(TURN):
            step *= 0.5
            if step < 1e-9:
                break
            continue
        following, row = moved
        if following[1] >= 0.0:
            path.append((*_land(rod, goal, here, following), row[3]))
            return np.array(path), folds
        if turned[1] * tangent[1] < 0.0:
            folds.append(_fold(rod, goal, 0.5 * (here + following)))
        here, tangent = following, turned
        path.append((here[0], here[1], row[3]))
        if here[1] < np.log(LOWEST):
            return np.array(path), folds
        step = min(LONGEST, 1.4 * step)
    raise SolverError(
        f"a branch of equilibria could not be followed beyond "
        f"{np.exp(here[1]):.6g} of the load; please report this rod and field"
    )


def _symmetric(rod: PlanarRod) -> bool:
    """Tell whether the field is exactly along the rod, so that curves do cross."""
    return bool(rod.pull_rad == 0.0 or abs(rod.pull_rad - np.pi) < 1e-12)


def _tangent(row: Array, before: Array, side: float) -> Array:
    """Return the unit vector along the curve, continuing `before`.

    `side` is the factor of the gradient's perpendicular, or 0 for either.
    """
    tangent = np.array([-row[2], row[1]])
    size = float(np.hypot(*tangent))
    if size == 0.0:
        return before
    tangent /= size
    if side == 0.0:
        side = 1.0 if tangent @ before >= 0.0 else -1.0
    return side * tangent


def _correct(
    rod: PlanarRod, goal: float, guess: Array, tangent: Array
) -> tuple[Array, Array] | None:
    """Newton's method across the curve; None if it does not converge at once."""
    point = guess.copy()
    for _ in range(8):
        row = _at(rod, *point)
        miss = row[0] - goal
        across = np.array([row[1], row[2]])
        det = across[0] * tangent[1] - across[1] * tangent[0]
        if det == 0.0:
            return None
        change = -miss / det * np.array([tangent[1], -tangent[0]])
        if not np.all(np.abs(change) < LONGEST):
            return None
        point += change
        if np.max(np.abs(change)) < 1e-12:
            return point, _at(rod, *point)
    return None


def _land(
    rod: PlanarRod, goal: float, here: Array, following: Array
) -> tuple[float, float]:
    """Return the point at the full load between two points of the curve."""
    share = -here[1] / (following[1] - here[1])
    v = float(here[0] + share * (following[0] - here[0]))
    for _ in range(30):
        row = _at(rod, v, 0.0)
        change = -(row[0] - goal) / row[1]
        v += float(change)
        if abs(change) < 1e-14 * max(1.0, abs(v)):
            break
    return v, 0.0


def _fold(rod: PlanarRod, goal: float, guess: Array) -> tuple[float, float, str]:
    """Polish a fold: root angle at the clamp, and no derivative by the tip angle."""
    point, h = guess.copy(), 1e-4
    straight = _symmetric(rod)
    for _ in range(40):
        v, mu = point
        row = _at(rod, v, mu)
        bend = (_at(rod, v + h, mu)[1] - _at(rod, v - h, mu)[1]) / (2.0 * h)
        push = (_at(rod, v, mu + h)[1] - _at(rod, v, mu - h)[1]) / (2.0 * h)
        if straight:  # by symmetry at v = 0, where the other equation is empty
            change = np.array([-v, -row[1] / push])
        else:
            matrix = np.array([[row[1], row[2]], [bend, push]])
            change = np.linalg.solve(matrix, [goal - row[0], -row[1]])
        point = point + change
        if np.max(np.abs(change)) < 1e-13:
            break
    return float(point[0]), float(point[1]), "pitchfork" if straight else "fold"
