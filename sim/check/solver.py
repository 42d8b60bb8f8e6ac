"""An independent check in the plane: least energy of a rod under distributed load.

Nothing is shared with the marching solvers: no free-tip march, no pole load, no
variational columns. The tangent angle is a polynomial on each of a number of elements,
the position its integral, and the energy

    integral of  EI theta'^2 / 2 - m t(theta) . B(r) - rho A g . r

is made stationary by Newton's method with the exact gradient, in which the magnetic
term appears as the distributed torque m n . B and, through r, the distributed force
m grad(t . B). Linear elements converge with order 2 at the tip, degree p with order
2 p; degree 12 reaches rounding. The negative eigenvalues of the Hessian are the Morse
index.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...core.arrays import real_array
from ...core.checks import listed, shown, whole
from ...core.errors import InputError, SolverError
from ...core.specimen import Specimen
from ...core.units import rad_from_deg
from ..fields import Field, Support, as_field, check_case, check_plain
from .energy import Discretisation, discretise, energy, hessian, lagrange, node_places

Array = NDArray[np.float64]

MOST_DEGREE = 40
"""Of the polynomials: from 20 on, rounding is all that is left."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckSolution:
    """An equilibrium of the discretised rod.

    Parameters
    ----------
    s_mm, theta_rad, x_mm, y_mm : ndarray, shape (q,)
        At the quadrature points.
    tip_mm : tuple of float
        Tip position, in mm.
    theta_tip_rad : float
        Angle of the tip.
    morse_index : int
        Negative eigenvalues of the Hessian.
    energy_J : float
        Elastic plus magnetic energy plus that of the weight.
    nodes : ndarray
        Nodal angles (private).
    """

    s_mm: Array
    theta_rad: Array
    x_mm: Array
    y_mm: Array
    tip_mm: tuple[float, float]
    theta_tip_rad: float
    morse_index: int
    energy_J: float
    nodes: Array
    mesh: Array
    degree: int
    clamp_rad: float

    def at(self, s_mm: Array) -> tuple[Array, Array]:
        """Return x and y in mm at any arc lengths, by quadrature within elements."""
        points, weights = np.polynomial.legendre.leggauss(self.degree + 8)
        edges = self.mesh * 1e3
        ends = np.concatenate([[0.0], np.cumsum(self._element_ends(points, weights))])
        x = np.empty(len(s_mm), dtype=np.complex128)
        for k, s in enumerate(s_mm):
            e = int(np.clip(np.searchsorted(edges, s) - 1, 0, len(edges) - 2))
            half = 0.5 * (s - edges[e])
            local = edges[e] + half * (points + 1.0)
            x[k] = ends[e] + half * (weights @ np.exp(1j * self._theta(e, local)))
        return x.real, x.imag

    def _element_ends(self, points: Array, weights: Array) -> Array:
        edges = self.mesh * 1e3
        out = []
        for e in range(len(edges) - 1):
            half = 0.5 * (edges[e + 1] - edges[e])
            local = edges[e] + half * (points + 1.0)
            out.append(half * (weights @ np.exp(1j * self._theta(e, local))))
        return np.array(out)

    def _theta(self, e: int, s_mm: Array) -> Array:
        edges = self.mesh * 1e3
        xi = 2.0 * (s_mm - edges[e]) / (edges[e + 1] - edges[e]) - 1.0
        own = self.nodes[e * self.degree : (e + 1) * self.degree + 1]
        values: Array = lagrange(self.degree, xi)[0] @ own
        return values


def check_solve(
    specimen: Specimen,
    field: Field,
    *,
    support: Support | None = None,
    degree: int = 12,
    elements: int = 1,
    start: tuple[Array, Array] | None = None,
) -> CheckSolution:
    """Return an equilibrium of the discretised rod.

    Parameters
    ----------
    specimen, field, support
        As of `solve`; everything within the plane.
    degree, elements : int
        Polynomial degree, and elements per section. Long rods in strong fields need
        more elements; compare two.
    start : tuple of ndarray, optional
        s_mm and theta_rad to start from; the straight rod, in steps of the load, else.

    Raises
    ------
    InputError
        If the case is not planar, or a weight has no density.
    SolverError
        If Newton's method does not converge.
    """
    support = support or Support()
    field = as_field(field)
    check_case(specimen, field, support)
    check_plain(specimen)
    degree = whole(degree, 1, MOST_DEGREE, "degree")
    elements = whole(elements, 1, 1000, "elements")
    if not support.in_plane or not field.in_plane:
        raise InputError(
            "the check solver takes fields and weight within the plane z = 0; instead "
            f"received gravity_m_s2 {support.gravity_m_s2} m/s2 and {field}"
        )
    mesh = _mesh(specimen, elements)
    grid = discretise(specimen, support, mesh, degree)
    clamp = rad_from_deg(support.clamp_angle_deg)
    nodes_s = node_places(mesh, degree)
    if start is None:
        theta = np.full(len(nodes_s), clamp)
        for load in (0.25, 0.5, 0.75, 1.0):
            theta, H = _newton(grid, field, specimen.length_mm, theta, load)
    else:
        theta = np.interp(nodes_s * 1e3, *_start(start))
        theta[0] = clamp
        theta, H = _newton(grid, field, specimen.length_mm, theta, 1.0)
    total, _, r, tip = energy(grid, field, specimen.length_mm, theta, 1.0)
    at = grid.angle @ theta
    return CheckSolution(
        s_mm=grid.s * 1e3, theta_rad=at, x_mm=r[:, 0] * 1e3, y_mm=r[:, 1] * 1e3,
        tip_mm=(float(tip[0]) * 1e3, float(tip[1]) * 1e3),
        theta_tip_rad=float(theta[-1]),
        morse_index=int(np.sum(np.linalg.eigvalsh(H[1:, 1:]) < 0.0)),
        energy_J=total, nodes=theta, mesh=mesh, degree=degree, clamp_rad=clamp,
    )  # fmt: skip


def _start(start: tuple[Array, Array]) -> tuple[Array, Array]:
    given = listed(start) or ()
    if len(given) == 2:
        s_mm = real_array(given[0], "start s_mm", "mm")
        theta_rad = real_array(given[1], "start theta_rad", "rad")
        if s_mm.ndim == 1 and s_mm.shape == theta_rad.shape and s_mm.size:
            return s_mm, theta_rad
    raise InputError(
        "start must be two arrays of one length, s_mm in mm and theta_rad in rad; "
        f"instead received {shown(start)}"
    )


def _mesh(specimen: Specimen, elements: int) -> Array:
    ends = np.concatenate([[0.0], [part.length_mm for part in specimen.sections]])
    joints = np.cumsum(ends) * 1e-3
    fine = [np.linspace(a, b, elements + 1)[:-1] for a, b in pairwise(joints)]
    return np.concatenate([*fine, joints[-1:]])


def _newton(
    grid: Discretisation, field: Field, length_mm: float, theta: Array, load: float
) -> tuple[Array, Array]:
    """Return the stationary nodal angles and the Hessian there."""
    theta = theta.copy()
    before = np.inf
    for _ in range(60):
        gradient = energy(grid, field, length_mm, theta, load)[1]
        H = hessian(grid, field, length_mm, theta, load)
        change = np.linalg.solve(H[1:, 1:], -gradient[1:])
        size = float(np.max(np.abs(change)))
        theta[1:] += change * min(1.0, 0.5 / size) if size > 0.0 else 0.0
        if size < 1e-13 or (size < 1e-10 and size > 0.3 * before):
            return theta, H
        before = size
    raise SolverError(
        "the check solver found no equilibrium near the solution given; the solution "
        "is not verified"
    )
