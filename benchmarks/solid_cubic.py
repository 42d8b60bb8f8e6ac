"""What bending both ways and twisting do together: to second order, from linear fields.

The third order of a least energy needs no more than the linear solution. In a frame
that turns with the section, F = I + G1 + (kappa x w) e_z, with w the warping and G1 the
linear slopes of displacement without the section's turn. Of the energy per length

    e = integral of sigma : (kappa x w) e_z + W3(G1),

W3 the third order of the neo-Hookean energy, only the product of bendings k_1, k_2 and
twist k_3 matters here: the others vanish by symmetry, and this one in squares and
circles too. Far from a face it vanishes unless one of the three varies along the rod;
near it, its integral is the energy of the face, whose derivatives are turns.

Sections turn by what the stress of bending, and of torsion, weighs (`_Quarter.turned`):
of second order nothing else then works against a stress that varies.
"""

from __future__ import annotations

import math
from itertools import permutations

import numpy as np
from skfem import (
    Basis,
    ElementHex2,
    ElementVector,
    FacetBasis,
    LinearForm,
    MeshHex,
    condense,
    solve,
)
from skfem.models.elasticity import lame_parameters, linear_elasticity
from solid_faces import dense

PULLS = (
    lambda v, at: at.x[1] * v[2],
    lambda v, at: -at.x[0] * v[2],
    lambda v, at: at.x[0] * v[1] - at.x[1] * v[0],
)
"""Tractions of the far end that bend about x, about y, and twist."""
HELD = (
    (("u^1",), ("u^1", "u^3")),
    (("u^2", "u^3"), ("u^2",)),
    (("u^2", "u^3"), ("u^1", "u^3")),
)
"""What of the displacement is odd at x = 0 and at y = 0, of each."""


def cubic_terms(ratio, nu):
    """Return (turn_mixed, varying) of a rectangle of area 1 and these sides.

    `turn_mixed` as in `SolidConstants`, but for what three turns do one after the other
    if they all happen at s = 0; `varying` is c in the energy E A c x_1 x_2 x_3' per
    length, which is taken out here by parts: as -c in `turn_mixed`, and in the shear
    of sections bent and twisted.
    """
    if ratio == 1.0:
        return 0.0, 0.0
    prism = _Quarter(ratio, nu)
    w, h = prism.w, prism.h
    bent = [prism.local(prism.pulled(axis), axis) for axis in range(2)]
    twisted = prism.local(prism.pulled(2), 2)
    varied = prism.local(prism.twisted_along(), 2, scale=1.0)
    face = prism.integral(prism.energy(*bent, twisted))
    turns = prism.turns_in_order((*bent, twisted))
    bulk = (prism.z > 1.1 * prism.big) & prism.near
    density = np.average(prism.energy(*bent, varied)[bulk], weights=prism.dz[bulk])
    varying = density * prism.GJ / (w * h)
    return (turns - face) - varying, varying


class _Quarter:
    """A quarter of a long prism with a fixed face, and its linear solutions."""

    def __init__(self, ratio, nu):
        self.w, self.h = math.sqrt(ratio), 1.0 / math.sqrt(ratio)
        self.big = max(self.w, self.h)
        halves = self.w / 2.0, self.h / 2.0
        x, y = (half - dense(4, half, 0.5)[::-1] for half in halves)
        far = np.linspace(0.75, 3.5, 6)[1:] * self.big
        z = np.concatenate([dense(6, 0.75 * self.big), far])
        mesh, kind = MeshHex.init_tensor(x, y, z), ElementVector(ElementHex2())
        self.basis = Basis(mesh, kind, intorder=4)
        end = mesh.facets_satisfying(lambda p: np.isclose(p[2], z[-1]))
        self.end = FacetBasis(mesh, kind, facets=end, intorder=5)
        self.mu, self.K = 1.0 / (2.0 * (1.0 + nu)), 1.0 / (3.0 * (1.0 - 2.0 * nu))
        form = linear_elasticity(*lame_parameters(1.0, nu))
        self.stiffness = form.assemble(self.basis)
        self.at = np.asarray(self.basis.global_coordinates()).reshape(3, -1)
        self.W = 4.0 * self.basis.dx.ravel()
        self.z, self.plane = np.unique(np.round(self.at[2], 9), return_inverse=True)
        self.dz = np.bincount(self.plane, self.W)
        self.near = self.z < 2.0 * self.big
        self.mid = int(np.argmin(np.abs(self.z - 1.9 * self.big)))
        self.tau = self._torsion_stress()

    def pulled(self, axis):
        """Return displacements (3, n) and slopes (3, 3, n) by moments of the end."""
        load = LinearForm(lambda v, at: PULLS[axis](v, at)).assemble(self.end)
        return self._solved(load, axis)

    def twisted_along(self):
        """The same by a torque of 1 per length, spread as the stress of torsion."""
        tx, ty = self.tau.reshape(2, *self.basis.dx.shape)
        push = LinearForm(lambda v, at: at.tx * v[0] + at.ty * v[1])
        return self._solved(push.assemble(self.basis, tx=tx, ty=ty), 2)

    def _solved(self, load, axis):
        fixed = [self.basis.get_dofs(lambda p: np.isclose(p[2], 0.0)).all()]
        for k, names in enumerate(HELD[axis]):
            plane = self.basis.get_dofs(lambda p, k=k: np.isclose(p[k], 0.0))
            fixed.append(plane.all(list(names)))
        held = np.unique(np.concatenate(fixed))
        u = self.basis.interpolate(solve(*condense(self.stiffness, load, D=held)))
        return np.asarray(u).reshape(3, -1), np.asarray(u.grad).reshape(3, 3, -1)

    def _torsion_stress(self):
        """Return shear stresses (2, n) of torsion by 1, far from the ends."""
        _, slopes = self.pulled(2)
        key = np.round(self.at[0], 9) + 1j * np.round(self.at[1], 9)
        far = np.flatnonzero(self.plane == self.mid)
        far = far[np.argsort(key[far])]
        same = far[np.searchsorted(key[far], key)]
        tau = self.mu * (slopes[:2, 2] + slopes[2, :2])[:, same]
        tau /= self._mean(tau[1] * self.at[0] - tau[0] * self.at[1])[self.mid]
        rate = self.turned(slopes[:, 2], 2, tau)[self.mid]
        stress = self.mu * (slopes[1, 2] + slopes[2, 1]) * self.at[0]
        stress -= self.mu * (slopes[0, 2] + slopes[2, 0]) * self.at[1]
        self.GJ = self._mean(stress)[self.mid] / rate
        return tau

    def _mean(self, values):
        """Return the mean over each section, whose area is 1."""
        return np.bincount(self.plane, self.W * values) / self.dz

    def turned(self, u, axis, tau):
        """Return how far displacements turn each section about an axis."""
        x, y, _ = self.at
        if axis == 2:
            return self._mean(tau[0] * u[0] + tau[1] * u[1])
        arm = y if axis == 0 else -x
        return self._mean(arm * u[2]) / self._mean(arm**2)

    def local(self, field, axis, scale=None):
        """Return curvature (3, n), warping, G1, its stress, turn and curvature by z.

        Of a curvature of 1 far from the face, or as it is with a `scale` of 1.
        """
        u, slopes = field
        turn = self.turned(u, axis, self.tau)
        curvature = self.turned(slopes[:, 2], axis, self.tau)
        unit = scale or curvature[self.mid]
        u, slopes, turn, curvature = (v / unit for v in (*field, turn, curvature))
        about, kappa = np.zeros((2, *u.shape))
        about[axis], kappa[axis] = turn[self.plane], curvature[self.plane]
        place = np.array([self.at[0], self.at[1], 0.0 * self.at[0]])
        warping = u - np.cross(about.T, place.T).T
        if axis < 2:
            warping[1 - axis] -= self._mean(u[1 - axis])[self.plane]
        G = slopes.copy()
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            G[i, j] += about[k]
            G[j, i] -= about[k]
        strain = 0.5 * (G + G.transpose(1, 0, 2))
        trace = np.trace(strain)
        stress = 2.0 * self.mu * strain
        stress[range(3), range(3)] += (self.K - 2.0 * self.mu / 3.0) * trace
        return kappa, warping, G, stress, turn, curvature

    def energy(self, *three):
        """Return the energy per length, by z, that is a product of three fields."""
        found = 0.0
        for a, b, c in permutations(three):
            push = np.cross(b[0].T, c[1].T).T
            found = found + np.einsum("in,in->n", a[3][:, 2], push)
        G = [field[2] for field in three]
        found = found + self._third(sum(G)) + sum(self._third(one) for one in G)
        found = found - sum(self._third(sum(G) - one) for one in G)
        return self._mean(found)

    def _third(self, G):
        """Return the third order of the neo-Hookean energy at F = I + G."""
        t, second = np.trace(G), np.einsum("ijn,jin->n", G, G)
        half = 0.5 * (t**2 - second)
        det = np.linalg.det(G.transpose(2, 0, 1))
        p1, p2 = -2.0 / 3.0 * t, -2.0 / 3.0 * half + 5.0 / 9.0 * t**2
        p3 = -2.0 / 3.0 * det + 10.0 / 9.0 * t * half - 40.0 / 81.0 * t**3
        shape = 3.0 * p3 + 2.0 * t * p2 + np.sum(G**2, axis=(0, 1)) * p1
        return 0.5 * self.mu * shape + self.K * t * half

    def integral(self, values):
        """Return the integral along z, of what vanishes far from the face."""
        return float(np.sum((values * self.dz)[self.near]))

    def turns_in_order(self, three):
        """Return the work of unit moments on turns that follow one another.

        Rotations do not commute: of curvatures 1 + d_i(z) that work is half of M_3
        times the integral of k_2 times the turn about 1 less k_1 times that about 2,
        and so on round; here without what grows with the length.
        """
        stiff = (self.w * self.h**3 / 12.0, self.h * self.w**3 / 12.0, self.GJ)
        work = 0.0
        for (a, b), c in zip(((1, 2), (2, 0), (0, 1)), stiff, strict=True):
            (turn_a, d_a), (turn_b, d_b) = (
                (three[i][4] - self.z, three[i][5] - 1.0) for i in (a, b)
            )
            within = d_b * turn_a - d_a * turn_b - 2.0 * self.z * (d_a - d_b)
            work += 0.5 * c * self.integral(within)
        return work
