"""Attracted rods, whose tips near the magnet, are followed to an answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from magbend.core.magnet import Magnet
from magbend.sim import (
    Coil,
    Field,
    MagnetField,
    Rod,
    Section,
    Support,
    UniformField,
    sensitivities,
    solve,
    solve_many,
    solve_spatial,
    solve_spatial_many,
    verify,
)
from magbend.sim.batch import OUTCOMES
from magbend.sim.check.space import check_spatial


def attracted(gap_mm: float) -> tuple[Rod, MagnetField]:
    rod = Rod(
        name="attracted", side_mm=0.8, remanence_mT=-110.0,
        sections=(Section(length_mm=55.0, E_MPa=12.0),),
    )  # fmt: skip
    return rod, MagnetField(magnet=Magnet.cube(55.0, 1.305), gap_mm=gap_mm)


@pytest.mark.parametrize("gap_mm", [44.0, 44.5, 45.0])
def test_the_plane_finds_what_space_finds(gap_mm: float) -> None:
    rod, field = attracted(gap_mm)
    found = solve(rod, field)
    assert found.status == "stable"
    space = solve_spatial(rod, field)
    np.testing.assert_allclose(space.r_mm[-1, :2], found.centreline.tip_mm, atol=1e-5)
    assert found.error_mm < 1e-6
    assert verify(rod, field, found, degree=24) < 1e-4


@pytest.mark.parametrize("gap_mm", [42.5, 43.0])
def test_a_pulled_in_rod_ends_at_the_same_fold_in_plane_and_space(
    gap_mm: float,
) -> None:
    rod, field = attracted(gap_mm)
    plane, space = solve(rod, field), solve_spatial(rod, field)
    assert plane.status == space.status == "pulled in: no equilibrium"
    assert plane.load_limit == pytest.approx(space.load_limit, abs=1e-4)


def designs(n: int, times: float) -> dict[str, np.ndarray]:
    rng = np.random.default_rng([7, int(times)])
    return {
        "length_mm": rng.dirichlet([2.0, 2.0, 2.0], n)
        * rng.uniform(20.0, 45.0, (n, 1)),
        "E_MPa": rng.uniform(3.0, 20.0, (n, 3)),
        "side_mm": rng.uniform(0.75, 1.3, n),
        "remanence_mT": rng.choice([-1.0, 1.0], n) * times * rng.uniform(14.0, 26.0, n),
        "gap_mm": rng.uniform(30.0, 120.0, n),
    }


@pytest.mark.parametrize("times", [5.0, 20.0])
def test_no_random_rod_is_given_up(times: float) -> None:
    for source in (
        Magnet.cube(55.0, 1.305),
        Field(Coil(diameter_mm=80.0, current_A=100.0, turns=100)),
    ):
        found = solve_many(designs(200, times), magnet=source)
        assert not np.any(found["outcome"] == OUTCOMES.index("not solved"))
        assert not np.any(found["outcome"] == OUTCOMES.index("unstable"))


def test_a_rod_drawn_into_a_strong_coil_is_followed_all_the_way() -> None:
    # At the end its tip is in 70 boundary layers' length from the clamp: the angle of
    # the tip from its load is 1e-31.
    rod = Rod(
        name="strong", side_mm=1.2, remanence_mT=-405.0,
        sections=(
            Section(length_mm=20.0, E_MPa=5.0), Section(length_mm=37.0, E_MPa=3.5),
        ),
    )  # fmt: skip
    field = Field(Coil(diameter_mm=80.0, current_A=100.0, turns=500, gap_mm=55.0))
    found = solve(rod, field)
    assert found.status == "stable"
    assert found.error_mm < 1e-7
    assert verify(rod, field, found, degree=40) < 1e-9
    slope = sensitivities(rod, field, parameters=["E_MPa[0]"]).dy_mm[:, 0]
    up, down = (
        solve(
            replace(rod, sections=(replace(rod.sections[0], E_MPa=E), rod.sections[1])),
            field,
        ).centreline.y_mm
        for E in (5.0001, 4.9999)
    )
    np.testing.assert_allclose(slope, (up - down) / 2e-4, atol=1e-6)


def test_no_rod_of_both_signs_is_given_up() -> None:
    rods = designs(60, 20.0)
    signs = np.random.default_rng(8).choice([-1.0, 1.0], (60, 3))
    rods["remanence_mT"] = rods["remanence_mT"][:, None] * signs
    source = Field(Coil(diameter_mm=80.0, current_A=100.0, turns=300))
    found = solve_many(rods, magnet=source)
    assert set(found["outcome"]) <= {0, OUTCOMES.index("pulled in: no equilibrium")}


@pytest.mark.parametrize("signs", [(1, -1, -1), (-1, 1, -1)])
def test_a_rod_whose_tip_does_not_fix_its_root_is_solved_in_pieces(
    signs: tuple[int, int, int],
) -> None:
    parts = zip(signs, (12.0, 25.0, 15.0), (9.0, 6.0, 4.0), strict=True)
    rod = Rod(
        name="both signs", side_mm=1.0, remanence_mT=1.0,
        sections=tuple(
            Section(length_mm=mm, E_MPa=MPa, remanence_mT=600.0 * sign)
            for sign, mm, MPa in parts
        ),
    )  # fmt: skip
    field = UniformField(flux_mT=300.0, angle_deg=110.0)
    found = solve(rod, field)
    assert found.status == "stable"
    assert found.error_mm < 1e-6
    assert verify(rod, field, found, degree=40) < 1e-6


DRAWN = {
    "its root moves 1e8 times as far as its tip": {
        "length_mm": [19.6568, 21.6154], "E_MPa": [7.9129, 11.1231],
        "side_mm": 0.8021, "remanence_mT": [-375.9423, -199.6885],
        "remanence_y_mT": [127.8791, 10.2841], "remanence_z_mT": [97.9562, -105.8727],
        "natural_curvature_per_mm": 0.0193, "density_kg_m3": 2080.25, "gap_mm": 40.3859,
    },
    "its root moves 2e7 times as far": {
        "length_mm": [21.8728, 20.6303], "E_MPa": [6.5479, 16.9262],
        "side_mm": 1.1041, "remanence_mT": [-377.6723, -416.8757],
        "natural_curvature_per_mm": 0.0161, "density_kg_m3": 1258.05, "gap_mm": 41.021,
    },
    "rough steps find another index": {
        "length_mm": [19.9554, 14.6916], "E_MPa": [29.7489, 8.6788],
        "side_mm": 1.231, "remanence_mT": [157.3408, -461.6304],
        "natural_curvature_per_mm": 0.0145, "density_kg_m3": 2229.57, "gap_mm": 35.263,
    },
}  # fmt: skip
OFF_ITS_PLANE = Magnet.cube(55.0, 1.305, elevation_deg=20.0, offset_mm=(5.0, 0.0, 8.0))
HELD = Support(gravity_m_s2=(1.0, -2.0, -9.5), clamp_angle_deg=15.0)


def drawn(name: str) -> tuple[Rod, MagnetField]:
    one = DRAWN[name]
    along_y, along_z = (one.get(f"remanence_{axis}_mT", [0.0, 0.0]) for axis in "yz")
    rod = Rod(
        name=name, side_mm=one["side_mm"], remanence_mT=0.0,
        density_kg_m3=one["density_kg_m3"],
        natural_curvature_per_mm=one["natural_curvature_per_mm"],
        sections=tuple(
            Section(
                length_mm=mm, E_MPa=MPa, remanence_mT=mT, remanence_y_mT=y,
                remanence_z_mT=z,
            )
            for mm, MPa, mT, y, z in zip(
                one["length_mm"], one["E_MPa"], one["remanence_mT"], along_y, along_z,
                strict=True,
            )
        ),
    )  # fmt: skip
    return rod, MagnetField(magnet=OFF_ITS_PLANE, gap_mm=one["gap_mm"])


# The first takes 40 s of CPU alone and as long in a batch.
FIRST, *OTHERS = DRAWN
NAMES = [pytest.param(FIRST, marks=pytest.mark.slow), *OTHERS]


@pytest.mark.parametrize("name", NAMES)
def test_a_rod_drawn_out_of_its_plane_is_followed_all_the_way(name: str) -> None:
    rod, field = drawn(name)
    check = check_spatial(rod, field, support=HELD)
    assert (check.load, check.morse_index) == (1.0, 0)
    found = solve_spatial(rod, field, support=HELD)
    assert found.status == "stable"
    assert np.abs(check.at(found.s_mm) - found.r_mm).max() < found.error_mm < 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_a_batch_follows_such_a_rod_too(name: str) -> None:
    check = check_spatial(*drawn(name), support=HELD)
    columns = {key: [value] for key, value in DRAWN[name].items()}
    (row,) = solve_spatial_many(columns, magnet=OFF_ITS_PLANE, support=HELD)
    assert (row["outcome"], row["morse_index"]) == (0, 0)
    tip = [row[f"tip_{axis}_mm"] for axis in "xyz"]
    assert np.abs(np.subtract(tip, check.tip_mm)).max() < row["error_mm"] < 1e-2
