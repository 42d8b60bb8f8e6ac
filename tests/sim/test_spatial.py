"""The rod in space against planar solver, distributed equations, closed forms."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from magbend.core.cross_section import torsion_constant_mm4
from magbend.core.errors import InputError
from magbend.core.magnet import Magnet
from magbend.core.units import GRAVITY_M_PER_S2, MU0
from magbend.sim import MagnetField, Support, UniformField, gmc
from magbend.sim.magnet.field import magnet_flux_mT, magnet_gradient_mT_per_mm
from magbend.sim.one_rod import solve
from magbend.sim.scaling import field_array
from magbend.sim.spatial.index import morse_index
from magbend.sim.spatial.march import AXIAL, MU1, MU2, flux_at
from magbend.sim.spatial.rod import rod_table
from magbend.sim.spatial.solver import SpatialRod, SpatialSection, solve_spatial

SIM = Path(__file__).parents[2] / "fixtures" / "sim"
CUBE = Magnet.cube(55.0, 1.305)
ABOVE = Support(gravity_m_s2=(0.0, 0.0, -GRAVITY_M_PER_S2))
G = np.array([3.0, -5.0, -9.0])


@settings(max_examples=20, deadline=None)
@given(
    number=st.integers(1, 7),
    flux=st.floats(1.0, 120.0),
    angle=st.floats(-170.0, 170.0),
    clamp=st.floats(-60.0, 60.0),
)
def test_planar_cases_agree(
    number: int, flux: float, angle: float, clamp: float
) -> None:
    rod = replace(gmc(number), density_kg_m3=2640.0)
    field = UniformField(flux_mT=flux, angle_deg=angle)
    support = Support(clamp_angle_deg=clamp, gravity_m_s2=(2.0, -4.0, 0.0))
    flat = solve(rod, field, support=support)
    space = solve_spatial(rod, field, support=support)
    miss = np.abs(space.r_mm[:, :2] - flat.centreline.points_mm).max()
    assert miss < 1e-8
    assert miss < space.error_mm + flat.error_mm + 1e-11
    assert np.abs(space.r_mm[:, 2]).max() < 1e-12


def test_cube_magnet_table() -> None:
    for row in json.loads((SIM / "gmc_cuboid.json").read_text())["rows"]:
        rod = replace(gmc(2), remanence_mT=row["M_sign"] * 20.07)
        space = solve_spatial(rod, MagnetField(magnet=CUBE, gap_mm=row["d_mm"]))
        tip = [float(text) for text in row["tip_mm"]]
        assert space.r_mm[-1] == pytest.approx(tip, abs=1e-10)
        tangent = [float(text) for text in row["tip_tangent"]]
        assert space.tangent[-1] == pytest.approx(tangent, abs=1e-11)


def section(**changes) -> SpatialSection:
    plain = {"length_mm": 10.0, "E_MPa": 15.0, "width_mm": 1.0, "height_mm": 1.0}
    return SpatialSection(**(plain | changes))


MIXED = SpatialRod(
    sections=(
        section(E_MPa=20.0, remanence_mT=(3.0, -2.0, 20.0)),
        section(width_mm=1.4, remanence_mT=(0.0, 0.0, 25.0)),
        section(
            round_section=True, remanence_mT=(0.0, 10.0, 15.0),
            rest_curvature_per_mm=(0.01, -0.02, 0.03),
        ),
    ),
    density_kg_m3=2640.0,
)  # fmt: skip
OFF = replace(CUBE, offset_mm=(3.0, 2.0, 8.0), elevation_deg=20.0, axis_angle_deg=70.0)


def distributed_root(rod: SpatialRod, field, tip, directors, gravity):
    """Integrate the full distributed equations from a free tip; return the root's pose.

    Fixed components, SI; torque and force of the whole magnetisation, no pole load.
    """
    length = rod.length_mm

    def flux(r):
        if isinstance(field, MagnetField):
            keys = {"length_mm": length, "gap_mm": field.gap_mm}
            point = r * 1e3
            return (
                magnet_flux_mT(field.magnet, point, **keys) * 1e-3,
                magnet_gradient_mT_per_mm(field.magnet, point, **keys),
            )
        return np.array(field) * 1e-3, np.zeros((3, 3))

    def slope(s, y, part):
        r, d, m, n = y[:3], y[3:12].reshape(3, 3), y[12:15], y[15:]
        area = part.area_mm2 * 1e-6
        mu = area / MU0 * 1e-3 * np.array(part.remanence_mT) @ d
        stiff = np.array(part.stiffness_Nmm2) * 1e-6
        rest = np.array(part.rest_curvature_per_mm) * 1e3
        u = ((d @ m) / stiff + rest) @ d
        B, grad = flux(r)
        weight = rod.density_kg_m3 * area * gravity
        return np.concatenate(
            [
                d[2], np.cross(u, d).ravel(),
                -np.cross(d[2], n) - np.cross(mu, B), -(mu @ grad) - weight,
            ]
        )  # fmt: skip

    y = np.concatenate([tip * 1e-3, directors.ravel(), np.zeros(6)])
    s = length * 1e-3
    for part in rod.sections[::-1]:
        end = s - part.length_mm * 1e-3
        y = solve_ivp(
            slope, (s, end), y, args=(part,), method="DOP853", rtol=1e-11, atol=1e-13
        ).y[:, -1]
        s = end
    return y[:3] * 1e3, y[3:12].reshape(3, 3), y[12:15]


@pytest.mark.parametrize(
    "field", [(20.0, 40.0, 30.0), MagnetField(magnet=OFF, gap_mm=50.0)]
)
def test_distributed_equations_lead_back_to_the_clamp(field) -> None:
    """Tilted moments, rest curvature, three profiles, weight askew, twist."""
    support = Support(gravity_m_s2=tuple(G), clamp_angle_deg=10.0)
    space = solve_spatial(MIXED, field, support=support)
    root, directors, moment = distributed_root(
        MIXED, field, space.r_mm[-1], space.directors[-1], G
    )
    angle = np.radians(10.0)
    clamp = [
        [-np.sin(angle), np.cos(angle), 0.0],
        [0.0, 0.0, 1.0],
        [np.cos(angle), np.sin(angle), 0.0],
    ]
    assert root == pytest.approx(np.zeros(3), abs=1e-8)
    assert directors == pytest.approx(np.array(clamp), abs=1e-9)
    assert moment == pytest.approx(space.root_moment_Nm, rel=1e-7)
    assert abs(space.curvature_per_mm[:, 2]).max() > 1e-3
    assert space.error_mm < 1e-6


def test_planarity_before_a_magnet_off_the_plane() -> None:
    """A square axial rod bends in the plane of its root and B at its tip, untwisted."""
    space = solve_spatial(gmc(2), MagnetField(magnet=OFF, gap_mm=50.0))
    assert abs(space.r_mm[-1, 2]) > 0.1
    normal = np.cross([1.0, 0.0, 0.0], space.flux_tip_mT)
    normal /= np.linalg.norm(normal)
    assert np.abs(space.r_mm @ normal).max() < 1e-10
    assert np.abs(space.curvature_per_mm[:, 2]).max() < 1e-14


def test_rest_curvature_and_twist_make_a_helix() -> None:
    rod = SpatialRod(sections=(section(rest_curvature_per_mm=(0.0, 0.2, 0.1)),))
    space = solve_spatial(rod, (0.0, 0.0, 0.0))
    turn = np.hypot(0.2, 0.1)
    radius, rise = 0.2 / turn**2, 0.1 / turn
    axis = np.array([0.1, 0.0, 0.2]) / turn
    along = space.r_mm @ axis
    assert along == pytest.approx(space.s_mm * rise, abs=1e-9)
    across = space.r_mm - np.outer(along, axis)
    centre = np.array([0.0, radius, 0.0])
    assert np.linalg.norm(across - centre, axis=1) == pytest.approx(radius, abs=1e-9)


def test_small_sag_of_a_rectangular_beam() -> None:
    rod = SpatialRod(
        sections=(section(length_mm=20.0, width_mm=2.0, height_mm=0.8),),
        density_kg_m3=1000.0,
    )
    for gravity, extent in ((2, 0.8), (1, 2.0)):
        pull = np.zeros(3)
        pull[gravity] = -0.1
        other = 1.6 / extent
        stiff = 15e6 * other * extent**3 * 1e-12 / 12.0
        sag = 1000.0 * 1.6e-6 * 0.1 * 0.02**4 / (8.0 * stiff) * 1e3
        support = Support(gravity_m_s2=tuple(pull))
        tip = solve_spatial(rod, (0.0, 0.0, 0.0), support=support).r_mm[-1]
        assert tip[gravity] == pytest.approx(-sag, rel=1e-6)


def test_torsion_constants() -> None:
    """Timoshenko and Goodier, Theory of Elasticity, table of rectangles."""
    assert torsion_constant_mm4(1.0, 1.0) == pytest.approx(0.140577014955155, rel=1e-13)
    assert torsion_constant_mm4(1.6, 0.8) == pytest.approx(
        0.4573633542391 * 0.8**4, rel=1e-12
    )
    assert torsion_constant_mm4(2.0, 1.0) == pytest.approx(2 * 0.2287, abs=1e-4)
    assert torsion_constant_mm4(1.0, 10.0) == pytest.approx(10 * 0.3123, abs=1e-3)
    circle = section(width_mm=2.0, height_mm=2.0, round_section=True)
    bending, _, twisting = circle.stiffness_Nmm2
    assert bending == pytest.approx(15.0 * np.pi / 4.0)
    assert twisting == pytest.approx(15.0 / 2.98 * np.pi / 2.0)


def test_straight_square_rod_buckles_in_two_directions() -> None:
    """One unstable direction in the plane, two in space: the zero is double."""
    for flux, index in ((150.0, 0), (400.0, 2), (3000.0, 4)):
        field = UniformField(flux_mT=flux, angle_deg=180.0)
        assert solve_spatial(gmc(2), field).morse_index == index
        assert 2 * solve(gmc(2), field).morse_index == index


def test_flat_strip_buckles_the_weak_way_first() -> None:
    strip = SpatialRod(
        sections=(
            section(
                length_mm=30.0, width_mm=2.0, height_mm=0.5,
                remanence_mT=(0.0, 0.0, 20.0),
            ),
        )
    )  # fmt: skip
    euler_T = (np.pi / 2) ** 2 * 15e6 * 0.25e-12 / 12 / (0.03**2 * 1e-6 * 0.02 / MU0)
    for factor, index in ((0.99, 0), (1.01, 1), (16.1, 3)):
        field = (-euler_T * factor * 1e3, 0.0, 0.0)
        # At 9 the second weak mode, at 16 the first of the strong axis.
        assert solve_spatial(strip, field).morse_index == index


def test_weight_seen_from_above() -> None:
    rod = replace(gmc(2), density_kg_m3=2640.0)
    field = MagnetField(magnet=CUBE, gap_mm=60.0)
    space = solve_spatial(rod, field, support=ABOVE)
    view = solve(rod, field, support=ABOVE)
    assert -1.8 < space.r_mm[-1, 2] < -1.7
    assert view.centreline.tip_mm == pytest.approx(tuple(space.r_mm[-1, :2]))
    slope = np.gradient(view.centreline.theta_rad, view.centreline.s_mm)
    inner = np.abs(slope - view.centreline.kappa_per_mm)[2:-2]
    joints = np.isin(
        view.centreline.s_mm[2:-2].round(6), (9.5, 10, 10.5, 19.5, 20, 20.5)
    )
    assert inner[~joints].max() < 2e-6


def test_csv_holds_the_shape() -> None:
    space = solve_spatial(gmc(2), (0.0, 30.0, 30.0), points=7)
    rows = list(csv.DictReader(space.to_csv().splitlines()))
    assert [float(row["z_mm"]) for row in rows] == pytest.approx(space.r_mm[:, 2])
    names = "s_mm,x_mm,y_mm,z_mm,tx,ty,tz,kappa1_per_mm,kappa2_per_mm,twist_per_mm"
    assert ",".join(rows[0]) == names


def test_pulled_in_is_a_result() -> None:
    strong = replace(gmc(2), remanence_mT=-200.0)
    field = MagnetField(magnet=replace(CUBE, elevation_deg=1.0), gap_mm=16.0)
    space = solve_spatial(strong, field)
    assert space.status.startswith("pulled in")
    assert len(space.s_mm) == 0
    assert space.seen_from_above().centreline is None


@pytest.mark.parametrize("turn", [0.9, 3.0, 40.0])
def test_an_unloaded_rod_has_its_rest_shape(turn) -> None:
    rod = SpatialRod(
        sections=(
            section(length_mm=30.0, rest_curvature_per_mm=(0.0, turn / 30.0, 0.0)),
        )
    )
    space = solve_spatial(rod, (0.0, 0.0, 0.0))
    angle = turn * space.s_mm / 30.0
    arc = np.column_stack([np.sin(angle), 1.0 - np.cos(angle)]) * 30.0 / turn
    assert space.r_mm[:, :2] == pytest.approx(arc, abs=1e-7)
    assert space.morse_index == 0


@pytest.mark.parametrize("points", [2, 5, 61])
@pytest.mark.parametrize("clearance_mm", [0.45, 0.55])
def test_a_magnet_above_is_touched_between_points_too(points, clearance_mm) -> None:
    """An edge of a cube of 2 mm points at an arch, half a side of which is 0.5 mm."""
    rod = SpatialRod(
        sections=(section(length_mm=30.0, rest_curvature_per_mm=(-0.03, 0.0, 0.0)),)
    )
    top = solve_spatial(rod, (0.0, 0.0, 0.0)).r_mm
    assert top[-1, 2] > 5.0
    # On the arch's outer normal where it turns by 45 deg, below the bend.
    turn = np.pi / 4.0
    x_mm = np.sin(turn) / 0.03 + clearance_mm * np.sin(turn)
    z_mm = (1.0 - np.cos(turn)) / 0.03 - clearance_mm * np.cos(turn)
    cube = Magnet.cube(2.0, 1e-6, offset_mm=(x_mm - 18.0, 0.0, z_mm - 1.0))
    field = MagnetField(magnet=replace(cube, axis_angle_deg=0.0), gap_mm=10.0)
    if clearance_mm > 0.5:
        assert len(solve_spatial(rod, field, points=points).s_mm) == points
        return
    with pytest.raises(InputError, match="undeformed rod clear of the magnet"):
        solve_spatial(rod, field, points=points)


def test_a_magnet_in_the_way_of_the_straight_rod_only_is_no_hindrance() -> None:
    """What counts before the load is the rest shape, here a quarter of a circle."""
    rest = (0.0, np.pi / 60.0, 0.0)
    rod = SpatialRod(sections=(section(length_mm=30.0, rest_curvature_per_mm=rest),))
    ahead = MagnetField(magnet=Magnet.cube(4.0, 1e-6, axis_angle_deg=180.0), gap_mm=3.0)
    before = replace(ahead, magnet=replace(ahead.magnet, offset_mm=(-10.0, 0.0, 0.0)))
    space = solve_spatial(rod, before)
    assert space.r_mm[-1, :2] == pytest.approx([60.0 / np.pi] * 2, abs=1e-4)
    with pytest.raises(InputError, match="undeformed rod clear"):
        solve_spatial(replace(rod, sections=(section(length_mm=30.0),)), before)


def test_bad_input_is_refused() -> None:
    with pytest.raises(InputError, match="density_kg_m3"):
        solve_spatial(gmc(2), (0.0, 1.0, 0.0), support=ABOVE)
    with pytest.raises(InputError, match="three floats"):
        solve_spatial(gmc(2), (0.0, 1.0))
    with pytest.raises(InputError, match="flux_mT"):
        solve_spatial(gmc(2), (0.0, 1e5, 0.0))
    with pytest.raises(InputError, match="width_mm"):
        section(width_mm=-1.0)
    with pytest.raises(InputError, match="at least one"):
        SpatialRod(sections=())
    with pytest.raises(InputError, match="gap_mm"):
        solve_spatial(gmc(2), MagnetField(magnet=CUBE, gap_mm=0.1))
    with pytest.raises(InputError, match="stiffness"):
        solve_spatial(SpatialRod(sections=(
            section(length_mm=1000.0, E_MPa=0.01, remanence_mT=(0.0, 0.0, 100.0)),
        )), (0.0, 1000.0, 0.0))  # fmt: skip


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    load=st.floats(0.5, 15.0),
    thin=st.floats(0.4, 1.0),
)
def test_index_in_a_uniform_field_is_that_of_six_unknowns(seed, load, thin) -> None:
    """A magnet so far away that its field is uniform takes the general road."""
    rng = np.random.default_rng(seed)
    rod = SpatialRod(
        sections=tuple(
            section(E_MPa=E, height_mm=thin, remanence_mT=tuple(rng.normal(size=3)))
            for E in (20.0, 15.0, 10.0)
        )
    )
    table = rod_table(rod, Support())
    table[:, [AXIAL, MU1, MU2]] *= load / np.abs(table[:, AXIAL : MU2 + 1]).max()
    cube = Magnet.cube(100.0, 1.0)
    block = field_array(MagnetField(magnet=cube, gap_mm=1e6), 30.0).copy()
    b = np.zeros(12)
    flux_at(block, 1.0, 0.0, 0.0, b)
    strength = np.linalg.norm(b[:3])
    block[-1] = 1.0 / strength
    uniform = np.zeros_like(block)
    uniform[1:4] = b[:3] / strength
    pose, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    pose *= np.linalg.det(pose)
    pose = np.ascontiguousarray(pose)
    tip = np.array([1.0, 0.0, 0.0])
    index = morse_index(table, uniform, 1.0, 60.0, pose, tip)
    assert index == morse_index(table, block, 1.0, 60.0, pose, tip)
    near = field_array(MagnetField(magnet=cube, gap_mm=60.0), 30.0)
    index = morse_index(table, near, 1.0, 60.0, pose, tip)
    assert index == morse_index(table, near, 1.0, 240.0, pose, tip)
