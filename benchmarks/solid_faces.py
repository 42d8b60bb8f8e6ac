"""What a fixed face does to a prism, to first order: linear finite elements.

Hexahedra of a quarter of a rectangular prism, or the first harmonic of a round one.
Those of rectangles are scaled so that the square has what converged elements give it
(`square_end`). Sizes: of a rectangle area 1, of a circle diameter 1.
"""

from __future__ import annotations

import math

import numpy as np
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


def gauss(count, low, high):
    """Return points and weights of Gauss on an interval."""
    x, w = np.polynomial.legendre.leggauss(count)
    return low + (x + 1.0) / 2.0 * (high - low), w / 2.0 * (high - low)


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


def round_end(bore, nu):
    """Return (turn, shift) of a fixed face of a round prism: its first harmonic."""
    if bore:
        half = dense(7, (0.5 - bore / 2.0) / 2.0)
        r = np.concatenate([bore / 2.0 + half, 0.5 - half[-2::-1]])
    else:
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
    if not bore:
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
    places, weights = gauss(6, bore / 2.0, 0.5)
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
        found = round_end(math.sqrt(place), nu) if nu else (0.0, 0.0)
        return (*found, 0.0)
    twist = rectangle_end(max(place, 1.0 / place), nu, twisted=True)
    if nu == 0.0:
        return 0.0, 0.0, twist
    own, one = (rectangle_end(r, nu, twisted=False) for r in (place, 1.0))
    scales = np.array(square_end(nu)) / one
    return (*(own * scales), twist)
