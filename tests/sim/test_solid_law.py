"""The law of a solid's section, in the march of a rod in space."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.core.specimen import Section, Specimen
from magbend.sim import Cuboid, Support, Uniform
from magbend.sim.fields import as_field
from magbend.sim.scaling import field_array
from magbend.sim.spatial import law
from magbend.sim.spatial.march import BLOCK, STATE, Y, Z
from magbend.sim.spatial.newton import room, run, solve_rod
from magbend.sim.spatial.rod import SpatialRod, rod_table

ROD = Specimen(
    name="strip", shape="rectangle", width_mm=2.0, height_mm=1.2, remanence_mT=60.0,
    sections=(Section(length_mm=12.0, E_MPa=2.0), Section(length_mm=13.0, E_MPa=0.9)),
    density_kg_m3=2600.0,
)  # fmt: skip
MAGNET = Cuboid(sides_mm=30.0, remanence_T=1.3, centre_mm=(28.0, -45.0, 6.0))
FIELD = field_array(as_field(MAGNET), 25.0)


def table(*, strength: float = 1.0) -> np.ndarray:
    """Rows of a law with every term, exaggerated; strength 0: the plain rod."""
    support = Support(gravity_m_s2=(0.0, -3.0, -9.0))
    rod = rod_table(SpatialRod.from_specimen(ROD), support)
    wide = np.hstack([rod, np.zeros((len(rod), law.SOLID_WIDTH - rod.shape[1]))])
    for row in wide:
        row[law.T] = 4e-4 * strength + 1e-14
        row[[law.G1, law.G2]] = np.array([1.5e-3, 1.2e-3]) * strength
        row[[law.BEND, law.TWIST, law.STRETCH]] = np.array([3.0, 0.4, 2.0]) * strength
        row[law.R1 : law.R3 + 1] = row[law.T] / row[1:4]
        shape = np.array([0.04, 0.05, -0.02, 0.03, 0.01, 0.4, 0.3]) * strength
        row[law.P11 : law.S2 + 1] = shape * row[law.R1]
        row[law.BEND2] = 4.0 * strength
        row[[law.M1, law.M2]] = np.array([-2e-4, 3e-4]) * strength
        row[law.D], row[law.P33] = 0.1 * strength, -0.04 * strength * row[law.R3]
        row[law.A1 : law.B2 + 1] = (
            np.array([0.2, 0.1, 0.3, 0.4]) * strength * row[law.R1]
        )
        row[[law.FACE1, law.FACE2]] = np.array([0.03, 0.02]) * strength
    return wide


def marched(rod: np.ndarray, R: np.ndarray, r: np.ndarray) -> tuple:
    held = room(rod, FIELD, 40.0)
    run(rod, FIELD, 1.0, 40.0, R, r, True, np.inf, held)
    w = held[0][0]
    return w[Y : Y + STATE].copy(), w[Z : Z + BLOCK].reshape(12, 6).copy()


def pose() -> tuple[np.ndarray, np.ndarray]:
    turn = np.linalg.qr(np.array([[0.1, -0.3, 1.0], [1.0, 0.2, 0.1], [0.1, 1.0, 0.3]]))
    return turn[0] * np.sign(np.linalg.det(turn[0])), np.array([0.9, 0.2, -0.1])


def test_columns_are_the_derivatives_of_the_march() -> None:
    rod, (R, r) = table(), pose()
    _, columns = marched(rod, R, r)
    h = 1e-6
    for a in range(6):
        ends = []
        for sign in (1.0, -1.0):
            turned, moved = R.copy(), r.copy()
            if a < 3:
                x = np.zeros(3)
                x[a] = sign * h
                turned = R @ (np.eye(3) + np.cross(np.eye(3), x))
            else:
                moved[a - 3] += sign * h
            ends.append(marched(rod, turned, moved)[0])
        slope = (ends[0] - ends[1]) / (2.0 * h)
        assert slope[9:] == pytest.approx(columns[3:, a], rel=1e-6, abs=1e-6)


def test_without_its_terms_the_law_is_the_plain_rods() -> None:
    clamp = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    poses, s = [], np.linspace(0.0, 1.0, 5)
    rods = table(strength=0.0), table(strength=0.0)[:, :13].copy(), table()
    for rod in rods:
        R, r, states = np.empty((3, 3)), np.empty(3), np.empty((5, 21))
        assert solve_rod(rod, FIELD, 25.0, clamp, R, r, s, states)[0] == 0
        poses.append(np.append(R, r))
    assert np.abs(poses[0] - poses[1]).max() < 1e-9
    assert np.abs(poses[2] - poses[1]).max() > 1e-4


def test_strains_are_derivatives_of_one_energy() -> None:
    """So that no work is lost: their matrix is symmetric, and is their derivative."""
    row = table()[0]
    y = np.zeros(STATE)
    y[:9] = np.eye(3).ravel()
    y[9:12], y[15:] = (0.8, -1.1, 0.6), (4.0, -7.0, 9.0)
    v, H = np.empty(6), np.empty((7, 6))
    law.strains(row, y, v, H)
    assert H[6, :3] == pytest.approx(y[15:])
    h = 1e-5
    numeric = np.empty((6, 6))
    for k, at in enumerate((9, 10, 11, 15, 16, 17)):
        sides = []
        for sign in (1.0, -1.0):
            moved, there = y.copy(), np.empty(6)
            moved[at] += sign * h
            law.strains(row, moved, there, np.empty((7, 6)))
            sides.append(there)
        numeric[:, k] = (sides[0] - sides[1]) / (2.0 * h)
    assert numeric == pytest.approx(H[:6], abs=1e-8)
    assert pytest.approx(H[:6].T, abs=1e-12) == H[:6]


def test_a_face_in_a_uniform_field_feels_a_mere_force() -> None:
    field = field_array(
        as_field(Uniform(flux_mT=20.0, angle_deg=60.0, elevation_deg=30.0)), 25.0
    )
    y, none, (R, r) = np.zeros(STATE), np.zeros((12, 0)), pose()
    y[:9], y[12:15] = R.ravel(), r
    law.face_load(field, 7.0, table()[0], y, none, np.zeros(12))
    assert y[9:12] == pytest.approx(np.zeros(3), abs=1e-15)
    assert y[15:] == pytest.approx(7.0 * field[1:4])
