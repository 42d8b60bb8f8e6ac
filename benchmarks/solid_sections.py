"""Compute `sim/solid/sections.csv`: what shape and Poisson's ratio make of a section.

    python benchmarks/solid_sections.py --out sections.csv [--family round]

Takes half an hour in all. Two problems of each section:

* Its law. A prism in uniform bending, torsion and tension keeps its shape along itself,
  at any strain, so that one section tells all: polynomials for its warping, Newton's
  method for the least neo-Hookean energy mu/2 (J^(-2/3) tr F^T F - 3) + K/2 (J - 1)^2,
  moments from the stress. The constants fit curvature over moment to strains of 0.2.
* Its fixed face, by linear finite elements (scikit-fem): hexahedra of a quarter of a
  rectangular prism, or the first harmonic of a round one. Those of rectangles are
  scaled so that the square has what converged elements give it (`square_end`).
"""

from __future__ import annotations

import argparse
import csv
import math
import sys

import numpy as np
from numpy.polynomial import legendre
from skfem import (
    Basis,
    BilinearForm,
    ElementHex2,
    ElementQuad2,
    ElementVector,
    FacetBasis,
    LinearForm,
    MeshHex,
    MeshQuad,
    condense,
    solve,
)
from skfem.models.elasticity import lame_parameters, linear_elasticity

POISSON = (0.0, 0.1, 0.2, 0.3, 0.4, 0.45, 0.49)
RATIOS = tuple(np.exp(math.log(4.0) * np.cos(math.pi * np.arange(7) / 6.0)))
"""Sides of rectangles, width over height: Chebyshev's points of their logarithm."""
STRAINS = (0.1, 0.2, 0.3, 0.4)
"""Curvatures times sizes to which the law is fitted."""
NAMES = ("soften", "stiff", "cross_bending", "cross_torsion", "tension_torsion",
         "twisted_shear", "bow", "turn", "shift", "twist_turn")  # fmt: skip


def gauss(count, low, high):
    """Return points and weights of Gauss on an interval."""
    x, w = np.polynomial.legendre.leggauss(count)
    return low + (x + 1.0) / 2.0 * (high - low), w / 2.0 * (high - low)


def legendres(x, count):
    """Return Legendre's polynomials (count, n) and their slopes."""
    rows = np.eye(count)
    return (
        np.array([legendre.legval(x, row) for row in rows]),
        np.array([legendre.legval(x, legendre.legder(row)) for row in rows]),
    )


class Section:
    """A section of area A with functions for its warping: values, slopes (n, k)."""

    def __init__(self, family, place, nu):
        self.mu, self.K = 1.0 / (2.0 * (1.0 + nu)), 1.0 / (3.0 * (1.0 - 2.0 * nu))
        if family == "rectangle":
            self.w, self.h = math.sqrt(place), 1.0 / math.sqrt(place)
            functions = self._rectangle(10)
        else:
            self.w = self.h = 1.0
            functions = self._round()
        self.A = self.W.sum()
        self.I = np.array([self.W @ self.Y**2, self.W @ self.X**2])
        f = np.array(functions)
        f[:, 0] -= (f[:, 0] @ self.W / self.A)[:, None]
        self.value, self.dx, self.dy = f[:, 0].T, f[:, 1].T, f[:, 2].T
        n = len(f)
        # No turn of the section as a whole, in the mean; the last two are shears.
        C = np.zeros((3, 3 * n + 2))
        mx, my = f[:, 0] @ (self.W * self.X), f[:, 0] @ (self.W * self.Y)
        C[0, 2 * n : 3 * n], C[1, 2 * n : 3 * n] = mx, my
        C[2, n : 2 * n], C[2, :n] = mx, -my
        self.free = np.linalg.svd(C)[2][3:].T

    def _rectangle(self, count):
        (x, wx), (y, wy) = gauss(14, -1, 1), gauss(14, -1, 1)
        X, Y = (v.ravel() for v in np.meshgrid(x, y, indexing="ij"))
        self.W = np.outer(wx, wy).ravel() * self.w * self.h / 4.0
        self.X, self.Y = X * self.w / 2.0, Y * self.h / 2.0
        (a, da), (b, db) = legendres(X, count), legendres(Y, count)
        return [
            (a[i] * b[j], da[i] * b[j] * 2.0 / self.w, a[i] * db[j] * 2.0 / self.h)
            for i in range(count) for j in range(count - i) if i + j
        ]  # fmt: skip

    def _round(self):
        (r, wr), many = gauss(14, 0.0, 0.5), 56
        turn = 2.0 * math.pi * np.arange(many) / many
        R, T = (v.ravel() for v in np.meshgrid(r, turn, indexing="ij"))
        self.W = np.repeat(wr * r, many) * 2.0 * math.pi / many
        self.X, self.Y = R * np.cos(T), R * np.sin(T)
        (a, da), (b, db) = (legendres(2.0 * v, 10) for v in (self.X, self.Y))
        return [
            (a[i] * b[j], 2.0 * da[i] * b[j], 2.0 * a[i] * db[j])
            for i in range(10) for j in range(10 - i) if i + j
        ]  # fmt: skip

    def stretched(self, strain):
        """Return F (3, 3, n) without warping and dF by the free unknowns (9 n, k)."""
        (k1, k2, k3, e), v = strain, self.value
        n = v.shape[1]
        D = np.zeros((3, 3, len(self.X), 3 * n + 2))
        parts = [slice(i * n, (i + 1) * n) for i in range(3)]
        for i, part in enumerate(parts):
            D[i, 0, :, part], D[i, 1, :, part] = self.dx, self.dy
        turns = (
            (0, 2, k2),
            (0, 1, -k3),
            (1, 0, k3),
            (1, 2, -k1),
            (2, 1, k1),
            (2, 0, -k2),
        )
        for i, j, k in turns:
            D[i, 2, :, parts[j]] += k * v
        D[0, 2, :, -2], D[1, 2, :, -1] = 1.0, 1.0
        F = np.zeros((3, 3, len(self.X)))
        F[0, 0] = F[1, 1] = 1.0
        F[0, 2], F[1, 2] = -k3 * self.Y, k3 * self.X
        F[2, 2] = 1.0 + e + k1 * self.Y - k2 * self.X
        return F, D.reshape(9 * len(self.X), -1) @ self.free

    def resultants(self, strain, z):
        """Return moments, tension and warping of least energy, started from `z`."""
        F0, D = self.stretched(strain)
        n = len(self.X)
        z = np.zeros(D.shape[1]) if z is None else z
        for _ in range(40):
            P, C = self._stress(F0 + (D @ z).reshape(3, 3, n))
            CD = np.einsum(
                "abn,bnz->anz", C * self.W, D.reshape(9, n, -1), optimize=True
            )
            change = -np.linalg.solve(
                D.T @ CD.reshape(9 * n, -1), D.T @ (P * self.W).ravel()
            )
            while np.abs(D @ change).max() > 0.3:
                change *= 0.5
            z = z + change
            if np.abs(change).max() < 1e-10:
                break
        else:
            raise RuntimeError("Newton's method did not converge")
        P, _ = self._stress(F0 + (D @ z).reshape(3, 3, n))
        u = (self.free @ z)[:-2].reshape(3, -1) @ self.value.T
        at = np.array([self.X + u[0], self.Y + u[1], u[2]])
        push = P[:, 2]
        return np.cross(at.T, push.T).T @ self.W, push[2] @ self.W, z

    def _stress(self, F):
        mu, K, one = self.mu, self.K, np.eye(3)
        T = F.transpose(2, 0, 1)
        J, G = np.linalg.det(T), np.linalg.inv(T).transpose(2, 1, 0)
        I1, m = (F**2).sum((0, 1)), mu * J ** (-2.0 / 3.0)
        GG = np.einsum("ijn,kln->ijkln", G, G)
        crossed = np.einsum("iln,kjn->ijkln", G, G)
        FG = np.einsum("ijn,kln->ijkln", F, G)
        GF = np.einsum("ijn,kln->ijkln", G, F)
        C = m * (
            -2.0 / 3.0 * (FG + GF) + 2.0 / 9.0 * I1 * GG + I1 / 3.0 * crossed
            + np.einsum("ik,jl->ijkl", one, one)[..., None]
        )  # fmt: skip
        C += K * J * ((2.0 * J - 1.0) * GG - (J - 1.0) * crossed)
        return m * (F - I1 / 3.0 * G) + K * (J - 1.0) * J * G, C.reshape(9, 9, -1)


def law(family, place, nu):
    """Return soften, stiff, cross_bending, cross_torsion, tension_torsion,
    twisted_shear, bow.

    Of bending about d2, the section's x running along d1.
    """
    section = Section(family, place, nu)
    scale = np.array([section.h, section.w, math.sqrt(section.w * section.h)])
    GJ = section.resultants((0.0, 0.0, 1e-4, 0.0), None)[0][2] / 1e-4
    stiffness = np.append(section.I, GJ)
    inertia = stiffness / section.A / scale**2

    def states(direction, sizes, tension=0.0):
        """Return linear strains and curvatures times scale, (n, 3) each; stretch."""
        rows, z = [], None
        for size in sizes:
            k, e = np.array(direction) * size, tension + 0.1 * size**2
            for _ in range(12):
                M, N, z = section.resultants((*(k / scale), e), z)
                e += tension - N / section.A
                if abs(tension - N / section.A) < 1e-10:
                    break
            rows.append((M / stiffness * scale, k, np.full(3, e)))
        return np.array(rows).transpose(1, 0, 2)

    def pure(axis):
        x, k, e = (v[:, axis] for v in states(np.eye(3)[axis], STRAINS))
        soften, sixth = np.linalg.lstsq(
            np.stack([x**0, x**2], 1), (k / x - 1.0) / x**2, rcond=None
        )[0]
        # What tension does to a fibre is known: e = alpha i x^2 / 2 + b x^4 / 4.
        alpha = (14.0 + 28.0 * nu - 40.0 * nu**2) / 9.0 + 2.0 * nu
        rest = e / x**2 - alpha * inertia[axis] / 2.0
        bow = 4.0 * (rest @ x**2) / (x**2 @ x**2)
        return soften, np.cbrt(sixth * inertia[axis]), bow

    (soften1, stiff1, _), (soften2, stiff2, bow) = pure(0), pure(1)
    half = math.sqrt(0.5)
    x, k, _ = states((half, half, 0.0), STRAINS)
    g = (stiff1 * x[1, 0] ** 2 + stiff2 * x[1, 1] ** 2) ** 2
    bends = [
        (k[1, a] / x[1, a] - 1.0 - own * x[1, a] ** 2) * inertia[a] - s * g
        for a, own, s in ((0, soften1, stiff1), (1, soften2, stiff2))
    ]
    cross_bending = 0.5 * (bends[0] / x[1, 1] ** 2 + bends[1] / x[1, 0] ** 2)
    t, kt, _ = states((0.0, 0.0, 1.0), STRAINS[:1])
    own = (kt[0, 2] / t[0, 2] - 1.0) / t[0, 2] ** 2
    x, k, _ = states((0.0, half, half), STRAINS)
    twist = k[1, 2] / x[1, 2] - 1.0 - own * x[1, 2] ** 2
    ends = [states((0.0, 0.0, 1.0), (0.02,), n) for n in (0.01, -0.01)]
    twists = [k[0, 2] / x[0, 2] for x, k, _ in ends]
    return (
        soften2, stiff2, cross_bending, twist * inertia[2] / x[1, 1] ** 2,
        (twists[0] - twists[1]) / 0.02, _twisted_shear(section, stiffness, scale), bow,
    )  # fmt: skip


def _twisted_shear(section, stiffness, scale):
    """Return the shear along d1 of a section bent about d2 and twisted, per x_2 x_3."""
    k = np.array([0.0, 0.02, 0.02])
    M, _, z = section.resultants((*(k / scale), 0.0), None)
    x = M / stiffness * scale
    return (section.free @ z)[-1] / (x[1] * x[2])


def dense(pieces, size, ratio=0.45):
    """Places from 0 to size, densest at 0."""
    steps = ratio ** np.arange(pieces)[::-1]
    return size * np.concatenate([[0.0], np.cumsum(steps)]) / np.sum(steps)


def rectangle_end(ratio, nu, *, twisted):
    """Return (turn, shift) of a fixed face of a prism, or its turn in torsion.

    A quarter of it, pulled by -x (twisted) at the far end; over its sizes.
    """
    w, h = math.sqrt(ratio), 1.0 / math.sqrt(ratio)
    big = max(w, h)
    x, y = (side / 2.0 - dense(5, side / 2.0)[::-1] for side in (w, h))
    z = np.concatenate([dense(8, 0.75 * big), np.linspace(0.75, 3.5, 6)[1:] * big])
    mesh, kind = MeshHex.init_tensor(x, y, z), ElementVector(ElementHex2())
    basis = Basis(mesh, kind, intorder=4)
    far = mesh.facets_satisfying(lambda p: np.isclose(p[2], z[-1]))

    @LinearForm
    def pull(v, at):
        return at.x[0] * v[1] - at.x[1] * v[0] if twisted else -at.x[0] * v[2]

    load = pull.assemble(FacetBasis(mesh, kind, facets=far, intorder=5))
    held = [("u^2", "u^3"), ("u^1", "u^3")] if twisted else [("u^2", "u^3"), ("u^2",)]
    fixed = [basis.get_dofs(lambda p: np.isclose(p[2], 0.0)).all()]
    for axis, names in enumerate(held):
        plane = basis.get_dofs(lambda p, axis=axis: np.isclose(p[axis], 0.0))
        fixed.append(plane.all(list(names)))
    stiffness = linear_elasticity(*lame_parameters(1.0, nu)).assemble(basis)
    u = solve(*condense(stiffness, load, D=np.unique(np.concatenate(fixed))))
    s = np.linspace(1.5, 2.5, 5) * big if twisted else np.linspace(2.0, 3.2, 5) * big
    line = np.vstack([s * 0.0 + 1e-9, s * 0.0 + (h / 4.0 if twisted else 1e-9), s])
    moved = (basis.probes(line) @ u)[:5]
    if twisted:
        rate, turn = np.polyfit(s, -moved / (h / 4.0), 1)
        return -turn / rate / math.sqrt(w * h)
    turn, shift = np.polyfit(s, moved - s**2 / 2.0, 1)
    return -turn / w, (shift + nu * (w**2 - h**2) / 24.0) / w**2


def round_end(nu):
    """Return (turn, shift) of a fixed face of a round prism: its first harmonic."""
    r = 0.5 - dense(10, 0.5)[::-1]
    z = np.concatenate([dense(11, 0.75, 0.5), np.linspace(0.75, 3.5, 14)[1:]])
    mesh, kind = MeshQuad.init_tensor(r, z), ElementVector(ElementQuad2(), 3)
    basis = Basis(mesh, kind, intorder=5)
    lam, mu = lame_parameters(1.0, nu)

    def strains(u, r):
        g = u.grad
        return (g[0, 0], (u[0] + u[1]) / r, g[2, 1], g[1, 0] - (u[0] + u[1]) / r,
                g[0, 1] + g[2, 0], g[1, 1] - u[2] / r)  # fmt: skip

    @BilinearForm
    def energy(u, v, at):
        e, d = strains(u, at.x[0]), strains(v, at.x[0])
        bulk = lam * sum(e[:3]) * sum(d[:3])
        normal = 2.0 * mu * sum(a * b for a, b in zip(e[:3], d[:3], strict=True))
        shear = mu * sum(a * b for a, b in zip(e[3:], d[3:], strict=True))
        return at.x[0] * (bulk + normal + shear)

    @LinearForm
    def pull(v, at):
        return -(at.x[0] ** 2) * v[2]

    far = mesh.facets_satisfying(lambda p: np.isclose(p[1], z[-1]))
    load = pull.assemble(FacetBasis(mesh, kind, facets=far, intorder=5))
    matrix = energy.assemble(basis).tolil()
    fixed = [basis.get_dofs(lambda p: np.isclose(p[1], 0.0)).all()]
    axis = basis.get_dofs(lambda p: np.isclose(p[0], 0.0))
    fixed.append(axis.all(["u^3"]))
    for i, j in zip(axis.all(["u^1"]), axis.all(["u^2"]), strict=True):
        for a, b in ((i, i), (j, j), (i, j), (j, i)):
            matrix[a, b] += 1e6  # u = -v on the axis
    u = solve(*condense(matrix.tocsr(), load, D=np.unique(np.concatenate(fixed))))
    plain = Basis(mesh, ElementQuad2(), intorder=5)
    sideways = np.zeros(plain.N)
    for dofs in ("nodal_dofs", "facet_dofs", "interior_dofs"):
        own = getattr(basis, dofs)
        sideways[getattr(plain, dofs)[0]] = 0.5 * (u[own[0]] - u[own[1]])
    places, weights = gauss(6, 0.0, 0.5)
    weights = weights * places / (weights @ places)
    s = np.linspace(2.0, 3.2, 5)
    moved = [
        plain.probes(np.vstack([places, places * 0 + z])) @ sideways @ weights
        for z in s
    ]
    turn, shift = np.polyfit(s, moved - s**2 / 2.0, 1)
    return -turn, shift


def square_end(nu):
    """Return (turn, shift) of a square: fits to Q2/P-1 hexahedra graded to 0.01 a.

    Eleven ratios from 0 to 0.499, to 0.03 % and 0.6 %.
    """
    return (
        nu**2 * (0.23629 + nu * (0.04322 + nu * (-0.09383 + nu * 0.29469))),
        nu * (0.008882 + nu * (0.026715 - nu * 0.003997)),
    )


def end(family, place, nu):
    """Return turn, shift and twist_turn of a fixed face."""
    if family != "rectangle":
        return (*(round_end(nu) if nu else (0.0, 0.0)), 0.0)
    twist = rectangle_end(max(place, 1.0 / place), nu, twisted=True)
    if nu == 0.0:
        return 0.0, 0.0, twist
    own, one = (rectangle_end(r, nu, twisted=False) for r in (place, 1.0))
    scales = np.array(square_end(nu)) / one
    return (*(own * scales), twist)


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser(description="Constants of the solid model")
    parser.add_argument("--out", required=True)
    parser.add_argument("--family", choices=("rectangle", "round"))
    given = parser.parse_args()
    places = {"rectangle": RATIOS[::-1], "round": (0.0,)}
    with open(given.out, "w", newline="") as file:  # noqa: PTH123
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("family", "place", "poisson_ratio", *NAMES))
        for family in [given.family] if given.family else places:
            for place in places[family]:
                for nu in POISSON:
                    values = (*law(family, place, nu), *end(family, place, nu))
                    at = math.log(place) if family == "rectangle" else place
                    row = [f"{at:.9g}", f"{nu:g}", *(f"{v:.5g}" for v in values)]
                    writer.writerow((family, *row))
                    print(family, *row, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
