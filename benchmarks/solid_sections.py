"""Compute `sim/solid/sections.csv`: what shape and Poisson's ratio make of a section.

    python benchmarks/solid_sections.py --out sections.csv [--family round]

Takes half an hour in all. Two problems of each section:

* Its law. A prism in uniform bending, torsion and tension keeps its shape along itself,
  at any strain, so that one section tells all: polynomials for its warping, Newton's
  method for the least neo-Hookean energy mu/2 (J^(-2/3) tr F^T F - 3) + K/2 (J - 1)^2,
  moments from the stress. The constants fit curvature over moment to strains of 0.2.
* Its fixed face, by linear finite elements of it (`solid_faces`), and what their
  solution tells of the second order, which rectangles have (`solid_cubic`).
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre
from solid_cubic import cubic_terms
from solid_faces import end, gauss

BORES2 = tuple(0.18 * (1.0 - np.cos(math.pi * np.arange(5) / 4.0)))
"""Squares of bores of tubes over their diameter, to 0.6: Chebyshev's points."""
POISSON = (0.0, 0.1, 0.2, 0.3, 0.4, 0.45, 0.49)
RATIOS = tuple(np.exp(math.log(4.0) * np.cos(math.pi * np.arange(7) / 6.0)))
"""Sides of rectangles, width over height: Chebyshev's points of their logarithm."""
STRAINS = (0.1, 0.2, 0.3, 0.4)
"""Curvatures times sizes to which the law is fitted."""
NAMES = ("soften", "stiff", "cross_bending", "cross_torsion", "tension_torsion",
         "twisted_shear", "bow", "turn", "shift", "twist_turn",
         "soften_twist", "turn_cubed", "turn_mixed")  # fmt: skip


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
            functions = self._round(math.sqrt(place))
        self.A = self.W.sum()
        self.I = np.array([self.W @ self.Y**2, self.W @ self.X**2])
        f = np.array(functions)
        f[:, 0] -= (f[:, 0] @ self.W / self.A)[:, None]
        self.value, self.dx, self.dy = f[:, 0].T, f[:, 1].T, f[:, 2].T
        self.free = self._turnless(-self.Y, self.X)
        F0, D = self.stretched((0.0, 0.0, 1e-4))
        _, z = self.resultants((0.0, 0.0, 1e-4), 0.0, None)
        P, _ = self._stress(F0 + (D @ z).reshape(3, 3, -1))
        self.free = self._turnless(P[0, 2], P[1, 2])

    def _turnless(self, x, y):
        """Return the warpings, and two shears, that do not turn the section.

        Neither about its axes, weighed by the stress of bending, nor about the rod's,
        weighed by (x, y), that of torsion: what keeps a section from turning then
        pushes as a torsion that varies along the rod does, as it does where a rod of
        unequal sides is bent both ways.
        """
        f, n = self.value.T, self.value.shape[1]
        C = np.zeros((3, 3 * n + 2))
        C[0, 2 * n : 3 * n], C[1, 2 * n : 3 * n] = (
            f @ (self.W * self.X),
            f @ (self.W * self.Y),
        )
        C[2, :n], C[2, n : 2 * n] = f @ (self.W * x), f @ (self.W * y)
        C /= np.linalg.norm(C, axis=1)[:, None]
        return np.linalg.svd(C)[2][3:].T

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

    def _round(self, bore):
        (r, wr), many = gauss(10 if bore else 14, bore / 2.0, 0.5), 28 if bore else 56
        turn = 2.0 * math.pi * np.arange(many) / many
        R, T = (v.ravel() for v in np.meshgrid(r, turn, indexing="ij"))
        self.W = np.repeat(wr * r, many) * 2.0 * math.pi / many
        self.X, self.Y = R * np.cos(T), R * np.sin(T)
        if bore:
            return self._ring(R, T, bore, radial=7, waves=6)
        (a, da), (b, db) = (legendres(2.0 * v, 10) for v in (self.X, self.Y))
        return [
            (a[i] * b[j], 2.0 * da[i] * b[j], 2.0 * a[i] * db[j])
            for i in range(10) for j in range(10 - i) if i + j
        ]  # fmt: skip

    def _ring(self, R, T, bore, *, radial, waves):
        """Return Legendre's polynomials of the radius times harmonics."""
        scale = 4.0 / (1.0 - bore)
        q, dq = legendres(scale * (R - bore / 2.0) - 1.0, radial)
        found = []
        for k in range(waves):
            own = [(np.cos(k * T), -k * np.sin(k * T))]
            own += [(np.sin(k * T), k * np.cos(k * T))] if k else []
            for j in range(radial):
                for c, dc in own if k + j else []:
                    across, around = scale * dq[j] * c, q[j] * dc / R**2
                    found.append(
                        (q[j] * c, across * self.X / R - around * self.Y,
                         across * self.Y / R + around * self.X)
                    )  # fmt: skip
        return found

    def stretched(self, bent):
        """Return F (3, 3, n) of curvatures alone and dF by the unknowns (9 n, k).

        The last unknown is the stretch.
        """
        (k1, k2, k3), v = bent, self.value
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
        F[2, 2] = 1.0 + k1 * self.Y - k2 * self.X
        stretch = np.zeros_like(F)
        stretch[2, 2] = 1.0
        D = D.reshape(9 * len(self.X), -1) @ self.free
        return F, np.column_stack([D, stretch.ravel()])

    def resultants(self, bent, tension, z):
        """Return moments, and warping and stretch of least energy, started from `z`."""
        F0, D = self.stretched(bent)
        n = len(self.X)
        z = np.zeros(D.shape[1]) if z is None else z
        pull = np.append(np.zeros(len(z) - 1), tension)
        for _ in range(40):
            P, C = self._stress(F0 + (D @ z).reshape(3, 3, n))
            CD = np.einsum(
                "abn,bnz->anz", C * self.W, D.reshape(9, n, -1), optimize=True
            )
            change = -np.linalg.solve(
                D.T @ CD.reshape(9 * n, -1), D.T @ (P * self.W).ravel() - pull
            )
            while np.abs(D @ change).max() > 0.3:
                change *= 0.5
            z = z + change
            if np.abs(change).max() < 1e-10:
                break
        else:
            raise RuntimeError("Newton's method did not converge")
        P, _ = self._stress(F0 + (D @ z).reshape(3, 3, n))
        u = (self.free @ z[:-1])[:-2].reshape(3, -1) @ self.value.T
        at = np.array([self.X + u[0], self.Y + u[1], u[2]])
        return np.cross(at.T, P[:, 2].T).T @ self.W, z

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
    twisted_shear, bow and soften_twist.

    Of bending about d2, the section's x running along d1.
    """
    section = Section(family, place, nu)
    scale = np.array([section.h, section.w, math.sqrt(section.w * section.h)])
    GJ = section.resultants((0.0, 0.0, 1e-4), 0.0, None)[0][2] / 1e-4
    stiffness = np.append(section.I, GJ)
    inertia = stiffness / section.A / scale**2

    def states(direction, sizes, tension=0.0):
        """Return linear strains and curvatures times scale, (n, 3) each; stretch."""
        rows, z = [], None
        for size in sizes:
            k = np.array(direction) * size
            M, z = section.resultants(k / scale, tension * section.A, z)
            rows.append((M / stiffness * scale, k, np.full(3, z[-1])))
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
        own,
    )  # fmt: skip


def _twisted_shear(section, stiffness, scale):
    """Return the shear along d1 of a section bent about d2 and twisted, per x_2 x_3."""
    k = np.array([0.0, 0.02, 0.02])
    M, z = section.resultants(k / scale, 0.0, None)
    x = M / stiffness * scale
    return (section.free @ z[:-1])[-1] / (x[1] * x[2])


@lru_cache
def circle_softens(nu):
    """Return the softening of a circle."""
    return law("round", 0.0, nu)[0]


def cubed(family, soften, nu):
    """Return the increase of a fixed face's turn per cube of x.

    Fits neo-Hookean finite elements of a dozen rods at strains of 0.1 to 0.2, and of
    five tubes at 0.16, of bores 0.25 to 0.6: a face that cannot become oval keeps from
    softening what lies within its reach, which is the farther the softer it is.
    """
    if family == "rectangle":
        return 0.022 + 0.048 * nu
    own = soften**2 - circle_softens(nu) ** 2
    return 0.0195 + (0.85 - 0.28 * nu) * own


def constants(family, place, nu):
    """Return the values of a row, as `NAMES`."""
    *bulk, shear, bow, own = law(family, place, nu)
    mixed, varying = cubic_terms(place, nu) if family == "rectangle" else (0.0, 0.0)
    shear -= 12.0 * varying * math.sqrt(place)
    return (
        *bulk, shear, bow, *end(family, place, nu), own, cubed(family, bulk[0], nu),
        mixed,
    )  # fmt: skip


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser(description="Constants of the solid model")
    parser.add_argument("--out", required=True)
    parser.add_argument("--family", choices=("rectangle", "round"))
    given = parser.parse_args()
    places = {"rectangle": RATIOS[::-1], "round": BORES2}
    with open(given.out, "w", newline="") as file:  # noqa: PTH123
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("family", "place", "poisson_ratio", *NAMES))
        for family in [given.family] if given.family else places:
            for place in places[family]:
                for nu in POISSON:
                    values = constants(family, place, nu)
                    at = math.log(place) if family == "rectangle" else place
                    row = [f"{at:.9g}", f"{nu:g}", *(f"{v:.5g}" for v in values)]
                    writer.writerow((family, *row))
                    print(family, *row, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
