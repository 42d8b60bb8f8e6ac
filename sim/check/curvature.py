"""Energy, gradient and Hessian of a rod in space by its curvature.

Private to `check`; N and mm, and T. The unknown is the curvature k about d1 and d2 and
the twist about d3, at the Gauss points of elements. It fixes the rod from the clamp on,

    R' = R k^,   r' = d3,   directors d1, d2, d3 the columns of R,

and a change of it turns the rod by theta = integral of R dk, shifts it by the integral
of theta x d3, and changes the energy

    integral of  (k - k0) . S (k - k0) / 2 - mu . B(r) - w . r

with S = (EI_1, EI_2, GJ), the rest curvature k0, the moment mu = R m and the weight w.
In the gradient is what the load beyond a point does there, by the adjoint integral.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.specimen import Specimen
from ...core.units import MU0
from ..fields import Field, Support
from ..probe import field_table
from ..spatial.rod import SpatialRod
from .energy import PROBE_MM, weight_N_per_m3
from .quadrature import Quadrature

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Directors (columns, (q, 3, 3)) and places (q, 3) in mm; places of edges."""

    R: Array
    r: Array
    joints: Array


def cross_matrix(v: Array) -> Array:
    """Return the matrices v^ (..., 3, 3) with v^ u = v x u."""
    out = np.zeros((*v.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., i, j], out[..., j, i] = -v[..., k], v[..., k]
    return out


def pose(grid: Quadrature, clamp: Array, k: Array) -> Pose:
    """Return the rod of a curvature (q, 3), by collocation at the Gauss points."""
    count, points = len(grid.half), len(grid.xi)
    spin = grid.half[:, None, None, None] * cross_matrix(k).reshape(count, points, 3, 3)
    A = np.einsum("ij,ejab->eiajb", grid.inner, spin)
    A = A.reshape(count, 3 * points, 3 * points) + np.eye(3 * points)
    # Transposed, from the root of each element.
    turned = np.linalg.solve(A, np.tile(np.eye(3), (count, points, 1)))
    turned = turned.reshape(count, points, 3, 3)
    across = np.eye(3) - np.einsum("j,ejab,ejbc->eac", grid.share, spin, turned)
    start = np.empty((count, 3, 3))
    R = clamp
    for e in range(count):
        start[e] = R
        R = R @ across[e].T
    R = np.einsum("eab,encb->enac", start, turned).reshape(-1, 3, 3)
    t = R[:, :, 2]
    steps = (grid.weight[:, None] * t).reshape(count, points, 3).sum(axis=1)
    joints = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    return Pose(R=R, r=grid.integral(t), joints=joints)


class Case:
    """A rod on elements, clamped along `clamp`, in a field."""

    def __init__(
        self,
        rod: SpatialRod | Specimen,
        field: Field,
        support: Support,
        clamp: Array,
        grid: Quadrature,
    ) -> None:
        self.grid, self.field, self.clamp = grid, field, clamp
        self._given = rod, support
        self.length_mm = rod.length_mm
        ends = np.cumsum([part.length_mm for part in rod.sections])
        middle = 0.5 * (grid.edges[1:] + grid.edges[:-1])
        which = np.repeat(np.searchsorted(ends[:-1], middle), len(grid.xi))
        stiffness, rest, moment, area = (table[which] for table in _sections(rod))
        self.stiffness, self.rest = stiffness, rest
        self.moment = support.load_factor * moment
        weight = weight_N_per_m3(rod, support.gravity_m_s2)
        self.weight = area[:, None] * weight * 1e-9

    def on(self, grid: Quadrature) -> Case:
        """Return the same on other elements."""
        rod, support = self._given
        return Case(rod, self.field, support, self.clamp, grid)

    def pose(self, k: Array) -> Pose:
        """Return the rod of a curvature."""
        return pose(self.grid, self.clamp, k)

    def energy(self, k: Array, load: float) -> float:
        """Return the energy in N mm, with all loads times `load`."""
        at = self.pose(k)
        B = self._flux(at.r)[0]
        mu = np.einsum("qab,qb->qa", at.R, self.moment)
        bend = 0.5 * np.sum(self.stiffness * (k - self.rest) ** 2, axis=1)
        pull = np.sum(mu * B, axis=1) + np.sum(self.weight * at.r, axis=1)
        return float(self.grid.weight @ (bend - load * pull))

    def derivatives(self, k: Array, load: float) -> tuple[Array, Array]:
        """Return gradient (q, 3) and Hessian (3 q, 3 q) of the energy."""
        grid, at = self.grid, self.pose(k)
        w, t = grid.weight[:, None], at.R[:, :, 2]
        B, G = self._flux(at.r)
        mu = load * np.einsum("qab,qb->qa", at.R, self.moment)
        force = load * self.weight + np.einsum("qi,qij->qj", mu, G)
        F = grid.beyond(w * force)
        Q = grid.beyond(w * np.cross(mu, B) + np.cross(t, F))
        stiff = w * self.stiffness
        gradient = stiff * (k - self.rest) - np.einsum("qab,qa->qb", at.R, Q)
        H = -self._change(at, B, G, mu, F, Q)
        H[np.diag_indices(len(H))] += stiff.ravel()
        return gradient, 0.5 * (H + H.T)

    def _change(
        self, at: Pose, B: Array, G: Array, mu: Array, F: Array, Q: Array
    ) -> Array:
        """Return what R^T Q changes by, a column for each curvature."""
        grid, count = self.grid, len(at.r)
        points, w = np.arange(count), grid.weight[:, None, None]
        own = np.zeros((count, 3, count, 3))
        own[points, :, points] = at.R
        turn = grid.integral(own).reshape(count, 3, -1)
        along = cross_matrix(at.R[:, :, 2])
        turned = -cross_matrix(mu) @ turn
        torque = -cross_matrix(B) @ turned
        bent = cross_matrix(F) @ (along @ turn)
        if G.any():
            move = grid.integral(-along @ turn)
            torque += cross_matrix(mu) @ (G @ move)
            force = G.transpose(0, 2, 1) @ turned + self._second(at.r, mu) @ move
            bent += along @ grid.beyond(w * force)
        change = cross_matrix(Q) @ turn + grid.beyond(w * torque + bent)
        whole: Array = (at.R.transpose(0, 2, 1) @ change).reshape(3 * count, -1)
        return whole

    def _flux(self, r: Array) -> tuple[Array, Array]:
        """B (q, 3) in T and dB_i/dx_j (q, 3, 3) in T/mm at places (q, 3) in mm."""
        table = field_table(self.field, r, length_mm=self.length_mm)
        return table[:, :3], table[:, 3:].reshape(-1, 3, 3)

    def _second(self, r: Array, mu: Array) -> Array:
        """Return the second derivatives (q, 3, 3) of mu . B, by differences."""
        out = np.empty((len(r), 3, 3))
        for i, shift in enumerate(PROBE_MM * np.eye(3)):
            rise = self._flux(r + shift)[1] - self._flux(r - shift)[1]
            out[:, i] = np.einsum("qj,qjk->qk", mu, rise) / (2.0 * PROBE_MM)
        return out


def _sections(rod: SpatialRod | Specimen) -> tuple[Array, Array, Array, Array]:
    """Return stiffness, rest curvature, moment per length and area of each section.

    In N mm2, 1/mm, A m and mm2.
    """
    if isinstance(rod, SpatialRod):
        stiffness = [part.stiffness_Nmm2 for part in rod.sections]
        rest = [part.rest_curvature_per_mm for part in rod.sections]
        remanence_mT = [part.remanence_mT for part in rod.sections]
        area = np.array([part.area_mm2 for part in rod.sections])
    else:
        shear = 0.5 / (1.0 + rod.poisson_ratio)
        across = rod.cross_sections
        moduli = np.array([part.E_MPa for part in rod.sections])
        shapes = [
            (one.across_mm4, one.in_plane_mm4, shear * one.torsion_mm4)
            for one in across
        ]
        stiffness = moduli[:, None] * np.array(shapes)
        rest = [(0.0, k, 0.0) for k in rod.natural_curvatures_per_mm]
        axes = zip(rod.transverse_mT, rod.remanences_mT, strict=True)
        remanence_mT = [(y, z, x) for (y, z), x in axes]
        area = np.array([one.area_mm2 for one in across])
    moment = np.array(remanence_mT) * 1e-9 / MU0 * area[:, None]
    return np.array(stiffness), np.array(rest), moment, area
