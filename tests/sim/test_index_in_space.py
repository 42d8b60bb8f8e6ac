"""The Morse index in space, against the second differences of a discretised energy.

Nothing of the march: directors at nodes, turned by small vectors; curvature from the
turn between neighbours, the place by the trapezoidal rule.
"""

from __future__ import annotations

import numpy as np
import pytest

from magbend.sim import Support, UniformField, find_equilibria, gmc, solve_spatial
from magbend.sim.scaling import field_array
from magbend.sim.spatial.index import morse_index
from magbend.sim.spatial.march import AXIAL, C1, C3, K1, K3, MU1, MU2, WX, WZ, H
from magbend.sim.spatial.rod import SpatialRod, SpatialSection, rod_table

NODES = 24
"""Elements of the rod, a multiple of its sections."""
STEP = 1e-3


def turned(Q: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Turn directors (columns), shape (n, 3, 3), by body vectors (..., n, 3)."""
    angle = np.linalg.norm(x, axis=-1)[..., None, None]
    X = -np.cross(np.eye(3), x[..., None, :])
    first, second = np.sinc(angle / np.pi), 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    return Q @ (np.eye(3) + first * X + second * (X @ X))


def energy(table: np.ndarray, flux_T: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Return the energy of directors (..., n + 1, 3, 3), root first."""
    ends = np.cumsum(table[::-1, H])
    middle = (np.arange(NODES) + 0.5) / NODES
    rows, h = table[::-1][np.searchsorted(ends, middle)], 1.0 / NODES
    turn = np.swapaxes(Q[..., :-1, :, :], -1, -2) @ Q[..., 1:, :, :]
    skew = turn - np.swapaxes(turn, -1, -2)
    curved = np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], -1)
    strain = 0.5 * curved / h - rows[:, K1 : K3 + 1]
    mean = 0.5 * (Q[..., :-1, :, :] + Q[..., 1:, :, :])
    place = np.cumsum(h * mean[..., 2], axis=-2) - 0.5 * h * mean[..., 2]
    moment = np.einsum("...nij,nj->...ni", mean, rows[:, [MU1, MU2, AXIAL]])
    density = 0.5 * np.sum(strain**2 / rows[:, C1 : C3 + 1], axis=-1)
    density -= moment @ flux_T + np.sum(rows[:, WX : WZ + 1] * place, axis=-1)
    return h * density.sum(axis=-1)


def least(table: np.ndarray, flux_T: np.ndarray, Q: np.ndarray) -> tuple[int, float]:
    """Return the negative eigenvalues of the energy's Hessian, and the least size."""
    n = 3 * NODES
    a, b = np.triu_indices(n)
    values = np.zeros(len(a))
    for i, j in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
        x = np.zeros((len(a), n + 3))
        np.add.at(x, (np.arange(len(a)), a + 3), i * STEP)
        np.add.at(x, (np.arange(len(a)), b + 3), j * STEP)
        values += (
            i * j * energy(table, flux_T, turned(Q, x.reshape(len(a), NODES + 1, 3)))
        )
    hessian = np.zeros((n, n))
    hessian[a, b] = hessian[b, a] = values / (4.0 * STEP**2)
    eigenvalues = np.linalg.eigvalsh(hessian) * NODES
    return int(np.sum(eigenvalues < 0.0)), float(np.abs(eigenvalues).min())


def test_index_of_rods_from_no_load() -> None:
    """Tilted, curved and heavy ones; others straight against their field."""
    rng = np.random.default_rng(3)
    indices = []
    for k in range(16):
        straight = k % 2 == 0
        across = (0.0, 0.0) if straight else tuple(rng.normal(0.0, 20.0, 2))
        sections = tuple(
            SpatialSection(
                length_mm=15.0, E_MPa=rng.uniform(5.0, 20.0), width_mm=1.0,
                height_mm=(1.0, 0.8)[k % 4 // 2],
                remanence_mT=(*across, rng.uniform(30.0, 60.0)),
                rest_curvature_per_mm=(0.0, 0.0 if straight else 0.02, 0.0),
            )
            for _ in range(2)
        )  # fmt: skip
        rod = SpatialRod(sections=sections, density_kg_m3=2000.0)
        support = Support(gravity_m_s2=(0.0, 0.0, 0.0 if straight else -9.8))
        size = 10.0 ** rng.uniform(1.3, 2.9) if straight else 60.0
        flux_mT = size * (
            np.array([-1.0, 0.0, 0.0]) if straight else rng.normal(size=3)
        )
        found = solve_spatial(rod, flux_mT, support=support, points=NODES + 1)
        Q = np.swapaxes(found.directors, -1, -2)
        index, size = least(rod_table(rod, support), flux_mT * 1e-3, Q)
        if size > 0.1:  # nearer to zero the two discretisations may differ
            assert found.morse_index == index
            indices.append(index)
    assert len(indices) > 12
    assert {0, 2, 3} <= set(indices)


@pytest.mark.parametrize("number", [2, 6])
def test_index_of_all_shapes_of_a_planar_rod(number: int) -> None:
    """Unstable in the plane, out of it, and in both."""
    rod, field = gmc(number), UniformField(flux_mT=1500.0, angle_deg=160.0)
    spatial, indices = SpatialRod.from_specimen(rod), []
    table = rod_table(spatial, Support())
    flux = field_array(field, rod.length_mm)
    for one in find_equilibria(rod, field, points=NODES + 1):
        turns = [
            np.array([[-s, 0.0, c], [c, 0.0, s], [0.0, 1.0, 0.0]])
            for c, s in zip(
                np.cos(one.centreline.theta_rad),
                np.sin(one.centreline.theta_rad),
                strict=True,
            )
        ]
        r = np.append(one.centreline.points_mm[-1] / rod.length_mm, 0.0)
        ours = morse_index(table, flux, 1.0, 80.0, turns[-1], r)
        index, size = least(table, flux[1:4], np.array(turns))
        if size > 0.1:
            assert ours == index
            indices.append((one.morse_index, index))
    assert len(set(indices)) > 2
    assert all(space >= plane for plane, space in indices)
