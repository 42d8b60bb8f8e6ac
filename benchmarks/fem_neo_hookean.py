"""Finite elements for the solid model: a hard-magnetic neo-Hookean cantilever in 3D.

    python benchmarks/fem_neo_hookean.py --gmc 2 --flux-mT 50 --angle-deg 90
    python benchmarks/fem_neo_hookean.py --specimen rod.toml --gap-mm 60 --weight
    python benchmarks/fem_neo_hookean.py --seed 7 --shape tube

Each takes a minute or some. Q2 displacements and linear discontinuous pressure
(condensed in each element) on hexahedra: a mesh of the section (square, rectangular,
round or of a tube, with curved sides) drawn along the rod; root face fixed, banded
Cholesky. The energy is mu/2 (J^(-2/3) tr F^T F - 3) + K/2 (J - 1)^2, the weight rho g
per undeformed volume, and the magnetic one, which for a uniform Br is the traction
Br B / mu0 on the tip's face. Two meshes, the second of nearly half the size, started
from the solid model's own shape, on which the result does not depend; then Richardson's
extrapolation of fourth order, as two finer meshes of one case had it. mm, MPa, N.

Prints how far the models are from the axis, the mean of each cross-section. A seed
draws rod, field and weight (`solid_cases`).
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from fem_sections import GAUSS, WEIGHT, line, plane_slopes, section_mesh
from numba import njit
from scipy.interpolate import CubicSpline
from scipy.linalg import LinAlgError, solveh_banded
from scipy.sparse import diags, triu
from scipy.sparse.linalg import splu
from solid_cases import draw, write_case

from magbend.core.magnet import Magnet
from magbend.core.specimen_file import read_specimen
from magbend.core.units import MU0
from magbend.sim import (
    MagnetField,
    Support,
    UniformField,
    flux_mT,
    gmc,
    solve_spatial,
)
from magbend.sim.solid.space import largest_strain, solve_in_space

LEVELS = ((0.2, 1.1, 1), (0.11, 0.6, 2))
"""Of each mesh: first and largest length along the rod, in sides of the section, and
how fine the section is (`section_mesh`)."""


def graded(a, b, first, largest):
    """Return points from a to b, their spacing growing by 1.6 from `first`."""
    x, h = [a], first
    while x[-1] < b - 1e-12:
        x.append(x[-1] + h)
        h = min(1.6 * h, largest)
    return a + (np.array(x) - a) * (b - a) / (x[-1] - a)


LINE = np.array([line(x)[0] for x in GAUSS])
SLOPE = np.array([line(x)[1] for x in GAUSS])


@njit(cache=True)
def element(u, h, mu, K, N2, D2, W2, LINE, SLOPE, WEIGHT, Ke, Re):
    """Fill stiffness Ke (81, 81) and internal force Re (81,) of one element.

    u (27, 3): three layers of the section's nine nodes. N2, D2, W2 as `plane_slopes`.
    """
    dN, F, G = np.zeros((27, 27, 3)), np.zeros((27, 3, 3)), np.zeros((27, 3, 3))
    J, dJ, BJ, w = np.zeros(27), np.zeros((27, 81)), np.zeros((4, 81)), np.zeros(27)
    shapes = np.ones((27, 4))
    MM, d = np.zeros((4, 4)), np.zeros(4)
    for g2 in range(9):
        for g1 in range(3):
            g = 3 * g2 + g1
            w[g] = W2[g2] * WEIGHT[g1] * h / 2.0
            for k in range(3):
                for n in range(9):
                    dN[g, 9 * k + n, 0] = SLOPE[g1, k] * N2[g2, n] * 2.0 / h
                    dN[g, 9 * k + n, 1] = LINE[g1, k] * D2[g2, n, 0]
                    dN[g, 9 * k + n, 2] = LINE[g1, k] * D2[g2, n, 1]
            shapes[g, 1] = g1 - 1.0
            shapes[g, 2] = g2 // 3 - 1.0
            shapes[g, 3] = g2 % 3 - 1.0
            for i in range(3):
                for c in range(3):
                    F[g, i, c] = (i == c) + np.sum(u[:, i] * dN[g, :, c])
            J[g] = np.linalg.det(F[g])
            G[g] = np.linalg.inv(F[g]).T
            for a in range(27):
                for i in range(3):
                    dJ[g, 3 * a + i] = J[g] * np.sum(G[g, i] * dN[g, a])
            for q in range(4):
                d[q] += w[g] * shapes[g, q] * (J[g] - 1.0)
                BJ[q] += w[g] * shapes[g, q] * dJ[g]
                for r in range(4):
                    MM[q, r] += w[g] * shapes[g, q] * shapes[g, r]
    inverse = np.linalg.inv(MM)
    pressure = K * np.dot(inverse, d)
    Ke[:] = K * np.dot(BJ.T, np.dot(inverse, BJ))
    Re[:] = 0.0
    T, B = np.zeros((9, 81)), np.zeros((9, 81))
    C = np.zeros((9, 9))
    for g in range(27):
        f, q = F[g], G[g]
        I1 = np.sum(f * f)
        shear = mu * J[g] ** (-2.0 / 3.0)
        p = np.sum(pressure * shapes[g])
        for i in range(3):
            for j in range(3):
                for k in range(3):
                    for m in range(3):
                        v = -2.0 / 3.0 * (q[i, j] * f[k, m] + f[i, j] * q[k, m])
                        v += 2.0 / 9.0 * I1 * q[i, j] * q[k, m]
                        v += I1 / 3.0 * q[i, m] * q[k, j] + (i == k and j == m)
                        v *= shear
                        v += p * J[g] * (q[i, j] * q[k, m] - q[i, m] * q[k, j])
                        C[3 * i + j, 3 * k + m] = w[g] * v
        B[:] = 0.0
        for a in range(27):
            for i in range(3):
                stress = np.sum((f[i] - I1 / 3.0 * q[i]) * dN[g, a])
                Re[3 * a + i] += w[g] * (shear * stress + p * dJ[g, 3 * a + i])
                for c in range(3):
                    B[3 * i + c, 3 * a + i] = dN[g, a, c]
        T[:] = np.dot(C, B)
        Ke += np.dot(B.T, T)


@njit(cache=True)
def assemble(u, conn, hs, which, mu, K, N2, D2, W2, LINE, SLOPE, WEIGHT, AB, R):
    """Fill the lower band AB of the stiffness, and the internal force R."""
    Ke, Re, own = np.zeros((81, 81)), np.zeros(81), np.zeros((27, 3))
    AB[:] = 0.0
    R[:] = 0.0
    for e in range(conn.shape[0]):
        for a in range(27):
            own[a] = u[conn[e, a]]
        k = which[e]
        element(own, hs[e], mu[e], K[e], N2, D2[k], W2[k], LINE, SLOPE, WEIGHT, Ke, Re)
        for r in range(81):
            row = 3 * conn[e, r // 3] + r % 3
            R[row] += Re[r]
            for c in range(81):
                column = 3 * conn[e, c // 3] + c % 3
                if column <= row:
                    AB[row - column, column] += Ke[r, c]


class Beam:
    """One mesh of a rod of one section, and its displacements `u` (nodes, 3)."""

    def __init__(self, rod, nu, level):
        first, largest, fine = LEVELS[level]
        section = rod.cross_sections[0]
        a = min(section.width_mm, section.height_mm)
        joints = np.cumsum([0.0] + [part.length_mm for part in rod.sections])
        xs = np.zeros(1)
        for k, (left, right) in enumerate(pairwise(joints)):
            middle, last = (left + right) / 2, k + 2 == len(joints)
            near = first * a * (1 if k == 0 else 2)
            far = 0.4 * a if last else 2 * first * a
            ahead = graded(left, middle, near, largest * a)
            back = left + right - graded(left, middle, far, largest * a)[::-1]
            xs = np.concatenate([xs, ahead[1:], back[1:]])
        self.places, cells = section_mesh(section, fine)
        self.x = np.sort(np.r_[xs, (xs[1:] + xs[:-1]) / 2])
        n, layers = len(self.places), len(self.x)
        self.plane = plane_slopes(self.places, cells)
        conn = [
            np.concatenate([(2 * i + k) * n + cell for k in range(3)])
            for i in range(len(xs) - 1) for cell in cells
        ]  # fmt: skip
        self.conn = np.array(conn)
        self.which = np.tile(np.arange(len(cells)), len(xs) - 1)
        self.hs = np.repeat(np.diff(xs), len(cells))
        where = np.searchsorted(joints[1:], (xs[1:] + xs[:-1]) / 2)
        moduli = np.array([part.E_MPa for part in rod.sections])
        self.E, self.nu = np.repeat(moduli[where], len(cells)), nu
        self.X0 = np.column_stack(
            [np.repeat(self.x, n), np.tile(self.places, (layers, 1))]
        )
        self.band = 3 * 3 * n
        self.u = np.zeros_like(self.X0)
        N, _, W = self.plane
        self.face = np.zeros(n)
        np.add.at(self.face, cells, np.einsum("gn,eg->en", N, W))
        along = np.zeros(layers)
        for i, h in enumerate(np.diff(xs)):
            along[2 * i : 2 * i + 3] += h * np.array([1, 4, 1]) / 6
        self.volume = np.outer(along, self.face).ravel()

    def solve(self, traction, body):
        """Find the equilibrium under a traction on the tip face, and a body force.

        From a material that does not contract sideways, as the start does not, to
        stiffer and stiffer bulks: as far at once as Newton's method converges.
        """
        bulk, last = 1.0, 1.0 / (1.0 - 2.0 * self.nu)
        if not self._newton(traction, body, 0.0, 1e-2):
            raise RuntimeError("Newton's method did not converge")
        times = 3.5
        while bulk < last:
            kept, ahead = self.u.copy(), min(last, bulk * times)
            near = 1e-8 if ahead == last else 1e-2
            if self._newton(traction, body, (1.0 - 1.0 / ahead) / 2.0, near):
                bulk = ahead
                continue
            self.u, times = kept, times**0.5
            if times < 1.05:
                raise RuntimeError("Newton's method did not converge")

    def _newton(self, traction, body, nu, near):
        """Iterate Newton's method until a correction is below `near`; False if not.

        `traction` takes places (n, 3); how it changes with them is left out of the
        stiffness, which costs a few more iterations before a magnet.
        """
        n = len(self.places)
        AB, R = np.zeros((self.band, self.u.size)), np.zeros(self.u.size)
        load = np.zeros_like(self.u)
        mu, K = self.E / 2 / (1 + nu), self.E / 3 / (1 - 2 * nu)
        sizes = []
        while len(sizes) < 12 or sizes[-1] < 0.5 * sizes[-4]:
            load[:] = self.volume[:, None] * body
            load[-n:] += self.face[:, None] * traction((self.X0 + self.u)[-n:])
            assemble(
                self.u, self.conn, self.hs, self.which, mu, K, *self.plane,
                LINE, SLOPE, WEIGHT, AB, R,
            )  # fmt: skip
            if not np.isfinite(R).all():  # turned inside out somewhere
                return False
            r = (load.ravel() - R)[3 * n :]
            change = self._correction(AB[:, 3 * n :], r).reshape(-1, 3)
            self.u[n:] += change
            sizes.append(np.abs(change).max())
            if sizes[-1] < near:
                return True
        return False

    def _correction(self, AB, r):
        try:
            return solveh_banded(AB, r, lower=True, check_finite=False)
        except LinAlgError:  # indefinite far from the solution
            m = len(r)
            low = diags(
                [AB[k, : m - k] for k in range(self.band)],
                [-k for k in range(self.band)],
                format="csc",
            )
            return splu((low + triu(low.T, 1)).tocsc()).solve(r)

    def bend(self, shape):
        """Start from the cross-sections of a rod's shape in space."""
        s, x = shape.s_mm, self.X0[:, 0]
        r = CubicSpline(s, shape.r_mm)(x)
        d = CubicSpline(s, shape.directors)(x)
        self.u = r + np.einsum("nk,nki->ni", self.X0[:, 1:], d[:, :2]) - self.X0
        self.u[: len(self.places)] = 0.0

    def axis(self):
        """Return the mean of each layer of nodes, (layers, 3)."""
        placed = (self.X0 + self.u).reshape(len(self.x), -1, 3)
        return np.einsum("n,lni->li", self.face / self.face.sum(), placed)


def traction(rod, field):
    """Return the function from places (n, 3) in mm to Br B / mu0 in MPa."""

    def of(places):
        flux = flux_mT(field, places, length_mm=rod.length_mm)
        return rod.remanence_mT * flux * 1e-12 / MU0

    return of


def finite_elements(rod, field, support, nu, s_mm, levels=2, report=print):
    """Return the axis at `s_mm` by each mesh, and extrapolated: (levels + 1, n, 3)."""
    shape = solve_in_space(rod, field, support, nu, 601)
    body = (rod.density_kg_m3 or 0.0) * 1e-9 * np.array(support.gravity_m_s2)
    axes = []
    for level in range(levels):
        start = time.process_time()
        beam = Beam(rod, nu, level)
        beam.bend(shape)
        beam.solve(traction(rod, field), body)
        axes.append(CubicSpline(beam.x, beam.axis())(s_mm))
        report(
            f"mesh of {len(beam.x)} x {len(beam.places)} nodes: "
            f"{time.process_time() - start:.0f} s, tip "
            f"({', '.join(f'{v:.6f}' for v in axes[-1][-1])}) mm"
        )
    ratio = (LEVELS[levels - 2][0] / LEVELS[levels - 1][0]) ** 4
    axes.append(axes[-1] + (axes[-1] - axes[-2]) / (ratio - 1))
    return np.array(axes)


def arguments():
    """Return the command's rod, field, support, Poisson's ratio and other options."""
    parser = argparse.ArgumentParser(description="Solid model against finite elements")
    parser.add_argument("--gmc", type=int, help="rod of Table 1")
    parser.add_argument("--specimen", type=Path, help="specimen file")
    parser.add_argument("--seed", type=int, help="draw the case instead")
    parser.add_argument("--shape", help="its shape, if not that of the seed")
    parser.add_argument("--flux-mT", type=float)
    parser.add_argument("--angle-deg", type=float, default=90.0)
    parser.add_argument("--gap-mm", type=float, help="before the 55 mm cube instead")
    parser.add_argument(
        "--from-tip", action="store_true", help="magnetised to the root"
    )
    parser.add_argument("--weight", action="store_true", help="seen from above")
    parser.add_argument("--poisson", type=float, default=0.49)
    parser.add_argument("--out", type=Path, help="write axis and case beside fixtures")
    given = parser.parse_args()
    if given.seed is not None:
        return (*draw(given.seed, given.shape), given)
    rod = gmc(given.gmc) if given.gmc else read_specimen(given.specimen)
    if given.from_tip:
        rod = replace(rod, remanence_mT=-rod.remanence_mT)
    if given.gap_mm is None:
        field = UniformField(flux_mT=given.flux_mT, angle_deg=given.angle_deg)
    else:
        field = MagnetField(magnet=Magnet.cube(55.0, 1.305), gap_mm=given.gap_mm)
    if given.weight:
        rod = replace(rod, density_kg_m3=rod.density_kg_m3 or 2640.0)
    support = Support(gravity_m_s2=(0.0, 0.0, -9.80665 if given.weight else 0.0))
    return rod, field, support, given.poisson, given


def distance(found, axis, length_mm):
    """Return how far a model is: of the tip's deflection in %, and RMS in um."""
    deflection = np.linalg.norm(axis[-1] - [length_mm, 0.0, 0.0])
    miss = np.linalg.norm(found.r_mm - axis, axis=1)
    return miss[-1] / deflection * 100.0, np.sqrt(np.mean(miss**2)) * 1e3


def main() -> None:
    """Solve one case and print how far the models are."""
    rod, field, support, nu, given = arguments()
    solid = solve_in_space(rod, field, support, nu, 61)
    plain = solve_spatial(replace(rod, poisson_ratio=nu), field, support=support)
    strain = largest_strain(rod, support, solid)
    print(f"{rod}\n{field}\n{support.gravity_m_s2} m/s2, Poisson's ratio {nu}")
    axes = finite_elements(rod, field, support, nu, solid.s_mm)
    for name, found in (("rod", plain), ("solid", solid)):
        tip, rms = distance(found, axes[-1], rod.length_mm)
        print(f"{name}: tip off by {tip:.4f} % of its deflection, RMS {rms:.2f} um")
    tip, rms = distance(replace(solid, r_mm=axes[-2]), axes[-1], rod.length_mm)
    print(f"the finer mesh: {tip:.4f} %, RMS {rms:.2f} um; largest strain {strain:.3f}")
    if given.out:
        table = np.column_stack([solid.s_mm, axes[-1]])
        np.savetxt(
            given.out, table, "%.6f", delimiter=",", header="s_mm,x_mm,y_mm,z_mm",
            comments="",
        )  # fmt: skip
        write_case(given.out.with_suffix(".json"), given.seed, rod, field, support, nu)


if __name__ == "__main__":
    main()
