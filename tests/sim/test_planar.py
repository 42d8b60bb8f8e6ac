"""The planar solver: certified tables, branches, outcomes, bad input."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from magbend.core.errors import InputError, SolverError
from magbend.core.magnet import Magnet
from magbend.core.specimen import Section, Specimen
from magbend.core.units import MU0
from magbend.sim import (
    PULLED_IN,
    STABLE,
    UNSTABLE,
    MagnetField,
    Support,
    UniformField,
    gmc,
    solve,
)
from magbend.sim.planar.follow import newton, straight
from magbend.sim.planar.march import MAX_ORDER, STATE
from magbend.sim.planar.solver import GONE, solve_planar
from magbend.sim.scaling import field_array, rod_array

FIXTURES = Path(__file__).resolve().parents[2] / "fixtures" / "sim"
CUBE = Magnet.cube(55.0, 1.305)


def table(name: str) -> list[dict[str, str]]:
    text = (FIXTURES / name).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))


def rod_of_beta(beta: float, *, sections: int = 1) -> Specimen:
    """A uniform rod whose magnetic load m B L^2 / EI is `beta` at 100 mT."""
    length_mm, side_mm, E_MPa = 100.0, 1.0, 10.0
    EI_Nmm2 = E_MPa * side_mm**4 / 12.0
    moment_Am = beta * EI_Nmm2 / length_mm**2 / 0.1
    return Specimen(
        name="reference",
        side_mm=side_mm,
        remanence_mT=moment_Am * MU0 / 1e-6 * 1e3,
        sections=(Section(length_mm=length_mm / sections, E_MPa=E_MPa),) * sections,
    )


@pytest.mark.parametrize(
    "row",
    table("elastica_uniform.csv"),
    ids=lambda row: f"{row['phi_deg']}deg-{row['beta']}",
)
@pytest.mark.parametrize("sections", [1, 3])
def test_hard_magnetic_elastica(row: dict[str, str], sections: int) -> None:
    beta = float(row["beta"])
    field = UniformField(flux_mT=100.0, angle_deg=float(row["phi_deg"]))
    solution = solve(rod_of_beta(beta, sections=sections), field)
    line = solution.centreline
    assert line is not None
    assert solution.status == STABLE
    tolerance = 1e-13 if beta <= 20 else 1e-12
    assert line.theta_rad[-1] == pytest.approx(
        float(row["theta_tip_rad"]), abs=tolerance
    )
    assert line.x_mm[-1] / 100.0 == pytest.approx(float(row["x"]), abs=tolerance)
    assert line.y_mm[-1] / 100.0 == pytest.approx(float(row["y"]), abs=tolerance)
    assert line.kappa_per_mm[0] * 100.0 == pytest.approx(
        float(row["kappa0"]), abs=1e-11
    )
    assert solution.error_mm < 1e-9


@pytest.mark.parametrize(
    ("angle_deg", "beta", "theta", "y"),
    [  # dossier, section 3a: to the digits printed there
        (150, 0.1, 0.0259285754744982, 0.0172596376508649),
        (150, 5, 1.93010434324723, 0.825262080236347),
        (150, 100, 2.61771518524792, 0.593185154293626),
        (179, 0.1, 0.000910514293154554, 0.000605994330608740),
        (179, 2, 0.0936709395699825, 0.0601561000871888),
        (179, 5, 2.18424803985505, 0.796461275378318),
        (179, 20, 3.03335733667875, 0.456351522293866),
        (179, 100, 3.12377931736701, 0.213954305984929),
    ],
)
def test_fields_near_the_axis(
    angle_deg: float, beta: float, theta: float, y: float
) -> None:
    line = solve(rod_of_beta(beta), UniformField(flux_mT=100, angle_deg=angle_deg))
    assert line.centreline is not None
    assert line.centreline.theta_rad[-1] == pytest.approx(theta, abs=1e-13)
    assert line.centreline.y_mm[-1] / 100 == pytest.approx(y, abs=1e-13)


def first_integral(beta: float, angle_deg: float) -> float:
    """How far the solution misses the pendulum's energy and its clamp."""
    solution = solve(rod_of_beta(beta), UniformField(flux_mT=100, angle_deg=angle_deg))
    line = solution.centreline
    assert line is not None
    assert solution.status == STABLE
    phi = math.radians(angle_deg)
    energy = 0.5 * (line.kappa_per_mm * 100) ** 2 + beta * np.cos(phi - line.theta_rad)
    return float(np.ptp(energy)) / beta + abs(line.theta_rad[0])


@pytest.mark.parametrize("angle_deg", [0.1, 90.0, 170.0, 179.0, 179.9])
@pytest.mark.parametrize("beta", [0.5, 2.4, 2.5, 30.0, 100.0, 1000.0, 20000.0])
def test_any_angle_and_any_load_keep_the_first_integral(
    beta: float, angle_deg: float
) -> None:
    assert first_integral(beta, angle_deg) < 1e-11


@pytest.mark.parametrize(
    "row",
    table("gmc_uniform.csv"),
    ids=lambda row: f"gmc{row['gmc']}-{row['B_mT']}mT-{row['phi_deg']}deg",
)
def test_table_1_rods(row: dict[str, str]) -> None:
    field = UniformField(flux_mT=float(row["B_mT"]), angle_deg=float(row["phi_deg"]))
    solution = solve(gmc(int(row["gmc"])), field)
    assert solution.centreline is not None
    x_mm, y_mm = solution.centreline.tip_mm
    assert x_mm == pytest.approx(float(row["x_mm"]), abs=1e-12)
    assert y_mm == pytest.approx(float(row["y_mm"]), abs=1e-12)
    assert solution.root_moment_Nm == pytest.approx(float(row["M0_Nm"]), rel=1e-13)


@pytest.mark.parametrize(
    "row",
    json.loads((FIXTURES / "gmc_cuboid.json").read_text(encoding="utf-8"))["rows"],
    ids=lambda row: f"{row['d_mm']}mm{row['M_sign']:+d}",
)
def test_before_the_cube(row: dict[str, object]) -> None:
    rod = gmc(2)
    rod = replace(rod, remanence_mT=rod.remanence_mT * float(str(row["M_sign"])))
    solution = solve(rod, MagnetField(magnet=CUBE, gap_mm=float(str(row["d_mm"]))))
    assert solution.centreline is not None
    assert solution.status == STABLE
    tip = np.array(row["tip_mm"], dtype=float)[:2]
    # The reference gives 11 decimals.
    assert np.abs(np.array(solution.centreline.tip_mm) - tip).max() < 1e-11


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_mirrored_fields_give_mirrored_shapes(sign: float) -> None:
    up = solve(gmc(3), UniformField(flux_mT=60, angle_deg=sign * 130)).centreline
    down = solve(gmc(3), UniformField(flux_mT=-60, angle_deg=50 * -sign)).centreline
    assert up is not None
    assert down is not None
    assert np.abs(up.y_mm - down.y_mm).max() < 1e-12
    other = solve(gmc(3), UniformField(flux_mT=60, angle_deg=-sign * 130)).centreline
    assert other is not None
    assert np.abs(up.y_mm + other.y_mm).max() < 1e-12


@pytest.mark.parametrize(
    ("angle_deg", "beta", "status", "index"),
    [
        (0, 50.0, STABLE, 0),
        (180, 2.46, STABLE, 0),
        (180, 2.48, UNSTABLE, 1),
        (180, 22.1, UNSTABLE, 1),
        (180, 22.3, UNSTABLE, 2),
    ],
)
def test_along_the_field_the_rod_stays_straight(
    angle_deg: float, beta: float, status: str, index: int
) -> None:
    # Euler loads at (2 n - 1)^2 pi^2 / 4: 2.467, 22.21.
    solution = solve(rod_of_beta(beta), UniformField(flux_mT=100, angle_deg=angle_deg))
    assert solution.centreline is not None
    assert np.abs(solution.centreline.y_mm).max() < 1e-9
    assert (solution.status, solution.morse_index) == (status, index)


def test_curvature_jumps_and_moment_does_not() -> None:
    rod = gmc(2)
    line = solve(rod, UniformField(flux_mT=50), points=3001).centreline
    assert line is not None
    joint = 1000
    assert line.s_mm[joint] == pytest.approx(10.0)
    before, after = line.kappa_per_mm[joint - 1], line.kappa_per_mm[joint]
    assert after / before == pytest.approx(20.0 / 15.0, rel=1e-3)


def test_dense_shape_is_consistent() -> None:
    line = solve(gmc(7), UniformField(flux_mT=120, angle_deg=150), points=6001)
    curve = line.centreline
    assert curve is not None
    step = np.diff(curve.s_mm)
    middle = 0.5 * (curve.theta_rad[1:] + curve.theta_rad[:-1])
    assert np.abs(np.diff(curve.x_mm) / step - np.cos(middle)).max() < 1e-6
    assert np.abs(np.diff(curve.y_mm) / step - np.sin(middle)).max() < 1e-6
    assert abs(curve.x_mm[0]) + abs(curve.y_mm[0]) < 1e-13


def test_clamp_angle_turns_the_rod_in_a_turned_field() -> None:
    straight_up = solve(gmc(2), UniformField(flux_mT=50, angle_deg=90)).centreline
    turned = solve(
        gmc(2),
        UniformField(flux_mT=50, angle_deg=105),
        support=Support(clamp_angle_deg=15.0),
    ).centreline
    assert straight_up is not None
    assert turned is not None
    a = math.radians(15.0)
    x = math.cos(a) * straight_up.x_mm - math.sin(a) * straight_up.y_mm
    y = math.sin(a) * straight_up.x_mm + math.cos(a) * straight_up.y_mm
    assert np.abs(turned.x_mm - x).max() < 1e-12
    assert np.abs(turned.y_mm - y).max() < 1e-12


def test_weight_alone_is_the_heavy_cantilever() -> None:
    rod = replace(gmc(2), remanence_mT=0.0, density_kg_m3=1e-3)
    sections = (Section(length_mm=30.0, E_MPa=20.0),)
    rod = replace(rod, sections=sections)
    g = 9.80665
    line = solve(rod, UniformField(flux_mT=0), support=Support(gravity_m_s2=(0, -g, 0)))
    # w L^4 / 8 EI for small deflections, w = rho A g.
    sag = 1e-3 * 1e-6 * g * 0.03**4 / (8.0 * 20e6 * 1e-12 / 12.0) * 1e3
    assert line.centreline is not None
    assert line.centreline.tip_mm[1] == pytest.approx(-sag, rel=1e-9)


def test_weight_in_the_plane_changes_the_tip_by_a_third() -> None:
    rod = replace(gmc(2), density_kg_m3=2640.0)
    field = MagnetField(magnet=CUBE, gap_mm=60.0)
    down = solve(rod, field, support=Support(gravity_m_s2=(0.0, -9.80665, 0.0)))
    assert down.centreline is not None
    assert down.centreline.tip_mm[1] == pytest.approx(2.714, abs=2e-3)


def test_sections_of_other_side_and_remanence_meet_at_poles() -> None:
    # One section split in three is the same rod; the pole at a joint is the difference.
    whole = Specimen(
        name="whole", side_mm=1.0, remanence_mT=20.0,
        sections=(Section(length_mm=30.0, E_MPa=12.0),),
    )  # fmt: skip
    split = Specimen(
        name="split", side_mm=9.0, remanence_mT=-3.0,
        sections=(Section(length_mm=10.0, E_MPa=12.0, side_mm=1.0, remanence_mT=20.0),)
        * 3,
    )  # fmt: skip
    field = MagnetField(magnet=CUBE, gap_mm=50.0)
    a, b = solve(whole, field).centreline, solve(split, field).centreline
    assert a is not None
    assert b is not None
    assert np.abs(a.points_mm - b.points_mm).max() < 1e-11


def follow_finely(
    rod: np.ndarray, field: np.ndarray, steps: int = 400
) -> tuple[float, float]:
    """Tip angle by 400 equal load steps (NaN past a fold), and where it ended."""
    u = np.zeros(4)
    straight(0.0, u)
    X, D = np.empty(STATE), np.empty((STATE, 4))
    T, C = np.empty((4, MAX_ORDER + 1)), np.empty((MAX_ORDER + 1, 4, 4))
    for k in range(1, steps + 1):
        index = newton(rod, field, k / steps, 0.0, u, 12, 0.4, 0.5, X, D, T, C)
        if index < 0:
            return math.nan, k / steps
    return u[0] + u[3], 1.0


def test_the_branch_is_the_one_from_zero_load() -> None:
    rng = np.random.default_rng(11)
    gone = 0
    for _ in range(120):
        rod = gmc(int(rng.integers(1, 8)))
        factor = 10.0 ** rng.uniform(-0.5, 1.7) * rng.choice([-1.0, 1.0])
        rod = replace(rod, remanence_mT=rod.remanence_mT * factor)
        magnet = Magnet.cube(55.0, 1.305, axis_angle_deg=float(rng.uniform(40, 140)))
        field = field_array(
            MagnetField(magnet=magnet, gap_mm=float(rng.uniform(25, 100))), 30.0
        )
        array = rod_array(rod, Support())
        s = np.linspace(0.0, 1.0, 61)
        nowhere = -1.0  # touching the magnet is another matter
        outcome, _, load, *_, table, _ = solve_planar(
            array, field, 0.0, nowhere, s, 16, 0.3
        )
        theta, _ = follow_finely(array, field)
        if math.isnan(theta):  # a fold, or a turn too sharp for such steps
            theta, end = follow_finely(array, field, 20000)
        if math.isnan(theta):
            gone += 1
            assert outcome == GONE
            assert load == pytest.approx(end, abs=1e-4)
        else:
            assert outcome != GONE
            assert table[2, -1] == pytest.approx(theta, abs=1e-7)
    assert gone >= 2


def test_pulled_in_is_a_result() -> None:
    rod = replace(gmc(3), remanence_mT=-150.0)
    solution = solve(rod, MagnetField(magnet=CUBE, gap_mm=20.0))
    assert solution.status == PULLED_IN
    assert solution.centreline is None
    assert solution.morse_index == -1
    assert 0.0 < solution.load_limit < 1.0


@pytest.mark.parametrize("order", [4, 6, 8, 12])
@pytest.mark.parametrize("gap_mm", [0.0, 50.0])
def test_the_error_estimate_bounds_the_error(order: int, gap_mm: float) -> None:
    s = np.linspace(0.0, 1.0, 61)
    for number in range(1, 8):
        field = (
            MagnetField(magnet=CUBE, gap_mm=gap_mm)
            if gap_mm
            else UniformField(flux_mT=120.0, angle_deg=140.0)
        )
        rod, array = rod_array(gmc(number), Support()), field_array(field, 30.0)
        exact = solve_planar(rod, array, 0.0, 0.01, s, 20, 0.2)[7]
        found = solve_planar(rod, array, 0.0, 0.01, s, order, 0.6)
        miss = np.hypot(*(found[7][:2] - exact[:2])).max()
        assert miss <= found[3]
        if order <= 6:
            assert miss > 1e-15  # else there is nothing to bound


good = {
    "length_mm": st.floats(1.0, 100.0),
    "E_MPa": st.floats(0.05, 1000.0),
    "side_mm": st.floats(0.2, 3.0),
    "remanence_mT": st.floats(-200.0, 200.0),
    "flux_mT": st.floats(-200.0, 200.0),
    "angle_deg": st.floats(-360.0, 360.0),
}


@settings(max_examples=40, deadline=None)
@given(values=st.fixed_dictionaries(good), gravity=st.floats(-20.0, 20.0))
def test_any_rod_in_any_uniform_field_ends_in_an_outcome(
    values: dict[str, float], gravity: float
) -> None:
    rod = Specimen(
        name="any",
        side_mm=values["side_mm"],
        remanence_mT=values["remanence_mT"],
        density_kg_m3=2000.0,
        sections=(Section(length_mm=values["length_mm"], E_MPa=values["E_MPa"]),) * 2,
    )
    field = UniformField(flux_mT=values["flux_mT"], angle_deg=values["angle_deg"])
    support = Support(gravity_m_s2=(0.0, gravity, 0.0))
    try:
        solution = solve(rod, field, support=support)
    except (InputError, SolverError):
        return  # a load beyond the range, or a branch that could not be followed
    if solution.centreline is None:
        assert solution.status == PULLED_IN
        return
    assert math.isfinite(solution.error_mm)
    assert solution.status in (STABLE, UNSTABLE)


BAD = [math.nan, math.inf, -math.inf]


@pytest.mark.parametrize("value", [*BAD, 1e5, -1e5, "much", None])
def test_bad_flux_is_refused_with_its_unit(value: float) -> None:
    with pytest.raises(ValueError, match=r"flux_mT.*(mT|number)"):
        UniformField(flux_mT=value)


@pytest.mark.parametrize("value", [*BAD, 0.0, -5.0])
def test_bad_gap_is_refused_with_its_unit(value: float) -> None:
    with pytest.raises(ValueError, match=r"gap_mm.*mm"):
        MagnetField(magnet=CUBE, gap_mm=value)


@pytest.mark.parametrize("value", [*BAD, 0.0, -1.0])
@pytest.mark.parametrize("name", ["length_mm", "E_MPa", "side_mm"])
def test_bad_sections_are_refused_with_their_unit(name: str, value: float) -> None:
    unit = name.rsplit("_", 1)[1]
    with pytest.raises(ValueError, match=f"{name}.*{unit}"):
        Section(**{"length_mm": 10.0, "E_MPa": 10.0, name: value})


@pytest.mark.parametrize(
    ("support", "pattern"),
    [
        ({"clamp_angle_deg": math.nan}, r"clamp_angle_deg.*deg"),
        ({"clamp_angle_deg": 200.0}, r"clamp_angle_deg.*deg"),
        ({"gravity_m_s2": (0.0, math.inf, 0.0)}, r"gravity_m_s2.*m/s2"),
        ({"gravity_m_s2": (0.0, 9.8)}, r"gravity_m_s2.*m/s2"),
        ({"load_factor": -1.0}, r"load_factor"),
    ],
)
def test_bad_supports_are_refused(support: dict[str, object], pattern: str) -> None:
    with pytest.raises(InputError, match=pattern):
        Support(**support)  # type: ignore[arg-type]


def test_weight_needs_a_density() -> None:
    with pytest.raises(InputError, match=r"density_kg_m3.*kg/m3"):
        solve(gmc(2), UniformField(flux_mT=1), support=Support(gravity_m_s2=(0, -9, 0)))


@pytest.mark.parametrize("gap_mm", [0.1, 0.49])
def test_a_rod_that_would_touch_the_magnet_is_refused(gap_mm: float) -> None:
    # The tip passes the N face sideways: half the side of 1 mm is what counts.
    with pytest.raises(InputError, match=r"gap_mm.*mm"):
        solve(gmc(2), MagnetField(magnet=CUBE, gap_mm=gap_mm))


def test_a_rod_through_the_magnet_is_refused() -> None:
    magnet = Magnet(
        sides_mm=(5.0, 5.0, 5.0), remanence_T=1.3, offset_mm=(-15.0, 5.0, 0.0)
    )
    with pytest.raises(InputError, match=r"gap_mm.*mm"):
        solve(gmc(2), MagnetField(magnet=magnet, gap_mm=1.0))


def test_a_load_beyond_the_range_is_refused() -> None:
    soft = replace(gmc(2), sections=(Section(length_mm=500.0, E_MPa=0.01),))
    with pytest.raises(InputError, match=r"flux_mT.*instead received"):
        solve(soft, UniformField(flux_mT=30000.0))


@pytest.mark.parametrize("points", [1, 0, -3])
def test_too_few_points_are_refused(points: int) -> None:
    with pytest.raises(InputError, match="points"):
        solve(gmc(2), UniformField(flux_mT=10), points=points)


def test_an_unknown_model_is_refused() -> None:
    with pytest.raises(InputError, match="model"):
        solve(gmc(2), UniformField(flux_mT=10), model="beam")


def test_table_1_is_the_papers() -> None:
    assert gmc(5).sections[2].E_MPa == 7.5
    assert gmc(6).joints_mm == (20.0, 25.0)
    assert [gmc(n, remeasured=True).side_mm for n in (1, 2, 3)] == [1.30, 0.97, 0.80]
    with pytest.raises(InputError, match="GMC number"):
        gmc(8)
