"""Exact derivatives against eighth-order differences and a certified table."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from magbend.core.errors import InputError, SolverError
from magbend.core.magnet import Magnet
from magbend.core.specimen import Section, Specimen
from magbend.core.units import MU0
from magbend.sim import (
    Field,
    MagnetField,
    Support,
    UniformField,
    gmc,
    sensitivities,
)
from magbend.sim.planar import solver
from magbend.sim.planar.solver import solve_planar
from magbend.sim.scaling import field_array, rod_array

FIXTURES = Path(__file__).resolve().parents[2] / "fixtures" / "sim"
ROD = Specimen(
    name="uneven",
    side_mm=1.0,
    remanence_mT=20.0,
    density_kg_m3=2600.0,
    sections=(
        Section(length_mm=9.0, E_MPa=20.0, side_mm=1.2, remanence_mT=25.0),
        Section(length_mm=11.0, E_MPa=13.0),
        Section(length_mm=10.5, E_MPa=9.0, side_mm=0.8, remanence_mT=14.0),
    ),
)
SUPPORT = Support(clamp_angle_deg=3.0, gravity_m_s2=(2.0, -5.0, 0.0), load_factor=1.1)
UNIFORM = UniformField(flux_mT=60.0, angle_deg=120.0)
MAGNET = MagnetField(magnet=Magnet.cube(55.0, 1.3, axis_angle_deg=70.0), gap_mm=55.0)
STATIONS = np.linspace(0.5, 30.1, 20)
STEPS = {
    "E_MPa": 0.2,
    "density_kg_m3": 100.0,
    "angle_deg": 2.0,
    "clamp_angle_deg": 1.0,
    "flux_mT": 1.0,
    "magnet.axis_angle_deg": 1.0,
}
OF_ROD = (
    [
        f"{key}[{i}]"
        for key in ("E_MPa", "length_mm", "side_mm", "remanence_mT")
        for i in range(3)
    ]
    + ["side_mm", "remanence_mT", "clamp_angle_deg", "load_factor"]
    + ["gravity_m_s2[0]", "gravity_m_s2[1]", "density_kg_m3"]
)
CASES = [(UNIFORM, name) for name in [*OF_ROD, "flux_mT", "angle_deg"]] + [
    (MAGNET, name)
    for name in [
        *OF_ROD, "gap_mm", "magnet.remanence_T", "magnet.axis_angle_deg",
        "magnet.offset_mm[0]", "magnet.offset_mm[1]", "magnet.offset_mm[2]",
    ]
]  # fmt: skip


def moved(name: str, by: float, field: Field) -> tuple[Specimen, Field, Support]:
    """The case with one parameter changed."""
    match = re.fullmatch(r"([\w.]+?)(?:\[(\d)\])?", name)
    assert match
    key, index = match.group(1), match.group(2)
    if key in ("E_MPa", "length_mm", "side_mm", "remanence_mT"):
        sections = list(ROD.sections)
        for i in range(3) if index is None else [int(index)]:
            old = {
                "side_mm": ROD.sides_mm[i],
                "remanence_mT": ROD.remanences_mT[i],
                "E_MPa": sections[i].E_MPa,
                "length_mm": sections[i].length_mm,
            }[key]
            sections[i] = replace(sections[i], **{key: old + by})
        return replace(ROD, sections=tuple(sections)), field, SUPPORT
    if key == "density_kg_m3":
        return replace(ROD, density_kg_m3=2600.0 + by), field, SUPPORT
    if key == "gravity_m_s2":
        gravity = list(SUPPORT.gravity_m_s2)
        gravity[int(index)] += by
        return ROD, field, replace(SUPPORT, gravity_m_s2=tuple(gravity))
    if key in ("clamp_angle_deg", "load_factor"):
        return ROD, field, replace(SUPPORT, **{key: getattr(SUPPORT, key) + by})
    if not key.startswith("magnet."):
        return ROD, replace(field, **{key: getattr(field, key) + by}), SUPPORT
    assert isinstance(field, MagnetField)
    name = key.removeprefix("magnet.")
    if index is not None:
        offset = list(field.magnet.offset_mm)
        offset[int(index)] += by
        magnet = replace(field.magnet, offset_mm=tuple(offset))
    else:
        value = getattr(field.magnet, name) + by
        magnet = replace(field.magnet, **{name: value})
    return ROD, replace(field, magnet=magnet), SUPPORT


def shape(rod: Specimen, field: Field, support: Support) -> np.ndarray:
    """x, y in mm and theta at STATIONS, shape (3, n)."""
    length_mm = rod.length_mm
    s = np.concatenate([[0.0], STATIONS / length_mm, [1.0]])
    angle = np.radians(support.clamp_angle_deg)
    array = field_array(field, length_mm)
    outcome, *_, table, _ = solve_planar(
        rod_array(rod, support), array, angle, 0.0, s, 16, 0.3
    )
    assert outcome == 0
    return table[:3, 1:-1] * np.array([[length_mm], [length_mm], [1.0]])


@pytest.mark.parametrize(("field", "name"), CASES)
def test_agrees_with_differences(field: Field, name: str) -> None:
    found = sensitivities(ROD, field, parameters=[name], support=SUPPORT, s_mm=STATIONS)
    exact = np.array([found.dx_mm[:, 0], found.dy_mm[:, 0], found.dtheta_rad[:, 0]])
    if name == "magnet.offset_mm[2]":  # by symmetry
        assert np.all(exact == 0.0)
        return
    step = STEPS.get(name.split("[")[0], 0.02)
    slope = np.zeros_like(exact)
    for k, w in ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280)):
        up = shape(*moved(name, k * step, field))
        down = shape(*moved(name, -k * step, field))
        slope += w * (up - down) / step
    size = np.abs(slope).max(axis=1, keepdims=True)
    assert np.abs(exact - slope).max() < 1e-7 * size.min() or np.all(
        np.abs(exact - slope) < 1e-7 * size
    )


def test_agrees_with_the_elastica_table() -> None:
    text = (FIXTURES / "elastica_uniform.csv").read_text(encoding="utf-8")
    for row in csv.DictReader(text.splitlines()):
        beta = float(row["beta"])
        rod = Specimen(
            name="reference",
            side_mm=1.0,
            remanence_mT=beta * (10.0 / 12.0) / 100.0**2 / 0.1 * MU0 * 1e9,
            sections=(Section(length_mm=100.0, E_MPa=10.0),),
        )
        field = UniformField(flux_mT=100.0, angle_deg=float(row["phi_deg"]))
        found = sensitivities(rod, field, parameters=["flux_mT"], s_mm=[100.0])
        slope = found.dtheta_rad[0, 0] * 100.0 / beta
        assert slope == pytest.approx(float(row["dtheta_dbeta"]), rel=1e-9)


def test_only_the_ratio_of_magnetisation_and_modulus_counts() -> None:
    # DESIGN, section 5: without weight, ln M and the sum of ln E are one direction.
    rod = gmc(2)
    found = sensitivities(
        rod,
        MAGNET,
        parameters=["remanence_mT", "E_MPa[0]", "E_MPa[1]", "E_MPa[2]"],
    )
    moduli = np.array([section.E_MPa for section in rod.sections])
    assert np.allclose(
        found.dy_mm[:, 0] * rod.remanence_mT,
        -(found.dy_mm[:, 1:] @ moduli),
        atol=1e-11,
    )


def test_the_clamp_stays() -> None:
    found = sensitivities(ROD, UNIFORM, parameters=["E_MPa[1]", "clamp_angle_deg"])
    assert np.abs(found.dx_mm[0]).max() < 1e-12
    assert np.abs(found.dy_mm[0]).max() < 1e-12
    assert found.dtheta_rad[0] == pytest.approx([0.0, np.radians(1.0)], abs=1e-13)


@pytest.mark.parametrize(
    "name", ["E_GPa", "E_MPa[3]", "E_MPa", "gap_mm", "gravity_m_s2[2]", "magnet.side"]
)
def test_unknown_parameters_are_refused(name: str) -> None:
    with pytest.raises(InputError, match="parameter"):
        sensitivities(ROD, UNIFORM, parameters=[name])


@pytest.mark.parametrize("s_mm", [[31.0], [-1.0], [5.0, 4.0], [np.nan], []])
def test_stations_off_the_rod_are_refused(s_mm: list[float]) -> None:
    with pytest.raises(InputError, match=r"s_mm.*mm"):
        sensitivities(ROD, UNIFORM, parameters=["E_MPa[0]"], s_mm=s_mm)


def test_no_shape_no_derivative() -> None:
    rod = replace(gmc(3), remanence_mT=-150.0)
    field = MagnetField(magnet=Magnet.cube(55.0, 1.305), gap_mm=20.0)
    with pytest.raises(SolverError, match="no equilibrium"):
        sensitivities(rod, field, parameters=["E_MPa[0]"])


def test_the_case_is_solved_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of the cost of a few derivatives would be a second solve."""
    kept, solved = solver.solve_rows, []

    def counted(*case: object) -> object:
        solved.append(case)
        return kept(*case)

    monkeypatch.setattr(solver, "solve_rows", counted)
    sensitivities(ROD, MAGNET, parameters=["gap_mm"])
    assert len(solved) == 1
