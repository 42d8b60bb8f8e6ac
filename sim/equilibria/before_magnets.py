"""Every planar equilibrium of a rod before magnets, or in any other planar field.

Where all of a rod is magnetised alike, the load on it is the dead load m B of the place
of its tip, and nothing else (the pole reduction). Its equilibria are therefore those
tips r that a uniform field of the flux B(r) would hold there; and of a uniform field
all equilibria are known (`equilibria.find`). So the disc that a tip can reach is
scanned: at each place of a grid all equilibria of its flux are found, and from those
that come near enough to the place Newton's method goes on in the true field.

What is found is checked by a count: as long as the energy falls nowhere without bound,
the sum of (-1)^index over all equilibria is 1 (Poincare and Hopf). Where it is not, the
grid is refined once. Before a magnet that a rod can touch the count need not close:
what is lost then are rods that lean on the magnet; nor in a map, of which those that
leave its box are left out.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.errors import InputError
from ...core.specimen import Specimen
from ...core.units import rad_from_deg
from ..fields import Field, Support, UniformField, outside
from ..magnet.flux import distance_at
from ..planar.march import M
from ..planar.near import settle
from ..planar.solver import ORDER, STEP
from ..probe import field_table
from ..scaling import field_array, rod_array, stations, stiffness_Nmm2
from .uniform import Equilibrium, planar_rod, tip_angle_rad, tip_angles
from .uniform import equilibrium as uniform_equilibrium

Array = NDArray[np.float64]

GRIDS = (15, 31)
"""Places along a diameter of the disc; the finer ones, if the count does not close."""
NEAR = 2.5
"""How far from its place a tip may end to be followed, in spacings of the grid."""
SAME = 1e-7
"""Tips nearer than this, in lengths of the rod and rad, are one equilibrium."""


def equilibria_before(
    specimen: Specimen, field: Field, support: Support, points: int
) -> tuple[Equilibrium, ...]:
    """Return the equilibria in a field that is not uniform, by rising tip angle.

    Raises
    ------
    InputError
        If sections differ in what they are magnetised by, or a field is not planar.
    """
    if not field.in_plane:
        raise InputError(
            "sources must lie within the plane z = 0 for the scan of all equilibria; "
            f"instead received {field}"
        )
    rod = rod_array(specimen, support)
    if np.ptp(rod[:, M]) > 1e-12 * np.abs(rod[:, M]).max() or rod[0, M] == 0.0:
        raise InputError(
            "all sections must have one remanence_mT times their area, not 0, for the "
            "scan of all equilibria before magnets; instead received "
            f"{list(specimen.remanences_mT)} mT"
        )
    found: list[Equilibrium] = []
    for grid in GRIDS:
        found = _scan(specimen, field, support, grid, points)
        if sum((-1) ** one.morse_index for one in found) == 1:
            break
    return tuple(sorted(found, key=lambda one: one.theta_tip_rad))


def _scan(
    specimen: Specimen, field: Field, support: Support, grid: int, points: int
) -> list[Equilibrium]:
    L = specimen.length_mm
    array = field_array(field, L)
    margin = 0.5 * max(specimen.sides_mm) / L
    edge = np.linspace(-1.0, 1.0, grid)
    found: list[Equilibrium] = []
    seen: list[Array] = []
    for x in edge:
        for y in edge:
            if math.hypot(x, y) > 1.0 + 1.5 / grid:
                continue
            if distance_at(array, x, y, 0.0) <= margin:
                continue
            for u in _dead_load_tips(specimen, field, support, x, y, NEAR * 2.0 / grid):
                _keep(specimen, field, support, u, points, seen, found)
    return found


def _dead_load_tips(
    specimen: Specimen, field: Field, support: Support, x: float, y: float, near: float
) -> list[Array]:
    """Return the unknowns of equilibria under the load of a place that end near it."""
    L = specimen.length_mm
    bx, by = field_table(field, [[x * L, y * L, 0.0]], length_mm=L)[0, :2] * 1e3
    flux_mT, angle = math.hypot(bx, by), math.atan2(by, bx)
    if flux_mT == 0.0:
        return []
    uniform = UniformField(flux_mT=flux_mT, angle_deg=math.degrees(angle))
    rod = planar_rod(specimen, uniform, support)
    pull = rod.pull_rad + rod.clamp_rad
    tips = []
    for v, turn in tip_angles(rod):
        one = uniform_equilibrium(rod, v, load=1.0, turn=turn, points=2)
        tip = np.array(one.tip_mm) / L
        if math.dist(tip, (x, y)) < near:
            theta = tip_angle_rad(rod, v, turn)
            tips.append(np.array([theta - pull, *tip, pull]))
    return tips


def _keep(
    specimen: Specimen,
    field: Field,
    support: Support,
    u: Array,
    points: int,
    seen: list[Array],
    found: list[Equilibrium],
) -> None:
    """Go on from `u` in the true field, and keep what is new."""
    L = specimen.length_mm
    array, margin = field_array(field, L), 0.5 * max(specimen.sides_mm) / L
    clamp = rad_from_deg(support.clamp_angle_deg)
    rod, s, out = rod_array(specimen, support), stations(points), np.empty((4, points))
    index = settle(rod, array, clamp, margin, s, ORDER, STEP, u, out)
    if index < 0:
        return
    x, y, theta, kappa = out
    if outside(field, out[None, :2], np.array([L]))[0]:
        return
    place = np.array([theta[-1], x[-1], y[-1]])
    if any(np.max(np.abs(place - other)) < SAME for other in seen):
        return
    seen.append(place)
    line = Centreline._trusted(s * L, x * L, y * L, theta.copy(), kappa / L)
    unit_Nm = stiffness_Nmm2(specimen)[0] / L * 1e-3
    found.append(
        Equilibrium(
            theta_tip_rad=float(theta[-1]), tip_mm=line.tip_mm, morse_index=int(index),
            root_moment_Nm=float(kappa[0] / rod[-1, 1] * unit_Nm), centreline=line,
        )
    )  # fmt: skip
