"""Every planar equilibrium of a rod in a uniform field, with its stability.

A rod in a uniform field is a pendulum in arc length (Kirchhoff): marched from the free
tip, where its curvature vanishes, it is known once its tip angle is. Where all sections
are magnetised the same way every equilibrium has its tip angle within one turn below
the direction in which the field pulls, so that a scan of that turn, with the exact
derivative at every point, finds all of them: between two neighbouring zeros of the
derivative the root angle is monotone and meets the clamp at most once.

The Morse index of an equilibrium is the number of zeros of the variational solution
between tip and root (Jacobi's conjugate points): 0 is stable in the plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.errors import InputError, SolverError
from ...core.specimen import Specimen
from ...core.units import T_from_mT
from ..fields import (
    STABLE,
    UNSTABLE,
    Support,
    UniformField,
    as_field,
    check_case,
    check_plain,
)
from ..planar.march import E, H, M
from ..scaling import rod_array, stiffness_Nmm2
from .march import ORDER, march, scan

Array = NDArray[np.float64]

STRAIGHT = 1e-14
"""A pull nearer to the clamp's tangent than this, in rad, counts as along it."""

LOAD_LIMIT = 1e5
"""Largest m B L^2 / EI: beyond it tips differ from the field by less than 1e-137."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Equilibrium:
    """One planar equilibrium.

    Parameters
    ----------
    theta_tip_rad : float
        Tangent angle at the tip from +x, in rad, counted continuously from the clamp.
    tip_mm : tuple of float
        Tip position (x, y), in mm.
    morse_index : int
        Number of directions of the plane in which it is unstable.
    root_moment_Nm : float
        Bending moment at the clamp, counter-clockwise, in N m.
    centreline : Centreline
        The shape.
    """

    theta_tip_rad: float
    tip_mm: tuple[float, float]
    morse_index: int
    root_moment_Nm: float
    centreline: Centreline

    @property
    def status(self) -> str:
        """``stable`` or ``unstable`` (within the plane)."""
        return STABLE if self.morse_index == 0 else UNSTABLE


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarRod:
    """The dimensionless rod that the kernels march, tip first (private to `sim`).

    `moment` is m B per section at the field it was made for, times
    L^2 / `stiffness_Nm2`, positive along `pull_rad`, the direction of the tip's pull
    from the clamp's tangent, within [0, 2 pi).
    """

    lengths: Array
    stiffness: Array
    moment: Array
    pull_rad: float
    clamp_rad: float
    length_mm: float
    stiffness_Nm2: float

    @property
    def size(self) -> float:
        """Integral of sqrt(|c|): how many swings fit into the rod."""
        c = np.abs(self.moment / self.stiffness)
        return float(np.sum(np.sqrt(c) * self.lengths))


def planar_rod(specimen: Specimen, field: UniformField, support: Support) -> PlanarRod:
    """Return the dimensionless rod.

    Raises
    ------
    InputError
        If weight is asked for, the field does not act on the tip section, or the load
        is beyond what can be told apart from an infinite one.
    """
    check_case(specimen, field, support)
    check_plain(specimen)
    if (uniform := as_field(field).uniform) is None:
        raise InputError(
            "field must be a UniformField for the scan of all equilibria; instead "
            f"received {field}"
        )
    refuse_weight(support)
    rows = rod_array(specimen, support)
    moment = rows[:, M] * T_from_mT(uniform.flux_mT)
    turned = np.pi if moment[0] < 0.0 else 0.0
    if turned:
        moment = -moment
    pull = float(np.radians(uniform.angle_deg - support.clamp_angle_deg) + turned)
    pull -= 2.0 * np.pi * np.floor(pull / (2.0 * np.pi))
    if min(pull, 2.0 * np.pi - pull) < STRAIGHT:
        pull = 0.0
    rod = PlanarRod(
        lengths=rows[:, H].copy(), stiffness=1.0 / rows[:, E], moment=moment,
        pull_rad=pull,
        clamp_rad=float(np.radians(support.clamp_angle_deg)),
        length_mm=specimen.length_mm,
        stiffness_Nm2=stiffness_Nmm2(specimen)[0] * 1e-6,
    )  # fmt: skip
    if np.max(np.abs(moment / rod.stiffness)) > LOAD_LIMIT:
        raise InputError(
            f"flux_mT must keep m B L^2 / EI below {LOAD_LIMIT:g}; instead received "
            f"{uniform.flux_mT:g} mT, which makes it "
            f"{np.max(np.abs(moment / rod.stiffness)):.3g}"
        )
    return rod


def refuse_weight(support: Support) -> None:
    """Raise `InputError` if weight is asked for."""
    if any(support.gravity_m_s2):
        raise InputError(
            "gravity_m_s2 must be zero for the scan of all equilibria; instead "
            f"received {support.gravity_m_s2} m/s2: use solve() for shapes with weight"
        )


def uniform_equilibria(rod: PlanarRod, points: int) -> tuple[Equilibrium, ...]:
    """Return all equilibria of a rod in its uniform field, by rising tip angle."""
    found = [
        equilibrium(rod, v, load=1.0, turn=turn, points=points)
        for v, turn in tip_angles(rod)
    ]
    return tuple(sorted(found, key=lambda one: one.theta_tip_rad))


def tip_angles(rod: PlanarRod, load: float = 1.0) -> list[tuple[float, int]]:
    """Return (v, turn) of every equilibrium at `load` times the rod's moment.

    `v` is the scan variable (see `equilibria.march.scan`); `turn` the number of whole
    turns by which the clamp is met, zero unless sections are magnetised oppositely.
    The straight rod along the pull has v = infinity.
    """
    if load == 0.0 or not np.any(rod.moment):
        return [(np.inf, 0)] if rod.pull_rad == 0.0 else [(np.nan, 0)]
    v = _grid(rod, load)
    table = scan_rod(rod, v, load)
    v, table = _with_extrema(rod, v, table, load)
    found = [(np.inf, 0)] if rod.pull_rad == 0.0 else []
    for turn in _turns(rod, table[:, 0]):
        miss = table[:, 0] + rod.pull_rad - 2.0 * np.pi * turn
        for i in np.flatnonzero(miss[:-1] * miss[1:] <= 0.0):
            if miss[i] == 0.0:
                continue  # the interval before owns this point
            found.append((_polish(rod, load, v[i], v[i + 1], turn), turn))
    return found


def equilibrium(
    rod: PlanarRod, v: float, *, load: float, turn: int, points: int = 61
) -> Equilibrium:
    """Return the equilibrium whose scan variable is `v`, with its shape."""
    at = np.linspace(0.0, 1.0, points)
    path = np.zeros((points, 4))
    out = np.zeros(8)
    w_tip, base = _split(v, rod)
    index = march(
        w_tip, load, rod.lengths, rod.stiffness, rod.moment,
        at, path, np.zeros((5, ORDER + 2)), out,
    )  # fmt: skip
    w, k, X, Y = path[::-1].T
    turned = rod.pull_rad + base - 2.0 * np.pi * turn + rod.clamp_rad
    theta = w + turned
    direction = rod.pull_rad + rod.clamp_rad
    cos, sin = np.cos(direction), np.sin(direction)
    X, Y = X[0] - X, Y[0] - Y
    L = rod.length_mm
    shape = Centreline(
        s_mm=(1.0 - at[::-1]) * L,
        x_mm=(cos * X - sin * Y) * L,
        y_mm=(sin * X + cos * Y) * L,
        theta_rad=theta,
        kappa_per_mm=-k / L,
    )
    moment_Nm = -k[0] * rod.stiffness[-1] * rod.stiffness_Nm2 / (L * 1e-3)
    return Equilibrium(
        theta_tip_rad=float(theta[-1]), tip_mm=shape.tip_mm, morse_index=index,
        root_moment_Nm=float(moment_Nm), centreline=shape,
    )  # fmt: skip


def _split(v: float, rod: PlanarRod) -> tuple[float, float]:
    """Tip angle from the nearer end of the scanned turn, and that end."""
    if np.isnan(v):  # no load: straight along the clamp
        return -rod.pull_rad, 0.0
    eps = 2.0 * np.pi / (1.0 + np.exp(2.0 * abs(v))) if abs(v) < 350.0 else 0.0
    return (-eps, 0.0) if v >= 0.0 else (eps, -2.0 * np.pi)


def tip_angle_rad(rod: PlanarRod, v: float, turn: int) -> float:
    """Return the tip's angle from +x that a scan variable stands for."""
    w_tip, base = _split(v, rod)
    return float(w_tip + base + rod.pull_rad - 2.0 * np.pi * turn + rod.clamp_rad)


def _grid(rod: PlanarRod, load: float) -> Array:
    """Scan points: dense enough for every swing, reaching beyond every tip angle."""
    swings = rod.size * load**0.5
    near = min(rod.pull_rad, 2.0 * np.pi - rod.pull_rad) if rod.pull_rad else 1.0
    end = 0.5 * (swings - np.log(min(near, 1.0))) + 8.0
    half = np.linspace(0.0, end, int(60 + 30 * swings + 4 * end))
    return np.concatenate([-half[:0:-1], half])


def scan_rod(rod: PlanarRod, v: Array, load: float) -> Array:
    """Return root angle, derivative by v, by ln(load), and Morse index, (n, 4)."""
    table = np.zeros((len(v), 4))
    scan(v, load, rod.lengths, rod.stiffness, rod.moment, table)
    return table


def _with_extrema(
    rod: PlanarRod, v: Array, table: Array, load: float
) -> tuple[Array, Array]:
    """Insert the zeros of the derivative, so that intervals are monotone."""
    slope = table[:, 1]
    at = np.flatnonzero(slope[:-1] * slope[1:] < 0.0)
    if len(at) == 0:
        return v, table
    low, high = v[at].copy(), v[at + 1].copy()
    sign = np.sign(slope[at])
    for _ in range(60):
        middle = 0.5 * (low + high)
        left = np.sign(scan_rod(rod, middle, load)[:, 1]) == sign
        low = np.where(left, middle, low)
        high = np.where(left, high, middle)
    extra = 0.5 * (low + high)
    merged = np.concatenate([v, extra])
    order = np.argsort(merged, kind="stable")
    rows = np.concatenate([table, scan_rod(rod, extra, load)])
    return merged[order], rows[order]


def _turns(rod: PlanarRod, root: Array) -> range:
    """Whole turns by which the scanned root angles meet the clamp."""
    reached = (root + rod.pull_rad) / (2.0 * np.pi)
    return range(int(np.ceil(reached.min())), int(np.floor(reached.max())) + 1)


def _polish(rod: PlanarRod, load: float, low: float, high: float, turn: int) -> float:
    """Newton guarded by bisection for the root of (root angle - clamp) in v."""
    goal = 2.0 * np.pi * turn - rod.pull_rad
    rising = scan_rod(rod, np.array([high]), load)[0, 0] > goal
    v = 0.5 * (low + high)
    for _ in range(200):
        value, slope = scan_rod(rod, np.array([v]), load)[0, :2]
        miss = value - goal
        if (miss > 0.0) == rising:
            high = v
        else:
            low = v
        newton = v - miss / slope if slope != 0.0 else np.inf
        following = newton if low < newton < high else 0.5 * (low + high)
        if abs(following - v) <= 4e-16 * max(1.0, abs(v)):
            return float(following)
        v = following
    raise SolverError(
        f"the equilibrium near v = {v:.6g} was bracketed but not polished; "
        "please report this rod and field"
    )
