"""The solid model in space: finite elements, symmetries, limits, refusals."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from magbend.core.cross_section import CrossSection
from magbend.core.errors import InputError
from magbend.core.specimen import Section, Specimen
from magbend.sim import Cuboid, Support, Uniform, UniformField, gmc, solve
from magbend.sim.fields import as_field
from magbend.sim.solid.constants import solid_constants
from magbend.sim.solid.plane import solve_in_plane
from magbend.sim.solid.space import largest_strain, solve_in_space

ROOT = Path(__file__).resolve().parents[2]
DRAWN = sorted((ROOT / "fixtures" / "fem").glob("drawn_*.csv"))
SHAPES = {
    "square": {"side_mm": 1.0},
    "rectangle": {"width_mm": 1.2, "height_mm": 0.8},
    "round": {"diameter_mm": 1.0},
    "tube": {"diameter_mm": 1.0, "bore_mm": 0.45},
}
CUBE = Cuboid(sides_mm=25.0, remanence_T=1.3, centre_mm=(18.0, -38.0, 5.0))
ABOVE = Support(gravity_m_s2=(0.0, 0.0, -9.80665))


@pytest.fixture(scope="module")
def cases() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "solid_cases", ROOT / "benchmarks" / "solid_cases.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def rod(shape: str, *, E_MPa: float = 3.0, **more: object) -> Specimen:
    parts = (Section(length_mm=10.0, E_MPa=E_MPa),
             Section(length_mm=10.0, E_MPa=0.6 * E_MPa))  # fmt: skip
    given = {"remanence_mT": 50.0, "density_kg_m3": 2600.0, "sections": parts}
    return Specimen(name=shape, shape=shape, **SHAPES[shape], **(given | more))


@pytest.mark.parametrize("path", DRAWN, ids=lambda path: path.stem)
def test_finite_elements_of_drawn_cases_are_met(cases: ModuleType, path: Path) -> None:
    axis = np.loadtxt(path, delimiter=",", skiprows=1)[:, 1:]
    specimen, field, support, nu = cases.read_case(path.with_suffix(".json"))
    found = solve(specimen, field, support=support, model="solid", poisson_ratio=nu)
    deflection = np.linalg.norm(axis[-1] - [specimen.length_mm, 0.0, 0.0])
    miss = np.linalg.norm(found.points_mm - axis, axis=1)
    assert found.status == "stable"
    assert miss[-1] < (8e-4 if specimen.shape == "tube" else 2e-4) * deflection
    plain = solve(specimen, field, support=support).points_mm
    assert miss[-1] < 0.1 * np.linalg.norm(plain[-1] - axis[-1])


@pytest.mark.parametrize("shape", ["square", "rectangle", "round"])
def test_the_march_in_space_agrees_with_that_in_the_plane(shape: str) -> None:
    specimen, field = rod(shape), UniformField(flux_mT=40.0, angle_deg=110.0)
    support = Support(gravity_m_s2=(1.0, -3.0, 0.0))
    plane, _ = solve_in_plane(specimen, field, support, 0.45, 61)
    space = solve_in_space(specimen, field, support, 0.45, 61)
    deflection = np.linalg.norm(space.r_mm[-1] - [20.0, 0.0, 0.0])
    miss = np.linalg.norm(space.r_mm - plane.points_mm, axis=1)
    assert miss.max() < 1e-4 * deflection
    line = space.seen_from_above().centreline
    assert line is not None
    assert plane.centreline is not None
    # Within a side the plane's has the axis's own profile; a joint turns in no length.
    away = slice(4, None)
    assert np.abs(line.theta_rad - plane.centreline.theta_rad)[away].max() < 5e-4


@pytest.mark.parametrize("shape", ["square", "round"])
def test_turning_the_scene_about_the_rod_turns_the_shape(shape: str) -> None:
    """By a right angle the square is itself, and the rod bends up instead of left."""
    specimen = rod(shape)
    flat = solve_in_space(
        specimen, as_field(Uniform(flux_mT=50.0, angle_deg=90.0)),
        Support(gravity_m_s2=(0.0, 2.0, -7.0)), 0.49, 21,
    )  # fmt: skip
    upright = solve_in_space(
        specimen, as_field(Uniform(flux_mT=50.0, angle_deg=0.0, elevation_deg=90.0)),
        Support(gravity_m_s2=(0.0, 7.0, 2.0)), 0.49, 21,
    )  # fmt: skip
    turned = flat.r_mm[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    assert upright.r_mm == pytest.approx(turned, abs=1e-8)


@pytest.mark.parametrize("shape", ["round", "tube"])
def test_round_rods_bend_about_any_axis_alike(shape: str) -> None:
    """Turned by half a right angle, so that both axes of the section share the bend."""
    specimen = rod(shape, E_MPa=1.5)
    flat, raised = (
        solve_in_space(
            specimen,
            as_field(Uniform(flux_mT=50.0, angle_deg=90.0, elevation_deg=elevation)),
            Support(), 0.3, 21,
        ).r_mm
        for elevation in (0.0, 45.0)
    )  # fmt: skip
    turned = flat[:, 1:2] * np.sqrt([0.5, 0.5])
    assert raised[:, 0] == pytest.approx(flat[:, 0], abs=1e-4)
    assert raised[:, 1:] == pytest.approx(turned, abs=1e-4)


def test_a_tube_of_hardly_a_bore_is_round() -> None:
    """Its law and its fixed face lead on from the circle's."""
    whole = solid_constants(rod("round").cross_sections[0], 0.37)
    pin = replace(rod("tube"), bore_mm=1e-4).cross_sections[0]
    bored = solid_constants(pin, 0.37)
    assert bored.soften == pytest.approx(whole.soften, rel=1e-5)
    assert bored.turn_cubed == pytest.approx(whole.turn_cubed, rel=1e-5)
    assert bored.shear == pytest.approx(whole.shear, rel=1e-5)


def test_tubes_soften_sooner_the_thinner_they_are() -> None:
    bores = np.linspace(0.0, 0.6, 13)
    found = [
        solid_constants(
            CrossSection(shape="tube", width_mm=1.0, height_mm=1.0, bore_mm=bore), 0.43
        )
        for bore in bores
    ]
    assert np.all(np.diff([each.soften[1] for each in found]) > 0.0)
    assert np.all(np.diff([each.turn_cubed[1] for each in found]) > 0.0)


def test_lying_and_standing_rectangles_are_each_others() -> None:
    fields = (
        Uniform(flux_mT=60.0),
        Uniform(flux_mT=60.0, angle_deg=0.0, elevation_deg=90.0),
    )
    lying = rod("rectangle")
    standing = replace(lying, width_mm=0.8, height_mm=1.2, side_mm=0.8)
    falls = (0.0, 2.0, -7.0), (0.0, 7.0, 2.0)
    one, two = (
        solve_in_space(each, as_field(field), Support(gravity_m_s2=fall), 0.4, 21).r_mm
        for each, field, fall in zip((lying, standing), fields, falls, strict=True)
    )
    assert two == pytest.approx(one[:, [0, 2, 1]] * [1.0, -1.0, 1.0], abs=1e-8)


def test_a_square_is_a_rectangle_of_equal_sides() -> None:
    square = rod("square")
    same = replace(square, shape="rectangle", width_mm=1.0, height_mm=1.0)
    field = as_field(CUBE)
    shapes = [
        solve(each, field, support=ABOVE, model="solid").points_mm
        for each in (square, same)
    ]
    assert shapes[1] == pytest.approx(shapes[0], abs=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_slender_solid_becomes_the_plain_rod(shape: str) -> None:
    """What the solid adds falls faster than the thickness, at the same bend."""
    field = as_field(Uniform(flux_mT=40.0, angle_deg=80.0, elevation_deg=20.0))
    gaps = []
    for thin in (0.25, 0.0625):
        sizes = {name: thin * value for name, value in SHAPES[shape].items()}
        specimen = replace(
            rod(shape), **({"side_mm": 0.0} | sizes), remanence_mT=50.0 * thin**2,
            density_kg_m3=2600.0 * thin**2,
        )  # fmt: skip
        tips = [
            solve(specimen, field, support=ABOVE, model=model).points_mm[-1]
            for model in ("rod", "solid")
        ]
        gaps.append(np.linalg.norm(tips[0] - tips[1]))
    assert gaps[0] < 0.03
    assert 0.0 < gaps[1] < 0.3 * gaps[0]


def test_the_bench_from_above_sags_a_little_less_as_a_solid() -> None:
    specimen = replace(gmc(2), density_kg_m3=2640.0)
    field = UniformField(flux_mT=50.0)
    plain, solid = (
        solve(specimen, field, support=ABOVE, model=model) for model in ("rod", "solid")
    )
    assert 0.99 < solid.sag_mm / plain.sag_mm < 0.999
    assert solid.stable_in_space is True
    assert 0.0 < solid.error_mm < 1e-6


def test_error_bounds_what_a_finer_march_changes() -> None:
    """Sections cut in four are the same solid, marched in more steps."""
    specimen = rod("rectangle", E_MPa=2.0)
    parts = tuple(
        replace(part, length_mm=part.length_mm / 4.0)
        for part in specimen.sections for _ in range(4)
    )  # fmt: skip
    field = as_field(CUBE)
    one, two = (
        solve_in_space(each, field, ABOVE, 0.49, 21)
        for each in (specimen, replace(specimen, sections=parts))
    )
    assert np.abs(one.r_mm - two.r_mm).max() < one.error_mm + two.error_mm + 1e-9


def test_strain_is_that_of_the_surface() -> None:
    """A bar of 2 mm bent over a moment: kappa w / 2, and what its tip pulls."""
    specimen = rod("square")
    field = UniformField(flux_mT=40.0)
    found = solve_in_space(specimen, field, Support(), 0.49, 201)
    strain = largest_strain(specimen, Support(), found)
    bent = 0.5 * np.abs(found.curvature_per_mm[:, 1]).max()
    assert bent < strain < 1.05 * bent


@pytest.mark.parametrize("shape", SHAPES)
def test_strains_beyond_the_model_are_refused_with_the_largest(shape: str) -> None:
    soft = rod(shape, E_MPa=0.25)
    limit = r"of rectangles .* 0\.1" if shape == "rectangle" else r"must be below 0\.2"
    words = rf"largest strain {limit} for .* 0\.[2-9]"
    with pytest.raises(InputError, match=words):
        solve(soft, UniformField(flux_mT=90.0), support=ABOVE, model="solid")


def test_sections_out_of_the_table_are_refused() -> None:
    flat = CrossSection(shape="rectangle", width_mm=5.0, height_mm=1.0)
    with pytest.raises(InputError, match="3 to 1"):
        solid_constants(flat, 0.3)
    thin = CrossSection(shape="tube", width_mm=1.0, height_mm=1.0, bore_mm=0.7)
    with pytest.raises(InputError, match=r"bores to 0\.6"):
        solid_constants(thin, 0.3)
    brief = rod(
        "round",
        sections=(Section(length_mm=0.1, E_MPa=2.0), Section(length_mm=9.0, E_MPa=1.0)),
    )
    with pytest.raises(InputError, match="sections must be longer"):
        solve(brief, UniformField(flux_mT=20.0), support=ABOVE, model="solid")


def test_table_is_smooth_between_its_nodes() -> None:
    """At sides and ratios between the nodes, neighbours of what is at them."""
    for ratio in np.geomspace(0.34, 2.9, 9):
        across = CrossSection(shape="rectangle", width_mm=ratio, height_mm=1.0)
        turns = [solid_constants(across, nu).turn[1] for nu in np.linspace(0, 0.5, 41)]
        assert np.all(np.diff(turns) > 0.0)
    ratios = np.geomspace(0.34, 2.9, 41)
    turns = [
        solid_constants(
            CrossSection(shape="rectangle", width_mm=ratio, height_mm=1.0), 0.43
        ).turn[1]
        for ratio in ratios
    ]
    assert np.all(np.diff(turns) < 0.0)
