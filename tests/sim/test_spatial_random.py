"""Rods in space that nobody chose, against shooting from the clamp.

The oracle integrates the distributed equations with scipy from the clamp to the tip:
unit quaternions, torque M x B and force grad(M . B) with its own field of a cuboid and
differences of it, six unknowns (force and moment at the clamp) by Newton's method with
differences, followed from no load to full load. It has nothing of the solver's: no pole
load, no tip pose, no variational columns, no closed-form gradient.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from magbend.core.errors import InputError
from magbend.core.magnet import Magnet
from magbend.core.units import MU0
from magbend.sim import PULLED_IN, MagnetField, Support
from magbend.sim.magnet.field import magnet_flux_mT
from magbend.sim.spatial.solver import SpatialRod, SpatialSection, solve_spatial

ORACLE_MM = 1e-8
"""What the oracle's own tolerances leave."""
MOST_CALLS = 100_000
RTOL = 1e-11
STENCIL = np.array([-2.0, -1.0, 1.0, 2.0])
WEIGHTS = np.array([1.0, -8.0, 8.0, -1.0]) / 12.0


class Gone(Exception):
    """The oracle finds no equilibrium connected to the unloaded rod."""


def cuboid_T(magnet: Magnet, centre_mm: np.ndarray, points_mm: np.ndarray):
    """Return B in T of a cuboid with charged end faces (n, 3)."""
    axes = np.array(magnet.axes())
    at = (points_mm - centre_mm) @ axes.T
    total = np.zeros_like(at)
    for i in (-1.0, 1.0):
        for j in (-1.0, 1.0):
            for k in (-1.0, 1.0):
                u, v, w = (
                    at[..., n] + sign * magnet.sides_mm[n] / 2.0
                    for n, sign in enumerate((i, j, k))
                )
                r = np.sqrt(u * u + v * v + w * w)
                sign = -i * j * k
                total[..., 0] -= sign * _log_sum(r, v, u * u + w * w)
                total[..., 1] -= sign * _log_sum(r, u, v * v + w * w)
                total[..., 2] += sign * np.arctan2(u * v, w * r)
    return magnet.remanence_T / (4.0 * math.pi) * total @ axes


def _log_sum(r, v, rest):
    """Return ln(r + v) without cancellation."""
    return np.where(v > 0.0, np.log(r + np.abs(v)), np.log(rest / (r + np.abs(v))))


class Oracle:
    """A case in units of the rod's length L and EI / L^2 of its first section."""

    def __init__(self, rod: SpatialRod, field, support: Support) -> None:
        self.rod, self.field, self.support = rod, field, support
        self.L = rod.length_mm
        self.calls = 0
        self.unit_N = rod.sections[0].stiffness_Nmm2[1] / self.L**2
        half = math.radians(support.clamp_angle_deg) / 2.0
        # d1 = y, d2 = z, d3 = x at the clamp: a third of a turn about (1, 1, 1).
        self.q0 = _times(
            np.array([math.cos(half), 0.0, 0.0, math.sin(half)]),
            np.array([0.5, 0.5, 0.5, 0.5]),
        )
        if isinstance(field, MagnetField):
            self.centre = np.array(
                field.magnet.centre_mm(length_mm=self.L, gap_mm=field.gap_mm)
            )

    def flux(self, r, mu):
        """Return B (T) at r (n, 3), and grad(mu . B) times L."""
        if not isinstance(self.field, MagnetField):
            return np.broadcast_to(np.array(self.field) * 1e-3, r.shape), 0.0 * r
        step = 0.0005
        probes = r[:, None] + np.concatenate(
            [np.zeros((1, 3)), *(step * STENCIL[:, None] * e for e in np.eye(3))]
        )
        B = cuboid_T(self.field.magnet, self.centre, probes * self.L)
        energy = np.einsum("npk,nk->np", B[:, 1:], mu).reshape(-1, 3, 4)
        return B[:, 0], energy @ WEIGHTS / step

    def slope(self, s, y, part, load):
        self.calls += 1
        if self.calls > MOST_CALLS:  # at the magnet's edges, where B is infinite
            raise Gone
        y = y.reshape(13, -1)
        r, q, m, n = y[:3].T, y[3:7].T, y[7:10].T, y[10:].T
        d = _directors(q)
        stiff = np.array(part.stiffness_Nmm2) / (self.unit_N * self.L**2)
        rest = np.array(part.rest_curvature_per_mm) * self.L
        k = np.einsum("nai,ni->na", d, m) / stiff + rest
        spin = np.zeros_like(q)
        spin[:, 1:] = k
        area = part.area_mm2
        # A B_r / mu0 in A m; times T is N.
        moment = area * np.array(part.remanence_mT) * 1e-9 / MU0 / self.unit_N
        mu = load * self.support.load_factor * np.einsum("a,nai->ni", moment, d)
        B, pull = self.flux(r, mu)
        weight = self.rod.density_kg_m3 * area * self.L * 1e-9 / self.unit_N
        weight = load * weight * np.array(self.support.gravity_m_s2)
        return np.concatenate(
            [
                d[:, 2].T, 0.5 * _times(q, spin).T,
                -(np.cross(d[:, 2], n) + np.cross(mu, B)).T, -(pull + weight).T,
            ]
        ).ravel()  # fmt: skip

    def shoot(self, unknowns, load, at=None):
        """Return the state at the tip for columns of unknowns (6, n), and at `at`."""
        n = unknowns.shape[1]
        y = np.zeros((13, n))
        y[3:7] = self.q0[:, None]
        y[7:] = unknowns
        s, parts = 0.0, []
        for part in self.rod.sections:
            end = s + part.length_mm / self.L
            inner = [] if at is None else at[(at >= s) & (at < end - 1e-12)]
            out = solve_ivp(
                self.slope, (s, end), y.ravel(), args=(part, load), method="DOP853",
                rtol=RTOL, atol=1e-3 * RTOL, t_eval=[*inner, end],
            )  # fmt: skip
            if out.status != 0:
                raise Gone
            parts.append(out.y[:, :-1])
            y, s = out.y[:, -1].reshape(13, n), end
        return y, np.column_stack([*parts, y]) if at is not None else None

    def newton(self, x, load):
        """Return the unknowns that leave the tip free, or None."""
        before = 0.2 * (1.0 + np.abs(x).max())  # further away may be another branch
        for _ in range(12):
            step = 1e-6 * (1.0 + np.abs(x).max())
            columns = np.column_stack([x, x[:, None] + step * np.eye(6)])
            ends = self.shoot(columns, load)[0][7:]
            change = np.linalg.solve((ends[:, 1:] - ends[:, :1]) / step, -ends[:, 0])
            size = np.abs(change).max()
            if not size < before:
                return x if size < 1e-7 else None
            x, before = x + change, size
            if size < 1e-9:
                return x
        return None

    def solve(self, at):
        """Follow the equilibrium to full load; return states (13, n) at `at`."""
        x = old = np.zeros(6)
        load, jump, gone = 0.0, 0.1, 0.0
        while load < 1.0:
            jump = min(jump, 1.0 - load)
            guess = x if load == 0.0 else x + (x - old) * jump / gone
            found = self.newton(guess, load + jump)
            if found is not None:
                old, x, gone, load = x, found, jump, load + jump
                jump *= 1.5
                continue
            jump *= 0.5
            if jump < 1e-3:
                raise Gone
        return x, self.shoot(x[:, None], 1.0, at)[1]


def _times(a, b):
    """Return the product of quaternions (real part first)."""
    p, u, q, v = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    real = p * q - np.sum(u * v, axis=-1, keepdims=True)
    return np.concatenate([real, p * v + q * u + np.cross(u, v)], axis=-1)


def _directors(q):
    """Return the rotated axes as rows, (n, 3, 3)."""
    w, u = q[..., :1, None], q[..., None, 1:]
    e = np.eye(3)
    t = 2.0 * np.cross(u, e)
    return e + w * t + np.cross(u, t)


def draw(seed: int):
    """Return a rod, a field and a support."""
    rng = np.random.default_rng(seed)
    sections = tuple(
        SpatialSection(
            length_mm=rng.uniform(3.0, 12.0), E_MPa=rng.uniform(5.0, 40.0),
            width_mm=rng.uniform(0.5, 1.6), height_mm=rng.uniform(0.5, 1.6),
            round_section=rng.random() < 0.25, poisson_ratio=rng.uniform(0.2, 0.5),
            remanence_mT=(*rng.normal(0.0, 10.0, 2), rng.uniform(-40.0, 40.0)),
            rest_curvature_per_mm=rng.normal(0.0, 0.03, 3) * (rng.random() < 0.7),
        )
        for _ in range(rng.integers(1, 5))
    )  # fmt: skip
    rod = SpatialRod(sections=sections, density_kg_m3=rng.uniform(1000.0, 4000.0))
    support = Support(
        clamp_angle_deg=rng.uniform(-180.0, 180.0),
        gravity_m_s2=rng.normal(0.0, 9.0, 3), load_factor=rng.uniform(0.3, 1.5),
    )  # fmt: skip
    if rng.random() < 0.25:
        return rod, tuple(rng.normal(0.0, 60.0, 3)), support
    magnet = Magnet(
        sides_mm=np.full(3, rng.uniform(15.0, 60.0)),
        remanence_T=rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.45),
        axis_angle_deg=rng.uniform(-180.0, 180.0),
        elevation_deg=rng.uniform(-90.0, 90.0), offset_mm=rng.uniform(-15.0, 15.0, 3),
    )  # fmt: skip
    return rod, MagnetField(magnet=magnet, gap_mm=rng.uniform(8.0, 80.0)), support


def clearance_mm(oracle: Oracle, points_mm: np.ndarray) -> float:
    """Return the least distance of points from the magnet, below zero inside."""
    if not isinstance(oracle.field, MagnetField):
        return math.inf
    magnet = oracle.field.magnet
    at = (points_mm - oracle.centre) @ np.array(magnet.axes()).T
    beyond = np.abs(at) - np.array(magnet.sides_mm) / 2.0
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return np.where(outside > 0.0, outside, beyond.max(axis=1)).min()


def check(seed: int) -> None:
    """Compare one case, or the finding that the rod touches the magnet or is gone."""
    rod, field, support = draw(seed)
    oracle = Oracle(rod, field, support)
    at = np.linspace(0.0, 1.0, 61)
    margin = 0.5 * max(min(part.width_mm, part.height_mm) for part in rod.sections)
    try:
        space = solve_spatial(rod, field, support=support)
    except InputError as error:
        if "gap_mm must leave" not in str(error):
            raise
        rest = oracle.shoot(np.zeros((6, 1)), 0.0, at)[1][:3].T * oracle.L
        assert clearance_mm(oracle, rest) < margin + 0.1
        return
    try:
        unknowns, states = oracle.solve(at)
    except Gone:
        assert space.status == PULLED_IN
        return
    position = states[:3].T * oracle.L
    if space.status == PULLED_IN:
        assert clearance_mm(oracle, position) < margin + 0.1
        return
    miss_mm = np.linalg.norm(position - space.r_mm, axis=1).max()
    assert miss_mm < space.error_mm + ORACLE_MM
    assert _directors(states[3:7].T) == pytest.approx(space.directors, abs=1e-8)
    moment = unknowns[:3] * oracle.unit_N * oracle.L * 1e-3
    assert moment == pytest.approx(space.root_moment_Nm, rel=1e-7, abs=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_random_rods_agree_with_shooting(seed: int) -> None:
    check(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 300))
def test_more_random_rods_agree_with_shooting(seed: int) -> None:
    check(seed)


def test_the_field_of_the_oracle_is_that_of_the_magnet() -> None:
    rng = np.random.default_rng(0)
    magnet = Magnet(
        sides_mm=(20.0, 30.0, 40.0), remanence_T=1.3, axis_angle_deg=33.0,
        elevation_deg=20.0, offset_mm=(1.0, 2.0, 3.0),
    )  # fmt: skip
    pose = {"length_mm": 30.0, "gap_mm": 20.0}
    points = rng.normal(0.0, 60.0, (20, 3)) + np.array([100.0, 0.0, 0.0])
    ours = cuboid_T(magnet, np.array(magnet.centre_mm(**pose)), points) * 1e3
    assert ours == pytest.approx(magnet_flux_mT(magnet, points, **pose), abs=1e-11)
