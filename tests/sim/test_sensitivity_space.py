"""Derivatives of rods in space: against the plane's, and against solved neighbours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from magbend.core.errors import InputError
from magbend.sim import (
    Coil,
    Cuboid,
    Field,
    Rod,
    Section,
    Support,
    Uniform,
    gmc,
    sensitivities,
    solve_spatial,
)
from magbend.sim.sensitivity.moved import move_of
from magbend.sim.sensitivity.space import shape_changes

ROD = Rod(
    name="tilted", shape="rectangle", width_mm=1.1, height_mm=0.8, remanence_mT=18.0,
    remanence_y_mT=4.0, remanence_z_mT=-3.0, natural_curvature_per_mm=0.004,
    density_kg_m3=2640.0,
    sections=(
        Section(length_mm=11.0, E_MPa=18.0),
        Section(length_mm=9.0, E_MPa=9.0, remanence_y_mT=-5.0),
    ),
)  # fmt: skip
HELD = Support(gravity_m_s2=(0.0, -1.0, -9.8), clamp_angle_deg=5.0, load_factor=0.9)
FIELD = Field(
    Cuboid(sides_mm=(40.0, 50.0, 45.0), remanence_T=1.25, gap_mm=35.0,
           elevation_deg=12.0, offset_mm=(3.0, 0.0, 5.0)),
    Coil(diameter_mm=80.0, current_A=6.0, turns=200, centre_mm=(0.0, 95.0, 10.0)),
    Uniform(flux_mT=-3.0),
)  # fmt: skip
NAMES = (
    "E_MPa[0]", "E_MPa[1]", "length_mm[0]", "length_mm[1]", "width_mm[1]", "height_mm",
    "remanence_mT", "remanence_y_mT[1]", "remanence_z_mT", "natural_curvature_per_mm",
    "poisson_ratio", "density_kg_m3", "gravity_m_s2[0]", "gravity_m_s2[2]",
    "clamp_angle_deg", "load_factor", "gap_mm", "source[0].elevation_deg",
    "source[0].axis_angle_deg", "source[0].offset_mm[2]", "source[0].sides_mm[1]",
    "source[0].remanence_T", "source[1].current_A", "source[1].centre_mm[0]",
    "source[2].flux_mT", "source[2].angle_deg",
)  # fmt: skip


@pytest.mark.parametrize("field", [Uniform(flux_mT=60.0), FIELD.sources[0]])
def test_a_planar_rod_has_the_derivatives_of_the_plane(field) -> None:
    """Exact columns of another march: 1e-9 of the largest, at every arc length."""
    rod = replace(gmc(2), density_kg_m3=2640.0)
    support = Support(gravity_m_s2=(1.0, -9.0, 0.0), clamp_angle_deg=5.0)
    names = ["E_MPa[0]", "E_MPa[2]", "length_mm[1]", "side_mm", "remanence_mT[2]"]
    names += ["clamp_angle_deg", "load_factor", "gravity_m_s2[1]", "density_kg_m3"]
    names += ["gap_mm", "remanence_T"] if field.kind == "cuboid" else ["angle_deg"]
    if field.kind == "cuboid":
        field = replace(field, elevation_deg=0.0, offset_mm=(3.0, 0.0, 0.0))
    s_mm = np.array([3.0, 9.0, 14.0, 21.5, 30.0])
    flat = sensitivities(rod, field, parameters=names, support=support, s_mm=s_mm)
    case = rod, Field(field), support
    positions, tangents, _, error = shape_changes(case, names, s_mm)
    for k in range(len(names)):
        size = np.abs(flat.dy_mm[:, k]).max()
        assert positions[:, 0, k] == pytest.approx(flat.dx_mm[:, k], abs=1e-9 * size)
        assert positions[:, 1, k] == pytest.approx(flat.dy_mm[:, k], abs=1e-9 * size)
        assert np.abs(tangents[:, 2, k]).max() < 1e-9 * size
    assert error < 1e-7


def test_derivatives_lead_to_solved_neighbours() -> None:
    """Richardson's differences of whole solves, which know nothing of the theorem."""
    s_mm = np.linspace(0.0, 20.0, 21)
    found = sensitivities(ROD, FIELD, parameters=NAMES, support=HELD, s_mm=s_mm)
    assert found.error < 1e-8
    assert found.solution.z_mm is not None
    for k, name in enumerate(NAMES):
        move = move_of(name, (ROD, FIELD, HELD))
        rough, fine = (
            _difference(move, step * move.scale, name, s_mm) for step in (4e-3, 2e-3)
        )
        exact = (16.0 * fine - rough) / 15.0
        ours = np.array([found.dx_mm[-1, k], found.dy_mm[-1, k], found.dz_mm[-1, k]])
        assert ours == pytest.approx(exact, abs=1e-8 * np.abs(exact).max()), name


def _difference(move, step: float, name: str, s_mm) -> np.ndarray:
    """Return the tip's derivative by a difference of the fourth order."""
    ends = []
    for k in (-2.0, -1.0, 1.0, 2.0):
        rod, field, support = move.moved(k * step)
        space = solve_spatial(rod, field, support=support, points=2)
        tip = space.r_mm[-1]
        if name.startswith("length"):
            tip = tip - k * step * found_tangent()
        ends.append(tip)
    return (ends[0] - 8.0 * ends[1] + 8.0 * ends[2] - ends[3]) / (12.0 * step)


def found_tangent() -> np.ndarray:
    return solve_spatial(ROD, FIELD, support=HELD, points=2).tangent[-1]


def test_the_plane_says_what_it_lacks_of_a_source() -> None:
    with pytest.raises(InputError, match="its strength, angle or place, not its size"):
        sensitivities(gmc(2), Cuboid(sides_mm=40.0, remanence_T=1.0, gap_mm=50.0),
                      parameters=["source[0].sides_mm[0]"])  # fmt: skip


def test_what_cannot_be_asked_is_said() -> None:
    for name, words in (
        ("E_MPa[2]", "one of 2 sections"),
        ("E_MPa", "such as E_MPa"),
        ("side_mm", "such as E_MPa"),
        ("source[3].current_A", "such as E_MPa"),
        ("source[0].kind", "such as E_MPa"),
        ("gravity_m_s2", "such as E_MPa"),
        ("remanence_T", "such as E_MPa"),
        ("source[1].turns", "is a count"),
    ):
        with pytest.raises(InputError, match=words):
            sensitivities(ROD, FIELD, parameters=[name], support=HELD)
    half = replace(ROD, poisson_ratio=0.5)
    with pytest.raises(InputError, match="both ways"):
        sensitivities(half, FIELD, parameters=["poisson_ratio"], support=HELD)
