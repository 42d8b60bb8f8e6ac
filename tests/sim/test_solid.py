"""The solid model against three-dimensional finite elements."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from magbend.core.cross_section import CrossSection
from magbend.core.errors import InputError
from magbend.core.magnet import Magnet
from magbend.core.specimen import Section, Specimen
from magbend.sim import MagnetField, Support, UniformField, gmc
from magbend.sim.one_rod import solve
from magbend.sim.solid.constants import joint_share, solid_constants
from magbend.sim.solid.solver import solve_solid

FEM = Path(__file__).parents[2] / "fixtures" / "fem"
SQUARE = CrossSection(shape="square", width_mm=1.0, height_mm=1.0)
FILES = sorted(path.name for path in FEM.glob("*rod*.csv"))


def case(name: str):
    number = int(re.search(r"rod(\d)", name)[1])
    if "gap" in name:
        gap_mm = float(re.search(r"gap(\d+)", name)[1])
        sign = -1.0 if "minus" in name else 1.0
        rod = gmc(number)
        rod = replace(rod, remanence_mT=sign * rod.remanence_mT)
        return rod, MagnetField(magnet=Magnet.cube(55.0, 1.305), gap_mm=gap_mm)
    flux, angle = re.search(r"B(\d+)_a(\d+)", name).groups()
    return gmc(number), UniformField(flux_mT=float(flux), angle_deg=float(angle))


@pytest.mark.parametrize("name", FILES)
def test_finite_elements_are_met(name: str) -> None:
    """Tip deflection within 0.03 % and centreline within 0.5 um RMS."""
    fem = np.loadtxt(FEM / name, delimiter=",", skiprows=1)
    rod, field = case(name)
    solution = solve_solid(rod, field)
    miss = solution.centreline.points_mm - fem[:, 1:]
    tip = np.hypot(solution.centreline.tip_mm[0] - 30.0, solution.centreline.tip_mm[1])
    deflection = np.hypot(fem[-1, 1] - 30.0, fem[-1, 2])
    assert abs(tip / deflection - 1.0) < 1e-4
    assert np.sqrt(np.mean(np.sum(miss**2, axis=1))) < 0.2e-3
    assert solution.status == "stable"


def test_there_are_shapes_to_meet() -> None:
    assert len(FILES) >= 15


@pytest.mark.parametrize("name", ["fem_rod2_B50_a90.csv", "own_rod7_B50_a170.csv"])
def test_the_plain_rod_is_softer_by_what_was_reported(name: str) -> None:
    fem = np.loadtxt(FEM / name, delimiter=",", skiprows=1)
    rod, field = case(name)
    x, y = solve(rod, field).centreline.tip_mm
    ratio = np.hypot(x - 30.0, y) / np.hypot(fem[-1, 1] - 30.0, fem[-1, 2])
    assert 1.0033 < ratio < 1.0062


def test_constants_are_those_of_the_probe() -> None:
    """Base turns of an independent probe: 0.0644, 0.0531, 0.0223, 0."""
    for nu, turn in ((0.49, 0.0644), (0.45, 0.0531), (0.3, 0.0223), (0.0, 0.0)):
        assert solid_constants(SQUARE, nu).turn[1] == pytest.approx(turn, abs=4e-4)


def test_base_turn_rises_with_poisson_ratio() -> None:
    ratios = np.linspace(0.0, 0.5, 101)
    turns = [solid_constants(SQUARE, nu).turn[1] for nu in ratios]
    assert np.all(np.diff(turns) > 0.0)


def test_joint_between_rigid_and_equal() -> None:
    assert joint_share(0.0) == 1.0
    assert joint_share(1.0) == 0.0


def test_slender_rod_becomes_the_plain_rod() -> None:
    """All corrections vanish with the thickness over the length."""
    field = UniformField(flux_mT=50.0)
    ratios = []
    for thin in (1.0, 0.25):
        rod = Specimen(
            name="slender", side_mm=thin, remanence_mT=20.0 * thin**2,
            sections=(Section(length_mm=30.0, E_MPa=10.0),),
        )  # fmt: skip
        plain = solve(rod, field).centreline.tip_mm[1]
        ratios.append(abs(solve_solid(rod, field).centreline.tip_mm[1] / plain - 1.0))
    assert ratios[1] < 0.3 * ratios[0]
    assert ratios[0] < 1e-2


def test_error_bounds_what_a_finer_march_changes() -> None:
    rod, field = gmc(3), UniformField(flux_mT=120.0, angle_deg=150.0)
    solution = solve_solid(rod, field)
    split = replace(
        rod,
        sections=tuple(
            replace(part, length_mm=part.length_mm / 4.0)
            for part in rod.sections
            for _ in range(4)
        ),
    )
    fine = solve_solid(split, field)
    miss = np.abs(solution.centreline.points_mm - fine.centreline.points_mm).max()
    assert miss < solution.error_mm + fine.error_mm + 1e-10


@settings(max_examples=25, deadline=None)
@given(
    flux=st.floats(1.0, 150.0),
    angle=st.floats(-180.0, 180.0),
    turn=st.floats(-90.0, 90.0),
)
def test_turning_the_bench_turns_the_shape(
    flux: float, angle: float, turn: float
) -> None:
    rod = gmc(2)
    one = solve_solid(rod, UniformField(flux_mT=flux, angle_deg=angle))
    two = solve_solid(
        rod,
        UniformField(flux_mT=flux, angle_deg=angle + turn),
        support=Support(clamp_angle_deg=turn),
    )
    z = (one.centreline.x_mm + 1j * one.centreline.y_mm) * np.exp(1j * np.radians(turn))
    assert np.abs(z - (two.centreline.x_mm + 1j * two.centreline.y_mm)).max() < 1e-7


def test_outcomes_beside_stable() -> None:
    field = MagnetField(magnet=Magnet.cube(55.0, 1.305), gap_mm=16.0)
    soft = replace(gmc(2), remanence_mT=-200.0)
    gone = solve_solid(soft, field)
    assert gone.status.startswith("pulled in")
    assert gone.centreline is None
    buckled = solve_solid(gmc(2), UniformField(flux_mT=400.0, angle_deg=180.0))
    assert (buckled.status, buckled.morse_index) == ("unstable", 1)


def test_weight_bends_the_solid_about_as_it_bends_the_rod() -> None:
    rod = replace(gmc(2), density_kg_m3=2640.0)
    support = Support(gravity_m_s2=(0.0, -9.80665, 0.0))
    field = UniformField(flux_mT=0.0)
    plain = solve(rod, field, support=support).centreline.tip_mm[1]
    solid = solve_solid(rod, field, support=support).centreline.tip_mm[1]
    assert 0.993 < solid / plain < 0.9999


@pytest.mark.parametrize("nu", [-0.1, 0.51, float("nan")])
def test_impossible_ratio_is_refused(nu: float) -> None:
    with pytest.raises(InputError, match="poisson_ratio"):
        solve_solid(gmc(2), UniformField(flux_mT=50.0), poisson_ratio=nu)


def test_out_of_the_model_is_refused() -> None:
    thick = Specimen(
        name="thick", side_mm=10.0, remanence_mT=500.0,
        sections=(Section(length_mm=30.0, E_MPa=0.1),),
    )  # fmt: skip
    with pytest.raises(InputError, match="strain"):
        solve_solid(thick, UniformField(flux_mT=300.0))
    thread = Specimen(
        name="thread", side_mm=0.1, remanence_mT=20.0,
        sections=(Section(length_mm=100.0, E_MPa=1.0),),
    )  # fmt: skip
    with pytest.raises(InputError, match="load"):
        solve_solid(thread, UniformField(flux_mT=50.0, angle_deg=20.0))
