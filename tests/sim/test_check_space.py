"""The check solver in space: closed forms, its order, and the marching solver."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from magbend.core.errors import InputError
from magbend.sim import (
    Coil,
    Cuboid,
    Cylinder,
    Dipole,
    Field,
    Gradient,
    Rod,
    Section,
    SpatialRod,
    SpatialSection,
    Support,
    Uniform,
    UniformField,
    flux_mT,
    gmc,
    sampled_map,
    solve,
    solve_spatial,
    verify,
)
from magbend.sim.check.space import check_spatial

HELD = Support(gravity_m_s2=(1.0, -2.0, -9.5), clamp_angle_deg=15.0)
NOTHING = (0.0, 0.0, 0.0)
PLAIN = {"length_mm": 40.0, "E_MPa": 10.0, "width_mm": 1.0, "height_mm": 1.0}
PLACE = {"gap_mm": 45.0, "elevation_deg": 20.0, "offset_mm": (5.0, 0.0, 8.0)}
COIL = Coil(diameter_mm=80.0, current_A=50.0, turns=200, **PLACE)
FIELDS = {
    "uniform": Field(Uniform(flux_mT=60.0, angle_deg=120.0, elevation_deg=-30.0)),
    "cuboid": Field(Cuboid(sides_mm=55.0, remanence_T=1.3, **PLACE)),
    "cylinder": Field(
        Cylinder(diameter_mm=50.0, length_mm=40.0, remanence_T=-1.2, **PLACE)
    ),
    "dipole": Field(Dipole(moment_A_m2=60.0, **PLACE)),
    "coil": Field(COIL),
    "gradient": Field(
        Gradient(gradient_mT_per_mm=((1.0, 0.5, 0.2), (0.5, 1.0, 0.0), (0.2, 0.0, -2)))
    ),
    "sum": Field(COIL, Uniform(flux_mT=-20.0)),
}
SIZES = {
    "square": {"side_mm": 1.0},
    "rectangle": {"width_mm": 0.8, "height_mm": 1.3},
    "round": {"diameter_mm": 1.1},
    "tube": {"diameter_mm": 1.2, "bore_mm": 0.6},
}


def rod(shape: str) -> Rod:
    return Rod(
        name=shape, shape=shape, remanence_mT=25.0, remanence_y_mT=6.0,
        remanence_z_mT=-4.0, natural_curvature_per_mm=0.02, density_kg_m3=2600.0,
        sections=(
            Section(length_mm=14.0, E_MPa=12.0),
            Section(length_mm=16.0, E_MPa=6.0, remanence_mT=-15.0),
        ),
        **SIZES[shape],
    )  # fmt: skip


@pytest.mark.parametrize("shape", SIZES)
@pytest.mark.parametrize("field", FIELDS.values(), ids=FIELDS)
def test_every_rod_in_every_field(shape: str, field: Field) -> None:
    for one in (solve_spatial, solve):
        found = one(rod(shape), field, support=HELD)
        assert 0.0 < verify(rod(shape), field, found, support=HELD) < found.error_mm


def test_rods_in_a_map() -> None:
    known = FIELDS["coil"]
    box = [[-5.0, -25.0, -25.0], [35.0, 25.0, 25.0]]
    field = Field(
        sampled_map(lambda points: flux_mT(known, points, length_mm=30.0), box)
    )
    found = solve_spatial(rod("round"), field, support=HELD)
    assert verify(rod("round"), field, found, support=HELD) < found.error_mm


def test_without_load_a_helix() -> None:
    k, twist = 0.08, 0.06
    bare = SpatialSection(rest_curvature_per_mm=(0.0, k, twist), **PLAIN)
    check = check_spatial(SpatialRod(sections=(bare,)), UniformField(flux_mT=50.0))
    turn = math.hypot(k, twist)
    s, u = check.s_mm, check.s_mm * turn
    axis = np.array([twist, 0.0, k]) / turn  # of the screw, from d3 = x and d2 = z
    tangent = np.array([1.0, 0.0, 0.0])
    along = axis * (axis @ tangent)
    r = (
        np.outer(np.sin(u) / turn, tangent - along)
        + np.outer((1.0 - np.cos(u)) / turn, np.cross(axis, tangent))
        + np.outer(s, along)
    )
    np.testing.assert_allclose(check.r_mm, r, atol=1e-12)
    assert check.energy_J == pytest.approx(0.0, abs=1e-18)


def test_a_couple_at_the_end_bends_into_an_arc() -> None:
    # Only the last millimetre is magnetised, across: a uniform field turns it, without
    # a force, and what comes before is an arc.
    small = SpatialSection(**PLAIN | {"length_mm": 39.0})
    end = SpatialSection(**PLAIN | {"length_mm": 1.0}, remanence_mT=(0.0, 300.0, 0.0))
    bar = SpatialRod(sections=(small, end))
    check = check_spatial(bar, (60.0, 0.0, 0.0))
    before = check.s_mm < 39.0
    k = check.curvature_per_mm[before]
    np.testing.assert_allclose(k, np.broadcast_to(k[0], k.shape), atol=1e-13)
    s = check.s_mm[before]
    arc = np.abs(k[0, 0])
    assert arc > 0.005
    np.testing.assert_allclose(check.r_mm[before, 0], np.sin(arc * s) / arc, atol=1e-11)


def test_a_cantilever_under_its_weight() -> None:
    """EI theta'' = w (L - s) cos(theta), by collocation with scipy."""
    bar = SpatialRod(sections=(SpatialSection(**PLAIN),), density_kg_m3=8000.0)
    g = 40.0
    check = check_spatial(bar, NOTHING, support=Support(gravity_m_s2=(0.0, 0.0, -g)))
    L, EI, w = 40.0, 10.0 / 12.0, 8000.0 * g * 1e-9
    known = solve_bvp(
        lambda s, y: np.array([y[1], w / EI * (L - s) * np.cos(y[0]), np.sin(y[0])]),
        lambda a, b: np.array([a[0], b[1], a[2]]),
        np.linspace(0.0, L, 41), np.zeros((3, 41)), tol=1e-10,
    )  # fmt: skip
    assert abs(check.tip_mm[2]) > 15.0
    assert abs(check.tip_mm[2]) == pytest.approx(abs(known.y[2, -1]), abs=1e-8)


def test_kirchhoff_twist_is_constant_in_a_round_rod() -> None:
    """GJ twist is conserved where nothing turns a round straight rod about itself."""
    bar = SpatialRod(
        sections=(
            SpatialSection(**PLAIN, round_section=True),
            SpatialSection(
                **PLAIN | {"length_mm": 2.0}, round_section=True,
                remanence_mT=(0.0, 200.0, 150.0),
            ),
        ),
        density_kg_m3=2600.0,
    )  # fmt: skip
    check = check_spatial(bar, (20.0, 60.0, -30.0), support=HELD)
    twist = check.curvature_per_mm[check.s_mm < 40.0, 2]
    assert abs(twist[0]) > 1e-3
    np.testing.assert_allclose(twist, twist[0], atol=1e-12)


@pytest.mark.parametrize(("mT", "index"), [(0.98, 0), (1.02, 2), (9.1, 4)])
def test_index_counts_the_buckled_directions(mT: float, index: int) -> None:
    """Of a straight round rod against its field: two at each of Euler's loads."""
    bar = SpatialRod(
        sections=(SpatialSection(**PLAIN, round_section=True, remanence_mT=(0, 0, 50)),)
    )
    EI = 10.0 * math.pi / 64.0
    moment = 50.0 * 1e-9 / (4e-7 * math.pi) * math.pi / 4.0
    euler_mT = EI * (math.pi / 80.0) ** 2 / moment * 1e3
    straight = (np.array([0.0, 40.0]), np.zeros((2, 3)))
    check = check_spatial(bar, (-mT * euler_mT, 0.0, 0.0), start=straight)
    assert check.tip_mm == pytest.approx((40.0, 0.0, 0.0))
    assert check.morse_index == index


@pytest.mark.parametrize(("points", "order"), [(1, 2.0), (2, 4.0), (3, 6.0)])
def test_order_of_convergence(points: int, order: float) -> None:
    case = rod("rectangle"), FIELDS["cuboid"]
    exact = np.array(check_spatial(*case, support=HELD).tip_mm)
    errors = [
        np.linalg.norm(
            check_spatial(*case, support=HELD, points=points, elements=n).tip_mm - exact
        )
        for n in (4, 8)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


def test_a_wrong_shape_is_found_out() -> None:
    found = solve(rod("tube"), FIELDS["cuboid"], support=HELD)
    other = replace(rod("tube"), poisson_ratio=0.3)
    assert verify(other, FIELDS["cuboid"], found, support=HELD) > 100 * found.error_mm


def hard(seed: int) -> tuple[SpatialRod, Field, Support]:
    """Return a rod of 2 to 5 unlike sections, bent far, before two sources."""
    rng = np.random.default_rng([19, seed])
    sections = tuple(
        SpatialSection(
            length_mm=rng.uniform(4.0, 12.0), E_MPa=rng.uniform(4.0, 30.0),
            width_mm=rng.uniform(0.6, 1.4), height_mm=rng.uniform(0.6, 1.4),
            round_section=rng.random() < 0.3,
            remanence_mT=(*rng.normal(0.0, 25.0, 2), rng.uniform(-90.0, 90.0)),
            rest_curvature_per_mm=rng.normal(0.0, 0.05, 3),
        )
        for _ in range(rng.integers(2, 6))
    )  # fmt: skip
    place = {
        "axis_angle_deg": rng.uniform(-180.0, 180.0),
        "elevation_deg": rng.uniform(-80.0, 80.0), "gap_mm": rng.uniform(30.0, 60.0),
    }  # fmt: skip
    field = Field(
        Cuboid(sides_mm=40.0, remanence_T=1.3, **place),
        Uniform(flux_mT=rng.uniform(-40.0, 40.0), elevation_deg=30.0),
    )
    weight = tuple(rng.normal(0.0, 9.0, 3))
    support = Support(gravity_m_s2=weight, clamp_angle_deg=rng.uniform(-180.0, 180.0))
    return SpatialRod(sections=sections, density_kg_m3=2500.0), field, support


@pytest.mark.parametrize("seed", range(12))
def test_hard_random_rods_agree_within_the_bound(seed: int) -> None:
    bar, field, support = hard(seed)
    found = solve_spatial(bar, field, support=support)
    if found.status == "pulled in: no equilibrium" and found.ending.kind == "fold":
        check = check_spatial(bar, field, support=support)
        assert check.load == pytest.approx(found.load_limit, abs=1e-4)
        return
    check = check_spatial(bar, field, support=support)
    off = np.linalg.norm(check.at(found.s_mm) - found.r_mm, axis=1).max()
    assert off < found.error_mm
    assert check.morse_index == found.morse_index


@pytest.mark.slow
def test_500_sections_are_no_hindrance() -> None:
    parts = tuple(
        Section(length_mm=0.06, E_MPa=8.0 + 4.0 * math.sin(0.1 * i)) for i in range(500)
    )
    many = replace(rod("round"), sections=parts)
    found = solve_spatial(many, FIELDS["cuboid"], support=HELD)
    assert verify(many, FIELDS["cuboid"], found, support=HELD) < found.error_mm


def test_bad_input_is_refused() -> None:
    field = UniformField(flux_mT=50.0)
    light = SpatialRod(sections=(SpatialSection(**PLAIN),))
    with pytest.raises(InputError, match="density"):
        check_spatial(light, field, support=HELD)
    with pytest.raises(InputError, match="SpatialRod or a Specimen"):
        check_spatial("rod", field)
    with pytest.raises(InputError, match="points"):
        check_spatial(light, field, points=0)
    pulling = Field(Cuboid(sides_mm=55.0, remanence_T=1.3, gap_mm=15.0))
    soft = replace(gmc(2), remanence_mT=-400.0)
    gone = solve_spatial(soft, pulling)
    with pytest.raises(InputError, match="must have a shape"):
        verify(soft, pulling, gone)
    with pytest.raises(InputError, match="rod of 40 mm"):
        verify(light, field, solve_spatial(gmc(2), field))
    with pytest.raises(InputError, match="specimen"):
        verify(light, field, solve(gmc(2), field))
