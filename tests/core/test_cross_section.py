"""Cross-sections: areas, second moments and sizes that do not fit a shape."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from magbend.core.cross_section import SIZES, cross_section, torsion_constant_mm4
from magbend.core.errors import ConfigError, InputError
from magbend.core.profile import profile_sections
from magbend.core.specimen import Section, Specimen
from magbend.core.specimen_file import read_specimen, specimen_dict

SECTIONS = (Section(length_mm=10.0, E_MPa=20.0), Section(length_mm=20.0, E_MPa=10.0))
EXAMPLES = {
    "square": {"side_mm": 1.1},
    "rectangle": {"width_mm": 0.8, "height_mm": 1.7},
    "round": {"diameter_mm": 1.3},
    "tube": {"diameter_mm": 1.3, "bore_mm": 0.7},
}


def rod(shape: str, **more: object) -> Specimen:
    given = {"name": shape, "remanence_mT": 20.0, "sections": SECTIONS}
    return Specimen(**(given | {"shape": shape} | EXAMPLES[shape] | more))  # type: ignore[arg-type]


@pytest.mark.parametrize("shape", SIZES)
def test_moments_are_the_integrals_over_the_material(shape: str) -> None:
    one = rod(shape).cross_sections[0]
    n = 1500
    y, z = np.meshgrid(*[(np.arange(n) + 0.5) / n * 2.0 - 1.0] * 2)
    y, z = y * one.width_mm / 2.0, z * one.height_mm / 2.0
    cell = one.width_mm * one.height_mm / n**2
    r = np.hypot(y, z)
    full = (r < one.width_mm / 2.0) & (r >= one.bore_mm / 2.0) | (not one.is_round)
    assert one.area_mm2 == pytest.approx(full.sum() * cell, rel=1e-3)
    assert one.in_plane_mm4 == pytest.approx((full * y**2).sum() * cell, rel=1e-3)
    assert one.across_mm4 == pytest.approx((full * z**2).sum() * cell, rel=1e-3)
    if one.is_round:
        polar = (full * r**2).sum() * cell
        assert one.torsion_mm4 == pytest.approx(polar, rel=1e-3)


def test_a_thin_strip_twists_as_a_strip() -> None:
    assert torsion_constant_mm4(0.01, 10.0) == pytest.approx(1e-5 / 3.0, rel=1e-3)


def test_shear_factors_are_cowpers() -> None:
    assert rod("round").cross_sections[0].shear_factor(0.3) == pytest.approx(
        0.8864, abs=1e-4
    )
    thin = cross_section("tube", "it", diameter_mm=1.0, bore_mm=0.9999)
    assert thin.shear_factor(0.3) == pytest.approx(2.0 * 1.3 / (4.0 + 0.9), rel=1e-3)


@pytest.mark.parametrize("shape", SIZES)
def test_changes_are_the_derivatives(shape: str) -> None:
    for name in {"side_mm", *SIZES[shape]}:
        sizes = dict(EXAMPLES[shape])
        if name not in sizes:  # the size as a whole
            factor = (1.0 + 1e-6) / 1.0
            more = {key: value * factor for key, value in sizes.items()}
            step = 1e-6 * rod(shape).sides_mm[0]
        else:
            step = 1e-6
            more = sizes | {name: sizes[name] + step}
        a, b = rod(shape).cross_sections[0], rod(shape, **more).cross_sections[0]
        area, second = a.change(name)
        assert (b.area_mm2 - a.area_mm2) / step == pytest.approx(area, rel=1e-5)
        assert (b.in_plane_mm4 - a.in_plane_mm4) / step == pytest.approx(
            second, rel=1e-5
        )


@pytest.mark.parametrize("shape", SIZES)
def test_a_file_gives_the_specimen_back(shape: str, tmp_path: Path) -> None:
    name = SIZES[shape][0]
    sections = (
        SECTIONS[0],
        Section(
            length_mm=5.0, E_MPa=3.0, remanence_mT=0.0, remanence_z_mT=4.0,
            natural_curvature_per_mm=-0.01, **{name: 2.0},  # type: ignore[arg-type]
        ),
    )  # fmt: skip
    given = rod(
        shape, sections=sections, side_sd_mm=0.02, length_sd_mm=0.1,
        density_sd_kg_m3=50.0,
        remanence_sd_mT=0.4, natural_curvature_per_mm=1e-3, density_kg_m3=2000.0,
        natural_curvature_sd_per_mm=1e-4, recipe={"NdFeB": 2.0, "PCL": 1.0},
        colour="#c8af8c",
    )  # fmt: skip
    path = tmp_path / "specimen.json"
    path.write_text(json.dumps(specimen_dict(given)), encoding="utf-8")
    assert read_specimen(path) == given
    assert given.sides_mm == (EXAMPLES[shape][name], 2.0)


@pytest.mark.parametrize(
    ("sizes", "said"),
    [
        ({"shape": "round", "side_mm": 1.0}, "side_mm.*does not belong.*diameter_mm"),
        ({"shape": "round"}, "diameter_mm.*above zero"),
        ({"shape": "oval", "side_mm": 1.0}, "square, rectangle, round, tube.*'oval'"),
        ({"shape": "tube", "diameter_mm": 1.0, "bore_mm": 1.0}, "below its diameter"),
        ({"shape": "square", "side_mm": 1.0, "bore_mm": 0.5}, "bore_mm.*not belong"),
        ({"shape": "rectangle", "width_mm": 1.0}, "height_mm.*above zero"),
        ({"shape": "round", "diameter_mm": math.nan}, "finite"),
    ],
)
def test_sizes_of_another_shape_are_refused(sizes: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        Specimen(name="A", remanence_mT=20.0, sections=SECTIONS, **sizes)


def test_a_section_of_another_shape_is_refused() -> None:
    mixed = (*SECTIONS, Section(length_mm=1.0, E_MPa=1.0, diameter_mm=1.0))
    with pytest.raises(InputError, match=r"diameter_mm.*does not belong to a section"):
        rod("square", sections=mixed)


def test_a_file_names_the_missing_size(tmp_path: Path) -> None:
    path = tmp_path / "rod.toml"
    path.write_text(
        'name = "A"\nshape = "round"\nside_mm = 1.0\nremanence_mT = 20.0\n'
        "[[section]]\nlength_mm = 1.0\nE_MPa = 1.0\n",
        encoding="utf-8",
    )
    with pytest.raises(ConfigError, match="'diameter_mm' is missing"):
        read_specimen(path)


def test_a_profile_is_many_sections(tmp_path: Path) -> None:
    path = tmp_path / "rod.toml"
    path.write_text(
        'name = "A"\nside_mm = 1.0\nremanence_mT = 20.0\n'
        "[profile]\ns_mm = [0, 10, 30]\nE_MPa = [20, 15, 10]\npieces = 30\n"
        "side_mm = [1.2, 1.0, 0.8]\n",
        encoding="utf-8",
    )
    found = read_specimen(path)
    assert found.length_mm == pytest.approx(30.0)
    assert len(found.sections) == 30
    assert found.sections[0].E_MPa == pytest.approx(19.75)
    assert found.sides_mm[-1] == pytest.approx(0.805)
    assert found.sections == profile_sections(
        [0, 10, 30], pieces=30, E_MPa=[20, 15, 10], side_mm=[1.2, 1.0, 0.8]
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"s_mm": [0.0, 0.0], "E_MPa": [1.0, 1.0]}, "must rise from 0"),
        ({"s_mm": [0.0, 5.0], "E_MPa": [1.0]}, "2 values"),
        ({"s_mm": [0.0, 5.0]}, "must have E_MPa"),
        ({"s_mm": [0.0, 5.0], "E_MPa": [1.0, 1.0], "colour": [1.0, 2.0]}, "colour"),
    ],
)
def test_profiles_that_cannot_be_are_refused(given: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        profile_sections(**given)
