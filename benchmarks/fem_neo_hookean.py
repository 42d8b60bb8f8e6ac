"""Finite elements for the solid model: a hard-magnetic neo-Hookean cantilever in 3D.

    python benchmarks/fem_neo_hookean.py 2 --flux-mT 50 --angle-deg 90
    python benchmarks/fem_neo_hookean.py 5 --gap-mm 60 --poisson 0.3 --from-tip

Each takes about a minute.

Q2 displacements and linear discontinuous pressure on hexahedra (the pressure condensed
in each element), half of the rod by symmetry about z = 0, root face fixed, banded
Cholesky. Energy mu/2 (J^(-2/3) tr F^T F - 3) + K/2 (J - 1)^2, and the magnetic one,
which for a uniform Br is the traction Br B / mu0 on the tip's face. Three meshes,
each started from the last; the first from the solid model's own shape, on which the
result does not depend. mm, MPa, N. Prints the shape's distance from the solid model's.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline, RegularGridInterpolator
from scipy.linalg import LinAlgError, solveh_banded
from scipy.sparse import diags, triu
from scipy.sparse.linalg import splu

from magbend.core.magnet import Magnet
from magbend.core.units import MU0
from magbend.sim import MagnetField, UniformField, gmc, magnet_flux_mT
from magbend.sim.one_rod import solve

GAUSS, WEIGHT = np.polynomial.legendre.leggauss(3)
SIZES = ((0.15, 1.2, (0.0, 0.5)), (0.08, 0.6, (0.0, 0.33, 0.5)),
         (0.04, 0.5, (0.0, 0.26, 0.43, 0.5)))  # fmt: skip
"""Per mesh, in sides: first and largest length along the rod, half the section."""


def line(x):
    """Return quadratic shape functions on [-1, 1] and their slopes."""
    return (
        np.array([x * (x - 1) / 2, 1 - x * x, x * (x + 1) / 2]),
        np.array([x - 0.5, -2 * x, x + 0.5]),
    )


def brick():
    """Return slopes (27, 27, 3), weights (27,), places (27, 3) of the Gauss points."""
    slopes, weights, places = [], [], []
    for i in range(3):
        for j in range(3):
            for k in range(3):
                (a, da), (b, db), (c, dc) = (line(GAUSS[m]) for m in (i, j, k))
                triples = ((da, b, c), (a, db, c), (a, b, dc))
                slopes.append(
                    [np.einsum("i,j,k->ijk", *triple).ravel() for triple in triples]
                )
                weights.append(WEIGHT[i] * WEIGHT[j] * WEIGHT[k])
                places.append((GAUSS[i], GAUSS[j], GAUSS[k]))
    return (
        np.ascontiguousarray(np.array(slopes).transpose(0, 2, 1)),
        np.array(weights),
        np.array(places),
    )


D, W, X = brick()


@njit(cache=True)
def element(u, size, mu, K, D, W, X, Ke, Re):
    """Fill stiffness Ke (81, 81) and internal force Re (81,) of one element."""
    det = size[0] * size[1] * size[2] / 8.0
    dN, F, G = np.zeros((27, 27, 3)), np.zeros((27, 3, 3)), np.zeros((27, 3, 3))
    J, dJ, BJ = np.zeros(27), np.zeros((27, 81)), np.zeros((4, 81))
    d, M, T = np.zeros(4), np.zeros(4), np.zeros((3, 3, 81))
    for g in range(27):
        for c in range(3):
            dN[g, :, c] = D[g, :, c] * 2.0 / size[c]
        for i in range(3):
            for c in range(3):
                F[g, i, c] = (i == c) + np.sum(u[:, i] * dN[g, :, c])
        J[g] = np.linalg.det(F[g])
        G[g] = np.linalg.inv(F[g]).T
        for a in range(27):
            for i in range(3):
                dJ[g, 3 * a + i] = J[g] * np.sum(G[g, i] * dN[g, a])
        for q in range(4):
            N = 1.0 if q == 0 else X[g, q - 1]
            d[q] += W[g] * det * N * (J[g] - 1.0)
            M[q] += W[g] * det * N * N
            BJ[q] += W[g] * det * N * dJ[g]
    pressure = K * d / M
    Ke[:] = 0.0
    Re[:] = 0.0
    for g in range(27):
        w, f, h = W[g] * det, F[g], G[g]
        I1 = np.sum(f * f)
        m = mu * J[g] ** (-2.0 / 3.0)
        p = pressure[0] + np.sum(pressure[1:] * X[g])
        for a in range(27):
            for i in range(3):
                stress = np.sum((f[i] - I1 / 3.0 * h[i]) * dN[g, a])
                Re[3 * a + i] += w * (m * stress + p * dJ[g, 3 * a + i])
        T[:] = 0.0
        for i in range(3):
            for j in range(3):
                for k in range(3):
                    for c in range(3):
                        v = -2.0 / 3.0 * (h[i, j] * f[k, c] + f[i, j] * h[k, c])
                        v += 2.0 / 9.0 * I1 * h[i, j] * h[k, c]
                        v += I1 / 3.0 * h[i, c] * h[k, j] + (i == k and j == c)
                        v = m * v + p * J[g] * (h[i, j] * h[k, c] - h[i, c] * h[k, j])
                        for b in range(27):
                            T[i, j, 3 * b + k] += w * v * dN[g, b, c]
        for a in range(27):
            for i in range(3):
                for c in range(3):
                    Ke[3 * a + i] += dN[g, a, c] * T[i, c]
    for q in range(4):
        for r in range(81):
            Ke[r] += K / M[q] * BJ[q, r] * BJ[q]


@njit(cache=True)
def assemble(u, conn, sizes, mu, K, D, W, X, AB, R):
    """Fill the lower band AB of the stiffness, and the internal force R."""
    Ke, Re, own = np.zeros((81, 81)), np.zeros(81), np.zeros((27, 3))
    AB[:] = 0.0
    R[:] = 0.0
    for e in range(conn.shape[0]):
        for a in range(27):
            own[a] = u[conn[e, a]]
        element(own, sizes[e], mu[e], K[e], D, W, X, Ke, Re)
        for r in range(81):
            row = 3 * conn[e, r // 3] + r % 3
            R[row] += Re[r]
            for c in range(81):
                column = 3 * conn[e, c // 3] + c % 3
                if column <= row:
                    AB[row - column, column] += Ke[r, c]


@njit(cache=True)
def hold(AB, r, fixed):
    """Replace the equations of fixed displacements by identities."""
    for f in range(AB.shape[1]):
        if fixed[f]:
            AB[:, f] = 0.0
            for k in range(1, min(AB.shape[0], f + 1)):
                AB[k, f - k] = 0.0
            AB[0, f] = 1.0
            r[f] = 0.0


def graded(a, b, first, largest):
    """Return points from a to b, their spacing growing by 1.6 from `first`."""
    x, h = [a], first
    while x[-1] < b - 1e-12:
        x.append(x[-1] + h)
        h = min(1.6 * h, largest)
    return a + (np.array(x) - a) * (b - a) / (x[-1] - a)


class Beam:
    """One mesh of a rod, and its displacements `u` (nodes, 3)."""

    def __init__(self, rod, nu, level):
        a = rod.side_mm
        first, largest, half = SIZES[level]
        joints = np.cumsum([0.0] + [part.length_mm for part in rod.sections])
        xs = np.zeros(1)
        for k, (left, right) in enumerate(pairwise(joints)):
            middle, last = (left + right) / 2, k + 2 == len(joints)
            near = first * a * (1 if k == 0 else 2)
            far = 0.3 * a if last else 2 * first * a
            ahead = graded(left, middle, near, largest * a)
            back = left + right - graded(left, middle, far, largest * a)[::-1]
            xs = np.concatenate([xs, ahead[1:], back[1:]])
        zs = np.array(half) * a
        ys = np.concatenate([-zs[::-1], zs[1:]])
        self.grid = [np.sort(np.r_[v, (v[1:] + v[:-1]) / 2]) for v in (xs, ys, zs)]
        self.shape = tuple(len(v) for v in self.grid)
        index = np.arange(np.prod(self.shape)).reshape(self.shape)
        cells = np.argwhere(np.ones((len(xs) - 1, len(ys) - 1, len(zs) - 1)))
        self.conn = np.array(
            [
                index[2 * i : 2 * i + 3, 2 * j : 2 * j + 3, 2 * k : 2 * k + 3].ravel()
                for i, j, k in cells
            ]
        )
        steps = [np.diff(v) for v in (xs, ys, zs)]
        self.sizes = np.array(
            [[h[c] for h, c in zip(steps, q, strict=True)] for q in cells]
        )
        where = np.searchsorted(joints[1:], (xs[1:] + xs[:-1]) / 2)[cells[:, 0]]
        E = np.array([part.E_MPa for part in rod.sections])[where]
        self.mu, self.K = E / 2 / (1 + nu), E / 3 / (1 - 2 * nu)
        self.X0 = np.stack(np.meshgrid(*self.grid, indexing="ij"), -1).reshape(-1, 3)
        fixed = np.zeros((len(self.X0), 3), bool)
        fixed[index[:, :, 0].ravel(), 2] = True
        fixed[index[0].ravel()] = True
        self.fixed = fixed.ravel()
        self.band = 3 * (2 * index[0].size + 2 * self.shape[2] + 2) + 3
        self.u = np.zeros_like(self.X0)
        self.face = self._face(index[-1], ys, zs)
        self.axis = index[:, self.shape[1] // 2, 0]

    def _face(self, nodes, ys, zs):
        """Return nodal weights whose sum is the area of the (half) tip face."""
        out = np.zeros(len(self.X0))
        simpson = np.outer([1, 4, 1], [1, 4, 1]) / 36.0
        for j, dy in enumerate(np.diff(ys)):
            for k, dz in enumerate(np.diff(zs)):
                patch = nodes[2 * j : 2 * j + 3, 2 * k : 2 * k + 3]
                out[patch] += dy * dz * simpson
        return out

    def solve(self, traction):
        """Iterate Newton's method under a traction on the tip face.

        `traction` takes places (n, 3); how it changes with them is left out of the
        stiffness, which costs a few more iterations before a magnet.
        """
        AB, R = np.zeros((self.band, self.u.size)), np.zeros(self.u.size)
        held = np.flatnonzero(self.face)
        load = np.zeros_like(self.u)
        for _ in range(40):
            load[held] = self.face[held, None] * traction((self.X0 + self.u)[held])
            assemble(self.u, self.conn, self.sizes, self.mu, self.K, D, W, X, AB, R)
            r = load.ravel() - R
            hold(AB, r, self.fixed)
            try:
                change = solveh_banded(AB, r, lower=True, check_finite=False)
            except LinAlgError:  # indefinite far from the solution
                n = self.u.size
                low = diags(
                    [AB[k, : n - k] for k in range(self.band)],
                    [-k for k in range(self.band)],
                    format="csc",
                )
                change = splu((low + triu(low.T, 1)).tocsc()).solve(r)
            self.u += change.reshape(-1, 3)
            if np.abs(change).max() < 1e-8:
                return
        raise RuntimeError("Newton's method did not converge")

    def bend(self, shape, side_mm):
        """Start from the cross-sections of a rod's shape."""
        s, (x, y, _) = shape.s_mm, self.X0.T
        r = CubicSpline(s, shape.points_mm)(x)
        angle = CubicSpline(s, shape.theta_rad)(x)
        ramp = 1 - np.exp(-x / (0.3 * side_mm))
        self.u[:, 0] = r[:, 0] - np.sin(angle) * y * ramp - x
        self.u[:, 1] = r[:, 1] + y * (np.cos(angle) - 1) * ramp
        self.u.ravel()[self.fixed] = 0.0

    def take(self, coarse):
        """Start from a coarser mesh."""
        field = RegularGridInterpolator(coarse.grid, coarse.u.reshape(*coarse.shape, 3))
        self.u = field(self.X0)
        self.u.ravel()[self.fixed] = 0.0


def arguments():
    """Return the command's rod, field and Poisson's ratio."""
    parser = argparse.ArgumentParser(description="Solid model against finite elements")
    parser.add_argument("gmc", type=int)
    parser.add_argument("--flux-mT", type=float)
    parser.add_argument("--angle-deg", type=float, default=90.0)
    parser.add_argument("--gap-mm", type=float, help="before the 55 mm cube instead")
    parser.add_argument(
        "--from-tip", action="store_true", help="magnetised to the root"
    )
    parser.add_argument("--poisson", type=float, default=0.49)
    given = parser.parse_args()
    rod = gmc(given.gmc)
    if given.from_tip:
        rod = replace(rod, remanence_mT=-rod.remanence_mT)
    if given.gap_mm is None:
        field = UniformField(flux_mT=given.flux_mT, angle_deg=given.angle_deg)
    else:
        field = MagnetField(magnet=Magnet.cube(55.0, 1.305), gap_mm=given.gap_mm)
    return rod, field, given.poisson


def traction(rod, field):
    """Return the function from places (n, 3) in mm to Br B / mu0 in MPa."""

    def of(places):
        if isinstance(field, UniformField):
            angle = np.radians(field.angle_deg)
            flux_mT = field.flux_mT * np.array([np.cos(angle), np.sin(angle), 0.0])
        else:
            flux_mT = magnet_flux_mT(
                field.magnet, places, length_mm=rod.length_mm, gap_mm=field.gap_mm
            )
        return rod.remanence_mT * flux_mT * 1e-12 / MU0

    return of


def main() -> None:
    """Solve one case on three meshes and print how far the solid model is."""
    rod, field, nu = arguments()
    rough, model = (
        solve(rod, field, model="solid", poisson_ratio=nu, points=points).centreline
        for points in (601, 61)
    )
    before = None
    for level in range(len(SIZES)):
        start = time.perf_counter()
        beam = Beam(rod, nu, level)
        if before is None:
            beam.bend(rough, rod.side_mm)
        else:
            beam.take(before)
        beam.solve(traction(rod, field))
        axis = (beam.X0 + beam.u)[beam.axis, :2]
        miss = CubicSpline(beam.grid[0], axis)(model.s_mm) - model.points_mm
        deflection = np.hypot(axis[-1, 0] - rod.length_mm, axis[-1, 1])
        tip = np.hypot(model.tip_mm[0] - rod.length_mm, model.tip_mm[1])
        print(
            f"mesh {beam.shape}: {time.perf_counter() - start:5.1f} s, tip "
            f"({axis[-1, 0]:.6f}, {axis[-1, 1]:.6f}) mm; solid model's deflection "
            f"{(tip / deflection - 1) * 100:+.4f} %, RMS "
            f"{np.sqrt(np.mean(np.sum(miss**2, axis=1))) * 1e3:.3f} um",
            flush=True,
        )
        before = beam


if __name__ == "__main__":
    main()
