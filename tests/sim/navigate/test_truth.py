"""The rod in its lumen against closed forms, published loads and a chain of links."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

from magbend.core.magnet import Magnet
from magbend.core.specimen import Section, Specimen
from magbend.sim import MagnetField, Support, UniformField, gmc, solve
from magbend.sim.navigate import Arc, Lumen, Wall, channel, navigate, polyline

NOTHING = UniformField(flux_mT=0.0)


def uniform(length_mm: float, E_MPa: float = 10.0, **more: float) -> Specimen:
    section = Section(length_mm=length_mm, E_MPa=E_MPa)
    given = {"side_mm": 1.0, "remanence_mT": 0.0} | more
    return Specimen(name="uniform", sections=(section,), **given)


def wide(length_mm: float = 100.0) -> Lumen:
    return channel("wide", width_mm=80.0, legs=[(length_mm, 0.0)])


def stiffness_Nmm2(rod: Specimen) -> float:
    return rod.sections[0].E_MPa * rod.side_mm**4 / 12.0


@pytest.mark.parametrize(
    ("number", "field"),
    [
        (2, UniformField(flux_mT=120.0, angle_deg=150.0)),
        (5, UniformField(flux_mT=66.0, angle_deg=90.0)),
        (2, MagnetField(magnet=Magnet.cube(55.0, 1.305), gap_mm=60.0)),
        (7, MagnetField(magnet=Magnet.cube(55.0, -1.305), gap_mm=60.0)),
    ],
)
def test_a_rod_that_touches_nothing_is_the_free_rod(number, field):
    rod = gmc(number)
    passage = navigate(rod, wide(), field, step_mm=rod.length_mm, refine=False)
    free = solve(rod, field).centreline
    assert math.dist(passage.steps[-1].tip_mm, free.tip_mm) < 1e-8
    assert not passage.steps[-1].contacts


def test_weight_within_the_plane_is_the_free_rods():
    rod = uniform(30.0, 5.0, density_kg_m3=2640.0)
    support = Support(gravity_m_s2=(0.0, -9.80665, 0.0))
    passage = navigate(
        rod, wide(), NOTHING, support=support, step_mm=30.0, refine=False
    )
    free = solve(rod, NOTHING, support=support).centreline
    assert math.dist(passage.steps[-1].tip_mm, free.tip_mm) < 1e-8


def test_a_rod_that_is_curved_by_nature_is_the_free_rods():
    rod = replace(gmc(2), natural_curvature_per_mm=0.02)
    field = UniformField(flux_mT=50.0)
    last = navigate(rod, wide(), field, step_mm=30.0, refine=False).steps[-1]
    assert math.dist(last.tip_mm, solve(rod, field).centreline.tip_mm) < 1e-8


def test_the_elements_are_of_sixth_order():
    field = UniformField(flux_mT=120.0, angle_deg=150.0)
    exact = solve(gmc(2), field).centreline.tip_mm
    error = [
        math.dist(
            navigate(
                gmc(2), wide(), field, step_mm=30.0, elements=n, refine=False
            ).steps[-1].tip_mm,
            exact,
        )
        for n in (3, 6, 12)
    ]  # fmt: skip
    orders = [math.log2(a / b) for a, b in pairwise(error)]
    assert all(5.5 < order < 7.0 for order in orders)


def test_a_clamped_rod_buckles_and_leaves_the_wall_at_the_published_loads():
    """Clamped at both ends between walls, and fed in (Domokos, Holmes & Royce 1997).

    Euler's 4 pi^2; one contact up to 16 pi^2, where the rod would begin to lie flat,
    and its flat part would buckle at 36 pi^2: but there the contact can move aside
    under a falling load, which takes less energy. Without a contact again at the second
    clamped mode, tan(k/2) = k/2: 8.183 pi^2.
    """
    rod, span_mm = uniform(36.0), 30.0
    lumen = channel("straight", width_mm=3.0, legs=[(40.0, 0.0)])
    passage = navigate(
        rod, lumen, NOTHING, tip=(span_mm, 0.0, 0.0), refine=False,
        way_mm=(30.0005, 30.36), step_mm=0.004,
    )  # fmt: skip
    EI = stiffness_Nmm2(rod)
    loads, touching = [], []
    for step in passage.steps:
        sliding_N = 0.5 * EI * step.root_curvature_per_mm**2
        k2 = (step.push_N + sliding_N) * step.insertion_mm**2 / EI / math.pi**2
        loads.append(k2)
        touching.append(len(step.contacts))
    assert loads[0] == pytest.approx(4.0, abs=1e-4)
    assert max(k2 for k2, n in zip(loads, touching, strict=True) if n == 1) < 16.01
    aside = next(e.insertion_mm for e in passage.snaps)
    before = [i for i, s in enumerate(passage.steps) if s.insertion_mm < aside]
    assert loads[before[-1]] == pytest.approx(16.0, abs=0.25)
    # Then the longer part alone, half a wave with its end flat on the wall, carries
    # 4 pi^2 over its own length: y' = B (1 - cos k s) + C sin k s for any C.
    for step, k2 in zip(passage.steps, loads, strict=True):
        if not aside + 0.02 < step.insertion_mm < 30.32:
            continue
        (contact,) = step.contacts
        share = max(contact.s_mm, step.insertion_mm - contact.s_mm) / step.insertion_mm
        assert k2 * share**2 == pytest.approx(4.0, rel=0.01)  # slopes are finite
    last_of_one = max(i for i, n in enumerate(touching) if n == 1)
    assert loads[last_of_one] == pytest.approx(8.183, abs=0.06)
    assert touching[last_of_one + 1] in (0, 2)


def test_a_rod_that_lies_on_a_wall_buckles_away_from_it_as_if_there_were_none():
    """The secondary buckling of a flat part: 4 pi^2 over its length, to one side."""
    rod = uniform(36.0)
    walls = (Wall("floor", polyline([(0, -0.5), (40, -0.5)])),)
    table = Lumen(name="table", walls=walls, inside_mm=(1.0, 0.0))
    last = navigate(
        rod, table, NOTHING, tip=(30.0, 0.0, 0.0), way_mm=(30.0, 30.001), refine=False
    ).steps[-1]
    sliding_N = 0.5 * stiffness_Nmm2(rod) * last.root_curvature_per_mm**2
    load = (last.push_N + sliding_N) * 30.0**2 / stiffness_Nmm2(rod)
    assert load == pytest.approx(4.0 * math.pi**2, rel=2e-3)
    assert last.shape[1].max() > 0.05
    assert last.shape[1].min() > -1e-3


def test_a_rod_against_a_smooth_end_wall_buckles_at_eulers_quarter():
    rod = uniform(30.0)
    box = Lumen(
        name="box",
        walls=(Wall("box", polyline([(0, 20), (20, 20), (20, -20), (0, -20)])),),
        inside_mm=(1.0, 0.0),
    )
    way = (20.0 - 0.5 * rod.side_mm, 20.0 - 0.5 * rod.side_mm + 0.0004)
    last = navigate(rod, box, NOTHING, way_mm=way, refine=False).steps[-1]
    euler_N = 0.25 * math.pi**2 * stiffness_Nmm2(rod) / last.insertion_mm**2
    assert last.push_N == pytest.approx(euler_N, rel=1e-4)
    assert abs(last.tip_mm[1]) > 0.05  # it has left the middle


def test_a_heavy_rod_lies_down_on_the_floor():
    """Clamped level above a floor, it hangs free over (72 EI h / w)^(1/4).

    Where it touches down the floor carries w l / 3 as a point, as beam theory has it
    for small slopes, and then the weight of the rest along the line of contact.
    """
    rod = uniform(60.0, 2.0, density_kg_m3=2640.0)
    drop_mm = 0.05
    floor = Lumen(
        name="floor",
        walls=(Wall("floor", polyline([(-5, -0.5 - drop_mm), (90, -0.5 - drop_mm)])),),
        inside_mm=(1.0, 0.0),
    )
    support = Support(gravity_m_s2=(0.0, -9.80665, 0.0))
    last = navigate(
        rod, floor, NOTHING, support=support, step_mm=3.0, elements=60, refine=False
    ).steps[-1]
    w = 2640.0e-9 * 9.80665  # N/mm
    hangs_mm = (72.0 * stiffness_Nmm2(rod) * drop_mm / w) ** 0.25
    first = last.contacts[0]
    assert first.s_mm == pytest.approx(hangs_mm, abs=0.6)
    assert last.wall_N == pytest.approx(w * (60.0 - 2.0 / 3.0 * hangs_mm), rel=2e-3)
    far = [c.force_N for c in last.contacts if c.s_mm > 30.0]
    assert sum(far) == pytest.approx(w * 30.0, rel=0.05)
    assert last.overlap_mm < 1e-3


WEIGHT_N_MM = 20000.0e-9 * 9.80665
"""Of a rod of 1 mm2 and 20 g/cm3."""


def pulled_over_a_pulley(E_MPa: float, mu: float) -> tuple[float, float, float, float]:
    """Return the pull on a rod that hangs over an edge, let down and drawn up.

    And what Euler and Eytelwein say of a heavy rope, from where it leaves the edge:
    T' = w R cos a +- mu (T + w R sin a). Where it bends T is less by EI / 2 R^2.
    """
    rod, radius_mm, table_mm = uniform(60.0, E_MPa, density_kg_m3=20000.0), 10.0, 1.0
    edge = radius_mm - 0.5
    arcs = (
        Arc(-5.0, -0.5, 0.0, 5.0 + table_mm),
        Arc(table_mm, -0.5, 0.0, 0.5 * math.pi * edge, -1.0 / edge),
        Arc(table_mm + edge, -0.5 - edge, -0.5 * math.pi, 60.0),
    )
    pulley = Lumen(name="pulley", walls=(Wall("table", arcs),), inside_mm=(1.0, 0.2))
    passage = navigate(
        rod, pulley, NOTHING, support=Support(gravity_m_s2=(0.0, -9.80665, 0.0)),
        friction=mu, way_mm=(55.0, 56.0, 55.0), step_mm=2.0, elements=48, refine=False,
    )  # fmt: skip
    assert passage.outcome == "inserted"
    shown = [step for step in passage.steps if step.insertion_mm in (56.0, 55.0)][1:]
    bent_N = 0.5 * stiffness_Nmm2(rod) / radius_mm**2
    pulls = []
    for step, way in zip(shown, (-1.0, 1.0), strict=True):
        hangs_mm = step.insertion_mm - table_mm - 0.5 * math.pi * radius_mm

        def grows(a, tension, rub=way * mu):
            across = tension + WEIGHT_N_MM * radius_mm * math.sin(a)
            return WEIGHT_N_MM * radius_mm * math.cos(a) + rub * across

        start = [WEIGHT_N_MM * hangs_mm - bent_N]
        rope = solve_ivp(grows, (0.0, 0.5 * math.pi), start, rtol=1e-9).y[0, -1]
        pulls += [-step.push_N, rope + bent_N + way * mu * WEIGHT_N_MM * table_mm]
    return tuple(pulls)


def test_a_rope_without_friction_pulls_the_same_on_both_sides():
    down, rope_down, up, rope_up = pulled_over_a_pulley(0.1, 0.0)
    assert down == pytest.approx(rope_down, rel=1e-4)
    assert up == pytest.approx(rope_up, rel=1e-4)


def test_friction_over_an_edge_is_the_capstans():
    """Up to what the rod's stiffness adds where it straightens, which falls with EI."""
    off = []
    for E_MPa in (0.2, 0.1):
        down, rope_down, up, rope_up = pulled_over_a_pulley(E_MPa, 0.3)
        assert up > 2.0 * down
        off.append((down / rope_down - 1.0, up / rope_up - 1.0))
    assert abs(off[1][0]) < 0.04
    assert abs(off[1][1]) < 0.02
    assert off[0][0] / off[1][0] == pytest.approx(2.0, abs=0.7)


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_the_work_of_the_hand_is_stored_or_rubbed_away(mu):
    bend = channel("bend", width_mm=2.5, legs=[(5.0, 0.0), (15.0, 60.0), (15.0, 0.0)])
    lost = []
    for step_mm in (0.4, 0.2):
        passage = navigate(
            gmc(2), bend, NOTHING, friction=mu, step_mm=step_mm, refine=False
        )
        push = np.array([step.push_N for step in passage.steps])
        at = np.array([step.insertion_mm for step in passage.steps])
        work = np.sum(np.diff(at) * (push[1:] + push[:-1]) / 2.0)
        stored = passage.steps[-1].energy_Nmm - passage.steps[0].energy_Nmm
        lost.append(work - stored - passage.steps[-1].rubbed_Nmm)
        scale = work
    assert abs(lost[1]) < 5e-3 * scale
    assert abs(lost[1]) < 0.6 * abs(lost[0])
    assert (passage.steps[-1].rubbed_Nmm > 0.3 * stored) == (mu > 0.0)


def chain(rod: Specimen, length_mm: float, links: int, field: UniformField, walls):
    """Return the tip of least energy of a chain of rigid links between two curves.

    Another discretisation (angles of links, springs between), another algorithm (trust
    region with a barrier), another description of the wall (a function of the point).
    """
    h = length_mm / links
    EI = stiffness_Nmm2(rod)
    flux_T = field.flux_mT * 1e-3
    m = rod.side_mm**2 * rod.remanence_mT * 1e-9 / (4e-7 * math.pi) * flux_T
    springs = np.full(links, EI / h)
    springs[0] *= 2.0  # half a link from the clamp
    angle = math.radians(field.angle_deg)

    def energy(theta):
        bend = np.diff(np.concatenate([[0.0], theta]))
        value = 0.5 * springs @ bend**2 - m * h * np.cos(theta - angle).sum()
        g = springs * bend
        g[:-1] -= springs[1:] * bend[1:]
        return value * 1e3, (g + m * h * np.sin(theta - angle)) * 1e3

    def gaps(theta):
        x = h * np.cumsum(np.cos(theta))
        y = h * np.cumsum(np.sin(theta))
        return walls(x, y)

    start = np.linspace(0.0, 0.5, links)
    found = minimize(
        energy, start, jac=True, method="SLSQP",
        constraints={"type": "ineq", "fun": gaps},
        options={"maxiter": 400, "ftol": 1e-11},
    )  # fmt: skip
    assert found.success
    theta = found.x
    return np.array([h * np.cos(theta).sum(), h * np.sin(theta).sum()]), found.fun / 1e3


def test_least_energy_of_a_chain_of_links_comes_to_the_same():
    rod = uniform(24.0, 10.0, remanence_mT=20.0)
    field = UniformField(flux_mT=20.0, angle_deg=90.0)
    centre, radius = np.array([4.0, 16.0]), 16.0
    bend = channel(
        "bend",
        width_mm=3.0,
        legs=[(4.0, 0.0), (radius * math.pi / 3, 60.0), (9.0, 0.0)],
    )
    last = navigate(rod, bend, field, refine=False).steps[-1]

    def walls(x, y):
        """Distance from the middle line, within the width that the rod's axis has."""
        past = np.arctan2(x - centre[0], centre[1] - y)
        rho = np.hypot(x - centre[0], y - centre[1])
        c, s = 0.5, math.sqrt(0.75)
        beyond = (x - centre[0]) * s - (y - centre[1]) * c  # from the centre, outward
        off = np.where(
            x < 4.0, y, np.where(past < math.pi / 3, radius - rho, radius - beyond)
        )
        return np.concatenate([1.0 - off, 1.0 + off])

    coarse, fine = (chain(rod, 24.0, n, field, walls) for n in (18, 36))
    tip = fine[0] + (fine[0] - coarse[0]) / 3.0
    energy = fine[1] + (fine[1] - coarse[1]) / 3.0
    assert len(last.contacts) >= 2
    assert np.hypot(*(tip - last.tip_mm)) < 0.02
    assert energy == pytest.approx(last.energy_Nmm, rel=2e-3)
