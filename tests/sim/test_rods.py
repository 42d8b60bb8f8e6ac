"""Rods of every shape, curved or magnetised across, in every solver."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from magbend.core.errors import InputError
from magbend.core.magnet import Magnet
from magbend.core.specimen import Section, Specimen
from magbend.core.units import MU0
from magbend.sim import (
    MagnetField,
    Rod,
    Support,
    UniformField,
    find_equilibria,
    profile_sections,
    sensitivities,
    solve,
    solve_many,
    solve_spatial,
    verify,
)

SECTIONS = (Section(length_mm=10.0, E_MPa=20.0), Section(length_mm=20.0, E_MPa=10.0))
SIZES = {
    "square": {"side_mm": 1.0},
    "rectangle": {"width_mm": 0.8, "height_mm": 1.3},
    "round": {"diameter_mm": 1.1},
    "tube": {"diameter_mm": 1.2, "bore_mm": 0.6},
}
FIELDS = [
    UniformField(flux_mT=50.0, angle_deg=110.0),
    MagnetField(magnet=Magnet.cube(55.0, 1.305), gap_mm=60.0),
]


def rod(shape: str, **more: object) -> Specimen:
    given = {"name": shape, "remanence_mT": 20.0, "sections": SECTIONS}
    return Specimen(**(given | {"shape": shape} | SIZES[shape] | more))  # type: ignore[arg-type]


def same_square(one: Specimen) -> Specimen:
    """Return the square rod with the same stiffness and moment."""
    across = one.cross_sections[0]
    factor = across.in_plane_mm4 * 12.0
    return Specimen(
        name="square", side_mm=1.0, remanence_mT=one.remanence_mT * across.area_mm2,
        sections=tuple(replace(s, E_MPa=s.E_MPa * factor) for s in one.sections),
    )  # fmt: skip


@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("shape", ["rectangle", "round", "tube"])
def test_a_shape_bends_as_the_square_of_its_stiffness_and_moment(
    shape: str, field: UniformField | MagnetField
) -> None:
    one = solve(rod(shape), field)
    other = solve(same_square(rod(shape)), field)
    np.testing.assert_allclose(
        one.centreline.tip_mm, other.centreline.tip_mm, rtol=1e-12
    )
    assert verify(rod(shape), field, one) < 1e-8
    space = solve_spatial(rod(shape), field)
    np.testing.assert_allclose(space.r_mm[-1, :2], one.centreline.tip_mm, atol=1e-6)


@pytest.mark.parametrize("shape", SIZES)
def test_batches_take_the_sizes_of_every_shape(shape: str) -> None:
    tips = solve_many(
        {"length_mm": [10.0, 20.0], "E_MPa": [20.0, 10.0], "remanence_mT": 20.0}
        | {"flux_mT": [50.0, 300.0], "angle_deg": 110.0}
        | SIZES[shape]
    )
    for row, flux_mT in zip(tips, (50.0, 300.0), strict=True):
        one = solve(rod(shape), UniformField(flux_mT=flux_mT, angle_deg=110.0))
        x, y = one.centreline.tip_mm
        off = math.hypot(row["tip_x_mm"] - x, row["tip_y_mm"] - y)
        assert off <= row["error_mm"] < 1e-4


@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("shape", ["rectangle", "round", "tube"])
def test_sizes_have_exact_sensitivities(
    shape: str, field: UniformField | MagnetField
) -> None:
    names = (*SIZES[shape], *(f"{name}[1]" for name in SIZES[shape]))
    found = sensitivities(rod(shape), field, parameters=names)
    step = 1e-4
    for k, name in enumerate(names):
        key = name.removesuffix("[1]")
        ends = []
        for d in (step, -step):
            value = SIZES[shape][key] + d
            if name == key:
                other = rod(shape, **{key: value})
            else:
                moved = (SECTIONS[0], replace(SECTIONS[1], **{key: value}))
                other = rod(shape, sections=moved)
            ends.append(solve(other, field).centreline.y_mm)
        slope = (ends[0] - ends[1]) / (2.0 * step)
        np.testing.assert_allclose(found.dy_mm[:, k], slope, atol=1e-5)


def test_a_curved_rod_without_load_has_its_natural_curvature() -> None:
    curved = rod("round", natural_curvature_per_mm=0.03, remanence_mT=0.0)
    found = solve(curved, FIELDS[0]).centreline
    turn = 0.03 * found.s_mm
    np.testing.assert_allclose(found.theta_rad, turn, atol=1e-9)
    np.testing.assert_allclose(found.y_mm, (1.0 - np.cos(turn)) / 0.03, atol=1e-8)


def test_magnetised_across_a_rod_is_pulled_round_by_half_a_turn_of_sign() -> None:
    across = rod("round", remanence_mT=0.0, remanence_y_mT=20.0)
    along_x = UniformField(flux_mT=50.0, angle_deg=180.0)
    # Moment m y in a field -x: the torque m y x (-B x) = +m B z turns toward +y.
    found = solve(across, along_x).centreline
    assert found.y_mm[-1] > 1.0
    turned = solve(replace(across, remanence_y_mT=-20.0), along_x).centreline
    np.testing.assert_allclose(turned.y_mm, -found.y_mm, atol=1e-9)


def test_planar_solvers_refuse_what_is_not_plain() -> None:
    curved = rod("round", natural_curvature_per_mm=0.03)
    for task in (
        lambda: find_equilibria(curved, FIELDS[0]),
        lambda: solve(curved, FIELDS[0], model="solid"),
    ):
        with pytest.raises(InputError, match="natural_curvature_per_mm"):
            task()


def test_a_round_rod_sags_by_its_own_area() -> None:
    held = Support(gravity_m_s2=(0.0, -9.80665, 0.0))
    tube = rod("tube", remanence_mT=0.0, density_kg_m3=2000.0, sections=SECTIONS[1:])
    found = solve(tube, FIELDS[0], support=held).centreline
    area, second = tube.cross_sections[0].area_mm2, tube.cross_sections[0].in_plane_mm4
    load_N_per_mm = 2000.0 * area * 9.80665e-9
    small = load_N_per_mm * 20.0**4 / (8.0 * 10.0 * second)
    assert found.y_mm[-1] == pytest.approx(-small, rel=2e-3)


def test_designs_refuse_sizes_of_two_shapes() -> None:
    base = {"length_mm": [10.0], "E_MPa": [20.0], "remanence_mT": 20.0, "flux_mT": 50.0}
    with pytest.raises(InputError, match=r"sizes of one shape.*diameter_mm, side_mm"):
        solve_many(base | {"side_mm": 1.0, "diameter_mm": 1.0})
    with pytest.raises(InputError, match=r"bore_mm.*below"):
        solve_many(base | {"bore_mm": 1.0, "diameter_mm": 1.0})


def test_a_profile_converges_with_the_second_power_of_its_pieces() -> None:
    tips = []
    for pieces in (10, 20, 40, 160):
        sections = profile_sections([0.0, 30.0], pieces=pieces, E_MPa=[20.0, 5.0])
        one = rod("square", sections=sections)
        tips.append(solve(one, FIELDS[0]).centreline.tip_mm[1])
    off = [abs(tip - tips[-1]) for tip in tips[:-1]]
    assert 3.5 < off[0] / off[1] < 4.6
    assert 3.5 < off[1] / off[2] < 4.8


def test_a_rod_of_500_sections_is_solved() -> None:
    sections = profile_sections([0.0, 30.0], pieces=500, E_MPa=[12.0, 12.0])
    whole = rod("square", sections=(Section(length_mm=30.0, E_MPa=12.0),))
    for field in FIELDS:
        one = solve(rod("square", sections=sections), field)
        np.testing.assert_allclose(
            one.centreline.tip_mm, solve(whole, field).centreline.tip_mm, atol=1e-9
        )


@pytest.mark.parametrize(
    ("height_mm", "holds"), [(0.5, False), (0.9, False), (1.1, True), (2.0, True)]
)
def test_a_strip_leaves_the_plane_over_its_weaker_side(
    height_mm: float, holds: bool
) -> None:
    # Against the field a column buckles at m B L^2 = EI pi^2 / 4 of either side; here
    # the field is just below what it takes within the plane.
    strip = Rod(
        name="strip", shape="rectangle", width_mm=1.0, height_mm=height_mm,
        remanence_mT=20.0, sections=(Section(length_mm=30.0, E_MPa=10.0),),
    )  # fmt: skip
    moment_Am = height_mm * 20.0e-9 / MU0
    euler_T = 10.0 * height_mm / 12.0 * math.pi**2 / 4.0 / 900.0 / moment_Am
    found = solve(strip, UniformField(flux_mT=0.95e3 * euler_T, angle_deg=180.0))
    assert found.status == "stable"
    assert found.stable_in_space is holds
