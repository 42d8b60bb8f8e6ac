"""Rods, fields and poses that nobody chose: the planar solver's promises as properties.

Against the check solver (distributed loads, no march), a finer march, and load
continuation in many steps.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from magbend.core.errors import InputError, SolverError
from magbend.core.magnet import Magnet
from magbend.core.specimen import Section, Specimen
from magbend.core.units import MU0
from magbend.sim import (
    PULLED_IN,
    STABLE,
    MagnetField,
    Solution,
    Support,
    UniformField,
    sensitivities,
    solve,
)
from magbend.sim.check.solver import check_solve
from magbend.sim.fields import Field
from magbend.sim.planar.follow import follow_load
from magbend.sim.planar.solver import GONE, OK_STABLE, solve_planar
from magbend.sim.planar.swing import swing_index
from magbend.sim.scaling import field_array, rod_array, stations
from magbend.sim.spatial.solver import solve_spatial


def signed(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high) | st.floats(-high, -low)


SECTIONS = st.builds(
    Section,
    length_mm=st.floats(2.0, 20.0),
    E_MPa=st.floats(2.0, 50.0),
    side_mm=st.none() | st.floats(0.5, 1.5),
    remanence_mT=st.none() | signed(2.0, 40.0),
)
RODS = st.builds(
    Specimen,
    name=st.just("any"),
    side_mm=st.floats(0.6, 1.5),
    remanence_mT=signed(2.0, 40.0),
    sections=st.lists(SECTIONS, min_size=1, max_size=6).map(tuple),
    density_kg_m3=st.just(2600.0),
)
UNIFORM = st.builds(
    UniformField,
    flux_mT=signed(1.0, 200.0),
    angle_deg=st.floats(-180.0, 180.0) | signed(150.0, 179.9),
)
MAGNETS = st.builds(
    MagnetField,
    magnet=st.builds(
        Magnet,
        sides_mm=st.tuples(*[st.floats(10.0, 60.0)] * 3),
        remanence_T=signed(0.3, 1.45),
        axis_angle_deg=st.floats(-180.0, 180.0),
        offset_mm=st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.just(0.0)),
    ),
    gap_mm=st.floats(5.0, 120.0),
)
SUPPORTS = st.just(Support()) | st.builds(
    Support,
    clamp_angle_deg=st.floats(-180.0, 180.0),
    gravity_m_s2=st.tuples(st.floats(-9.8, 9.8), st.floats(-9.8, 9.8), st.just(0.0)),
    load_factor=st.floats(0.0, 2.0),
)
CASE = {"rod": RODS, "field": UNIFORM | MAGNETS, "support": SUPPORTS}


def attempt(rod: Specimen, field: Field, support: Support) -> Solution | None:
    """The solution, or None where the solver says, in words, that it has none."""
    try:
        return solve(rod, field, support=support)
    except (InputError, SolverError):
        return None


@settings(max_examples=300, deadline=None)
@given(**CASE)
def test_every_shape_is_within_its_bound_of_a_finer_march(
    rod: Specimen, field: Field, support: Support
) -> None:
    solution = attempt(rod, field, support)
    assume(solution is not None)
    assert solution is not None
    line = solution.centreline
    if line is None:
        assert solution.status == PULLED_IN
        assert 0.0 <= solution.load_limit < 1.0
        return
    outcome, index, _, error, *_, fine, _ = solve_planar(
        rod_array(rod, support),
        field_array(field, rod.length_mm),
        math.radians(support.clamp_angle_deg),
        0.0,
        stations(61),
        20,
        0.15,
    )
    assert outcome < GONE
    assert index == solution.morse_index
    miss_mm = np.hypot(*(line.points_mm.T - fine[:2] * rod.length_mm)).max()
    assert miss_mm <= solution.error_mm + error * rod.length_mm
    assert solution.error_mm < 1e-8 * rod.length_mm


@settings(max_examples=30, deadline=None)
@given(**CASE)
def test_every_shape_is_an_equilibrium_of_the_distributed_load(
    rod: Specimen, field: Field, support: Support
) -> None:
    solution = attempt(rod, field, support)
    assume(solution is not None and solution.centreline is not None)
    assert solution is not None
    line = solution.centreline
    assert line is not None
    check = check_solve(
        rod, field, support=support, degree=10, elements=3,
        start=(line.s_mm, line.theta_rad),
    )  # fmt: skip
    x_mm, y_mm = check.at(line.s_mm)
    # What ten degrees on a third of a section leave in a boundary layer.
    layer = np.abs(line.kappa_per_mm).max() * max(s.length_mm for s in rod.sections)
    assert np.hypot(x_mm - line.x_mm, y_mm - line.y_mm).max() < 1e-8 * (1.0 + layer**9)
    assert check.morse_index == solution.morse_index


def near_magnets(count: int) -> list[tuple[Specimen, MagnetField]]:
    """Soft rods before magnets so near that many are attracted or snap."""
    rng = np.random.default_rng(20)
    found = []
    for _ in range(count):
        parts = int(rng.integers(1, 6))
        lengths, moduli = rng.uniform(2, 20, parts), 10 ** rng.uniform(0.3, 1.7, parts)
        rod = Specimen(
            name="near",
            side_mm=float(rng.uniform(0.5, 1.5)),
            remanence_mT=float(rng.uniform(5.0, 60.0) * rng.choice([-1.0, 1.0])),
            sections=tuple(
                Section(length_mm=float(a), E_MPa=float(b))
                for a, b in zip(lengths, moduli, strict=True)
            ),
        )
        shift = rng.uniform(-20.0, 20.0, 2)
        magnet = Magnet(
            sides_mm=(40.0, 30.0, 25.0),
            remanence_T=float(rng.choice([-1.2, 1.2])),
            axis_angle_deg=float(rng.uniform(-180.0, 180.0)),
            offset_mm=(float(shift[0]), float(shift[1]), 0.0),
        )
        found.append((rod, MagnetField(magnet=magnet, gap_mm=rng.uniform(3.0, 40.0))))
    return found


def test_near_a_magnet_too_the_branch_is_the_one_from_zero_load() -> None:
    compared = 0
    for rod, field in near_magnets(500):
        row, array = rod_array(rod, Support()), field_array(field, rod.length_mm)
        found = solve_planar(row, array, 0.0, 0.0, stations(61), 16, 0.3)
        if found[0] == OK_STABLE:
            u = np.zeros(4)
            index, load = follow_load(row, array, 0.0, u, 16, 0.3)
            assert (index, load) == (0, 1.0)
            assert found[7][2, -1] == pytest.approx(u[0] + u[3], abs=1e-6)
            compared += 1
    assert compared > 200


def test_a_straight_rod_unstable_under_full_load_does_not_jump() -> None:
    # Newton from the straight rod converges quickly here, to the other side.
    lengths = (11.9981157, 9.48684489, 11.7373261, 6.63903149, 6.12291517)
    moduli = (12.66475745, 18.37485545, 35.39169649, 20.0739456, 4.02414948)
    rod = Specimen(
        name="attracted",
        side_mm=0.9841742297671212,
        remanence_mT=-30.16803836070597,
        sections=tuple(
            Section(length_mm=a, E_MPa=b) for a, b in zip(lengths, moduli, strict=True)
        ),
    )
    magnet = Magnet(
        sides_mm=(17.032380067239018, 20.88456452403924, 42.84162937605902),
        remanence_T=-0.8295166532620142,
        axis_angle_deg=-91.47287178008833,
        offset_mm=(18.766196544171187, -6.049459333133669, 0.0),
    )
    field = MagnetField(magnet=magnet, gap_mm=14.902621469225618)
    tips = []
    for k in range(1, 101):
        line = solve(rod, field, support=Support(load_factor=k / 100)).centreline
        assert line is not None
        tips.append(line.tip_mm)
    assert np.hypot(*np.diff(tips, axis=0).T).max() < 0.2


def test_a_branch_without_symmetry_is_stable_up_to_its_fold() -> None:
    # Nothing but a symmetry makes equilibria cross: an unstable one is another branch.
    for rod, field in near_magnets(600):
        solution = attempt(rod, field, Support())
        assert solution is None or solution.morse_index <= 0


def test_the_rod_in_space_finds_the_planar_branch_near_magnets_too() -> None:
    """By a march and a continuation of its own; it counts all directions."""
    swinging = []
    for rod, field in near_magnets(600):
        if (flat := attempt(rod, field, Support())) is None:
            continue
        space = solve_spatial(rod, field)
        assert space.load_limit == pytest.approx(flat.load_limit, abs=3e-5)
        if flat.centreline is None:
            assert len(space.s_mm) == 0
            continue
        miss_mm = np.abs(space.r_mm[:, :2] - flat.centreline.points_mm).max()
        assert miss_mm < 1e-5
        assert np.abs(space.r_mm[:, 2]).max() < 1e-5
        row, array = rod_array(rod, Support()), field_array(field, rod.length_mm)
        tip = solve_planar(row, array, 0.0, 0.0, stations(2), 16, 0.3)[8]
        swings = swing_index(row, array, tip, 0.3)
        assert space.morse_index == flat.morse_index + swings
        assert flat.stable_in_space is (space.morse_index == 0)
        swinging.append(swings)
    assert len(swinging) > 300
    assert max(swinging) == 1


def test_a_straight_rod_is_as_stable_in_every_direction() -> None:
    # Euler's loads at (2 n - 1)^2 pi^2 / 4, against a uniform field.
    sections = (Section(length_mm=15.0, E_MPa=10.0),) * 2
    for load, index in ((2.4, 0), (2.5, 1), (22.1, 1), (22.3, 2)):
        EI_Nm2 = 10e6 * 1e-12 / 12.0
        remanence_mT = load * EI_Nm2 / 0.03**2 / 0.1 * MU0 / 1e-6 * 1e3
        rod = Specimen(
            name="Euler", side_mm=1.0, remanence_mT=remanence_mT, sections=sections
        )
        field = UniformField(flux_mT=100.0, angle_deg=180.0)
        row, array = rod_array(rod, Support()), field_array(field, 30.0)
        tip = solve_planar(row, array, 0.0, 0.01, stations(2), 16, 0.3)[8]
        assert swing_index(row, array, tip, 0.3) == index


def test_a_rod_drawn_round_a_magnet_is_stable_in_the_plane_only() -> None:
    flags = [
        solution.stable_in_space
        for rod, field in near_magnets(150)
        if (solution := attempt(rod, field, Support())) and solution.centreline
    ]
    assert {True, False} == set(flags)


def test_derivatives_near_magnets_are_the_slopes() -> None:
    compared = 0
    for rod, field in near_magnets(120):
        if (found := attempt(rod, field, Support())) is None or not found.centreline:
            continue
        exact = sensitivities(rod, field, parameters=["load_factor", "gap_mm"])

        def tips(step: float, rod=rod, field=field) -> list[np.ndarray]:
            loads = [Support(load_factor=1.0 + k * step) for k in (-1, 1)]
            gaps = [replace(field, gap_mm=field.gap_mm + k * step) for k in (-1, 1)]
            lines = [solve(rod, field, support=load).centreline for load in loads]
            lines += [solve(rod, gap).centreline for gap in gaps]
            return [np.array(line.tip_mm) if line else np.nan for line in lines]

        wide, fine = tips(2e-4), tips(1e-4)
        for k in range(2):
            first, last = 2 * k, 2 * k + 1
            rough = (wide[last] - wide[first]) / 4e-4
            slope = (fine[last] - fine[first]) / 2e-4
            error = np.abs(slope - rough).max() / 3.0  # of second order
            slope = slope + (slope - rough) / 3.0
            here = np.array([exact.dx_mm[-1, k], exact.dy_mm[-1, k]])
            if error < 1e-4 * np.abs(here).max():  # not at a fold
                assert slope == pytest.approx(here, rel=1e-6, abs=1e-5 * error + 1e-6)
                compared += 1
    assert compared > 80


def plain_rod(E_MPa: float) -> Specimen:
    return Specimen(
        name="plain", side_mm=1.0, remanence_mT=20.0,
        sections=(Section(length_mm=30.0, E_MPa=E_MPa),),
    )  # fmt: skip


@pytest.mark.parametrize("points", [2, 5, 61, 400])
@pytest.mark.parametrize("clearance_mm", [0.45, 0.55])
def test_whether_a_rod_touches_does_not_depend_on_its_points(
    points: int, clearance_mm: float
) -> None:
    # An edge of the magnet points at the rod's side, 16.7 mm from the clamp; the rod
    # itself takes up 0.5 mm.
    x_mm, y_mm = 16.7, -math.sqrt(2.0) - clearance_mm
    back_mm = 11.0 / math.sqrt(2.0)  # from the undeformed tip, each way
    magnet = Magnet(
        sides_mm=(2.0, 2.0, 2.0),
        remanence_T=1e-6,
        axis_angle_deg=45.0,
        offset_mm=(x_mm - 30.0 + back_mm, y_mm + back_mm, 0.0),
    )
    field = MagnetField(magnet=magnet, gap_mm=10.0)
    for solver in (solve, solve_spatial):
        if clearance_mm < 0.5:
            with pytest.raises(InputError, match="gap_mm"):
                solver(plain_rod(10.0), field, points=points)
        else:
            assert solver(plain_rod(10.0), field, points=points).status == STABLE


def test_a_rod_that_bends_onto_the_magnet_says_at_which_load() -> None:
    magnet = Magnet.cube(12.0, 1.3, offset_mm=(-15.0, 0.0, 0.0))  # type: ignore[arg-type]
    field = MagnetField(magnet=magnet, gap_mm=0.8)
    solution = solve(plain_rod(3.0), field)
    assert solution.status == PULLED_IN
    space = solve_spatial(plain_rod(3.0), field)
    assert space.load_limit == pytest.approx(solution.load_limit, abs=1e-5)
    # Just before, the magnet is half a side away, and that is before any fold.
    before = Support(load_factor=solution.load_limit * (1.0 - 1e-5))
    line = solve(plain_rod(3.0), field, support=before).centreline
    assert line is not None
    beyond = np.abs(line.points_mm - (15.0, -6.8)) - 6.0
    gaps_mm = np.hypot(*np.maximum(beyond, 0.0).T)
    assert gaps_mm.min() == pytest.approx(0.5, abs=1e-4)
