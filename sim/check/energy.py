"""Energy, gradient and Hessian of a rod whose tangent angle is piecewise polynomial.

Private to `check`, SI units: m, N, T. The magnetic and gravitational potentials are
integrated along the rod with Gauss points; the position is the integral of the tangent
with the same points, so that gradient and Hessian are those of the discrete energy.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.specimen import Specimen
from ...core.units import MU0
from ..fields import Field, Support
from ..probe import field_table
from ..spatial.rod import SpatialRod, Vector
from .quadrature import integrals

Array = NDArray[np.float64]

PROBE_MM = 1e-3
"""Step of the differences that give the Hessian the field's second derivatives."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Discretisation:
    """Quadrature points root first, and what nodal angles do there (SI: m, N, T).

    `angle` and `slope` (q, n) give theta and theta' at the points, `place` (q, q) the
    integral from the root to each point; `weight` (q,) the quadrature weights.
    """

    s: Array
    weight: Array
    angle: Array
    slope: Array
    place: Array
    EI: Array
    m: Array
    load: Array


def lobatto(degree: int) -> Array:
    """Gauss-Lobatto points: ends, and extrema of the Legendre polynomial."""
    inner: Any = (
        np.polynomial.Legendre.basis(degree).deriv().roots() if degree > 1 else []
    )
    return np.concatenate([[-1.0], np.real(inner), [1.0]])


def lagrange(degree: int, xi: Array) -> tuple[Array, Array]:
    """Values and derivatives of the nodal polynomials at `xi`, each (len, degree+1)."""
    V = np.polynomial.legendre.legvander(lobatto(degree), degree)
    inverse = np.linalg.inv(V)
    values = np.polynomial.legendre.legvander(xi, degree) @ inverse
    slopes = np.stack(
        [
            np.polynomial.legendre.legval(xi, np.polynomial.legendre.legder(row))
            if degree
            else np.zeros_like(xi)
            for row in np.eye(degree + 1)
        ],
        axis=1,
    )
    return values, slopes @ inverse


def node_places(mesh: Array, degree: int) -> Array:
    """Return the arc lengths of the nodes of all elements, ends shared."""
    local = 0.5 * (lobatto(degree) + 1.0)
    parts = [a + (b - a) * local[:-1] for a, b in pairwise(mesh)]
    return np.concatenate([*parts, mesh[-1:]])


def discretise(
    specimen: Specimen, support: Support, mesh: Array, degree: int
) -> Discretisation:
    """Return the rod on elements whose ends are `mesh`, in m."""
    xi, w = np.polynomial.legendre.leggauss(degree + 8)
    values, slopes = lagrange(degree, xi)
    q, count = len(xi), len(mesh) - 1
    inner = integrals(xi)
    angle = np.zeros((count * q, count * degree + 1))
    slope, place = np.zeros_like(angle), np.zeros((count * q, count * q))
    for e, h in enumerate(np.diff(mesh)):
        rows, cols = slice(e * q, e * q + q), slice(e * degree, e * degree + degree + 1)
        angle[rows, cols] = values
        slope[rows, cols] = slopes * 2.0 / h
        place[rows, rows] = inner * h / 2.0
        place[e * q + q :, rows] = w * h / 2.0
    weight = np.concatenate([w * h / 2.0 for h in np.diff(mesh)])
    middle = np.repeat(0.5 * (mesh[1:] + mesh[:-1]), q)
    joints = np.array(specimen.joints_mm) * 1e-3
    which = np.searchsorted(joints, middle)
    across = specimen.cross_sections
    area = np.array([one.area_mm2 for one in across])[which] * 1e-6
    second = np.array([one.in_plane_mm4 for one in across])[which] * 1e-12
    moduli = np.array([part.E_MPa for part in specimen.sections])[which] * 1e6
    remanence = np.array(specimen.remanences_mT)[which] * 1e-3
    s = (mesh[:-1, None] + np.diff(mesh)[:, None] * 0.5 * (xi + 1.0)).ravel()
    return Discretisation(
        s=s, weight=weight, angle=angle, slope=slope, place=place,
        EI=moduli * second,
        m=support.load_factor * area * remanence / MU0,
        load=weight_N_per_m3(specimen, support.gravity_m_s2)[:2] * area[:, None],
    )  # fmt: skip


def weight_N_per_m3(rod: Specimen | SpatialRod, gravity_m_s2: Vector) -> Array:
    """Return the weight (x, y, z) of a volume; refuse it of a rod without density."""
    if not any(gravity_m_s2):
        return np.zeros(3)
    if rod.density_kg_m3 is None:
        raise InputError(
            "the rod must have a density_kg_m3 in kg/m3 for its weight to be taken "
            "into account; instead received none"
        )
    weight: Array = rod.density_kg_m3 * np.array(gravity_m_s2)
    return weight


def _flux(field: Field, length_mm: float, r: Array) -> tuple[Array, Array]:
    """B (q, 2) in T and dB_i/dx_j (q, 2, 2) in T/m at positions (q, 2) in m."""
    points = np.column_stack([r * 1e3, np.zeros(len(r))])
    table = field_table(field, points, length_mm=length_mm)
    gradient = table[:, 3:].reshape(-1, 3, 3) * 1e3
    return table[:, :2], gradient[:, :2, :2]


def energy(
    grid: Discretisation, field: Field, length_mm: float, theta: Array, load: float
) -> tuple[float, Array, Array, Array]:
    """Return energy, gradient by the nodal angles, positions and tip."""
    a = grid.angle @ theta
    bend = grid.slope @ theta
    t = np.column_stack([np.cos(a), np.sin(a)])
    n = np.column_stack([-t[:, 1], t[:, 0]])
    r = grid.place @ t
    B, G = _flux(field, length_mm, r)
    m, w = load * grid.m, grid.weight
    force = load * grid.load + m[:, None] * np.einsum("qi,qij->qj", t, G)
    along = np.einsum("qi,qi->q", t, B)
    total = w @ (0.5 * grid.EI * bend**2 - m * along)
    total -= load * np.einsum("q,qi,qi->", w, grid.load, r)
    # What pulls at the tangent of a point: its own torque, and all force beyond it.
    beyond = grid.place.T @ (w[:, None] * force)
    turn = w * m * np.einsum("qi,qi->q", n, B) + np.einsum("qi,qi->q", n, beyond)
    gradient = grid.slope.T @ (w * grid.EI * bend) - grid.angle.T @ turn
    return float(total), gradient, r, w @ t


def hessian(
    grid: Discretisation, field: Field, length_mm: float, theta: Array, load: float
) -> Array:
    """Return the second derivatives of the energy by the nodal angles."""
    a = grid.angle @ theta
    t = np.column_stack([np.cos(a), np.sin(a)])
    n = np.column_stack([-t[:, 1], t[:, 0]])
    r = grid.place @ t
    B, G = _flux(field, length_mm, r)
    m, w = load * grid.m, grid.weight
    force = load * grid.load + m[:, None] * np.einsum("qi,qij->qj", t, G)
    beyond = grid.place.T @ (w[:, None] * force)
    H = grid.slope.T @ ((w * grid.EI)[:, None] * grid.slope)
    own = w * m * np.einsum("qi,qi->q", t, B) + np.einsum("qi,qi->q", t, beyond)
    H += grid.angle.T @ (own[:, None] * grid.angle)
    if field.uniform is not None:
        return H
    # dr = place (n dtheta); the field acts on it through G and its derivative.
    move = [grid.place @ (n[:, i, None] * grid.angle) for i in range(2)]
    wm = w * m
    for i in range(2):
        cross = np.einsum("qj,qj->q", n, G[:, :, i]) * wm
        term = grid.angle.T @ (cross[:, None] * move[i])
        H -= term + term.T
    step = PROBE_MM * 1e-3
    for i in range(2):
        shift = np.zeros(2)
        shift[i] = step
        up = np.einsum("qj,qjk->qk", t, _flux(field, length_mm, r + shift)[1])
        down = np.einsum("qj,qjk->qk", t, _flux(field, length_mm, r - shift)[1])
        second = (up - down) / (2.0 * step)
        for k in range(2):
            H -= move[i].T @ ((wm * second[:, k])[:, None] * move[k])
    return 0.5 * (H + H.T)
