"""A rod in a tube against what is known: free rods, the plane, columns, helices."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import minimize

from magbend.core.magnet import Magnet
from magbend.core.specimen import Section, Specimen
from magbend.sim import (
    Field,
    MagnetField,
    Support,
    Uniform,
    UniformField,
    gmc,
    solve_spatial,
)
from magbend.sim.navigate import channel, navigate, navigate_many
from magbend.sim.tube import Tube, helix

NOTHING = UniformField(flux_mT=0.0)
WIDE = Tube(name="wide", points_mm=[(0, 0, 0), (80, 0, 0)], radius_mm=60.0)
OBLIQUE = Field(Uniform(flux_mT=50.0, angle_deg=70.0, elevation_deg=40.0))
MAGNET = MagnetField(
    magnet=Magnet(
        sides_mm=(55.0, 55.0, 55.0), remanence_T=1.3, elevation_deg=30.0,
        offset_mm=(3.0, 0.0, 5.0),
    ),
    gap_mm=45.0,
)  # fmt: skip
DOWNWARD = Support(gravity_m_s2=(0.0, 0.0, -9.80665))
DOWN = Support(gravity_m_s2=(1.0, 2.0, -9.80665))


def round_rod(length_mm: float, E_MPa: float = 1.0, **given) -> Specimen:
    given = {"remanence_mT": 0.0, "diameter_mm": 1.0} | given
    sections = (Section(length_mm=length_mm, E_MPa=E_MPa),)
    return Specimen(name="round", shape="round", sections=sections, **given)


def stiffness(rod: Specimen) -> float:
    """Return EI in N mm2."""
    return rod.sections[0].E_MPa * rod.cross_sections[0].in_plane_mm4


CURVED = Specimen(
    name="curved ribbon", shape="rectangle", width_mm=0.8, height_mm=0.6,
    remanence_mT=25.0, natural_curvature_per_mm=0.03, density_kg_m3=2600.0,
    sections=(Section(length_mm=15.0, E_MPa=2.0), Section(length_mm=15.0, E_MPa=1.0)),
)  # fmt: skip


@pytest.mark.parametrize(
    ("rod", "field", "support"),
    [
        (gmc(2), OBLIQUE, Support()),
        (gmc(2), MAGNET, Support()),
        (CURVED, OBLIQUE, DOWN),
    ],
    ids=["oblique field", "magnet above the plane", "curved, heavy, twisted ribbon"],
)
def test_a_rod_that_touches_nothing_is_solve_spatials(rod, field, support):
    passage = navigate(rod, WIDE, field, support=support, step_mm=10.0, refine=False)
    last = passage.steps[-1]
    free = solve_spatial(rod, field, support=support, points=len(last.s_mm))
    far = np.interp(free.s_mm, last.s_mm, np.arange(len(last.s_mm)))
    same = np.isclose(far, np.rint(far), atol=1e-9)
    off = last.shape[:3].T[np.rint(far[same]).astype(int)] - free.r_mm[same]
    assert same.sum() > 20
    assert np.abs(off).max() < 1e-6
    assert last.contacts == ()
    assert last.residual_Nmm < 1e-10


def test_the_error_falls_with_the_fifth_power_of_the_element():
    free = solve_spatial(CURVED, OBLIQUE, support=DOWN).r_mm[-1]
    off = []
    for elements in (8, 16):
        last = navigate(
            CURVED, WIDE, OBLIQUE, support=DOWN, step_mm=15.0, elements=elements,
            refine=False,
        ).steps[-1]  # fmt: skip
        off.append(np.linalg.norm(last.tip_mm - free))
    assert math.log2(off[0] / off[1]) > 4.5


@pytest.mark.parametrize("mu", [0.0, 0.4])
def test_a_bend_in_the_plane_is_the_planar_solvers(mu):
    """The middle line is given as points: a spline is not quite arcs and segments."""
    rod, radius = round_rod(28.0, 5.0, remanence_mT=20.0), 12.0
    legs = [(6.0, 0.0), (radius * math.pi / 3.0, 60.0), (20.0, 0.0)]
    bend = channel("bend", width_mm=3.0, legs=legs)
    turn = np.radians(np.arange(1.5, 60.0, 1.5))
    arc = np.column_stack([6.0 + radius * np.sin(turn), radius * (1.0 - np.cos(turn))])
    c, s = 0.5, math.sqrt(0.75)
    leave = np.array([6.0 + radius * s, radius * (1.0 - c)])
    straight = np.arange(0.0, 20.1, 0.31)[:, None] * [c, s] + leave
    points = np.vstack([[[x, 0.0] for x in np.arange(0.0, 6.1, 0.31)], arc, straight])
    tube = Tube(
        name="bend", points_mm=np.column_stack([points, 0.0 * points[:, 0]]),
        radius_mm=1.5,
    )  # fmt: skip
    field = UniformField(flux_mT=15.0, angle_deg=-40.0)
    planar, space = (
        navigate(rod, lumen, field, step_mm=1.0, friction=mu, refine=False)
        for lumen in (bend, tube)
    )
    pairs = [*zip(planar.steps, space.steps, strict=True)]
    most = planar.most("wall_N")
    assert max(len(a.contacts) for a, _ in pairs) >= 2
    for a, b in pairs:
        assert b.push_N == pytest.approx(a.push_N, abs=2e-3 * most)
        assert b.wall_N == pytest.approx(a.wall_N, abs=2e-3 * most)
        assert np.hypot(*(np.array(a.tip_mm) - b.tip_mm[:2])) < 5e-3
        assert abs(b.tip_mm[2]) < 1e-9
        assert b.rubbed_Nmm == pytest.approx(a.rubbed_Nmm, rel=0.01, abs=1e-9)


def chain(rod, length_mm, links, flux_T, wall):
    """Return the tip of least energy of a chain of rigid links, and that energy.

    Another discretisation (tangents of links, springs between: no twist), another
    algorithm (sequential quadratic programs), another wall (nearest of many points).
    """
    h = length_mm / links
    m = rod.cross_sections[0].area_mm2 * rod.remanence_mT * 1e-9 / (4e-7 * math.pi)
    springs = np.full(links, stiffness(rod) / h)
    springs[0] *= 2.0  # half a link from the clamp

    def tangents(angles):
        a, b = angles.reshape(2, -1)
        t = np.column_stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)])
        ta = np.column_stack([-t[:, 1], t[:, 0], 0.0 * a])
        tb = np.column_stack(
            [-np.cos(a) * np.sin(b), -np.sin(a) * np.sin(b), np.cos(b)]
        )
        return t, ta, tb

    def energy(angles):
        t, ta, tb = tangents(angles)
        along = np.vstack([[1.0, 0.0, 0.0], t])
        cosine = np.clip((along[1:] * along[:-1]).sum(axis=1), -1.0, 1.0)
        bent = np.arccos(cosine)
        value = 0.5 * springs @ bent**2 - m * h * (t @ flux_T).sum()
        pull = -springs * np.where(bent > 1e-7, bent / np.sin(bent + 1e-300), 1.0)
        by_t = pull[:, None] * along[:-1] - m * h * flux_T
        by_t[:-1] += pull[1:, None] * t[1:]
        g = np.concatenate([(by_t * ta).sum(axis=1), (by_t * tb).sum(axis=1)])
        return value * 1e3, g * 1e3

    def room(angles):
        return wall(h * np.cumsum(tangents(angles)[0], axis=0))

    start = np.concatenate([np.linspace(0.0, 0.6, links), np.linspace(0.0, 0.2, links)])
    found = minimize(
        energy, start, jac=True, method="SLSQP",
        constraints={"type": "ineq", "fun": room},
        options={"maxiter": 300, "ftol": 1e-10},
    )  # fmt: skip
    assert found.success
    return h * tangents(found.x)[0].sum(axis=0), found.fun / 1e3


def test_least_energy_of_a_chain_of_links_comes_to_the_same():
    rod = round_rod(24.0, 10.0, remanence_mT=20.0)
    tube = Tube(
        name="turn", points_mm=helix(12.0, 30.0, 0.5), radius_mm=1.2,
        direction=(1.0, 0.0, 0.0),
    )  # fmt: skip
    flux_T = 0.02 * np.array([0.3, 0.5, 0.6])
    field = Field(
        Uniform(
            flux_mT=1e3 * np.linalg.norm(flux_T),
            angle_deg=math.degrees(math.atan2(0.5, 0.3)),
            elevation_deg=math.degrees(math.asin(0.6 / math.sqrt(0.7))),
        )
    )
    last = navigate(rod, tube, field, step_mm=1.0, refine=False).steps[-1]
    place = tube.at(np.linspace(0.0, tube.length_mm, 1500))[0]

    def wall(points):
        square = ((points[:, None] - place) ** 2).sum(axis=2).min(axis=1)
        return 0.7 - np.sqrt(square)

    coarse, fine = (chain(rod, 24.0, n, flux_T, wall) for n in (8, 16))
    tip = fine[0] + (fine[0] - coarse[0]) / 3.0
    energy = fine[1] + (fine[1] - coarse[1]) / 3.0
    assert len(last.contacts) >= 2
    assert np.linalg.norm(tip - last.tip_mm) < 0.02
    assert energy == pytest.approx(last.energy_Nmm, rel=2e-3)


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_the_work_of_the_hand_is_stored_or_rubbed_away(mu):
    lumen = Tube(name="t", points_mm=helix(10.0, 20.0, 0.6), radius_mm=2.0)
    lost = []
    for step_mm in (1.0, 0.5):
        passage = navigate(
            gmc(2), lumen, OBLIQUE, step_mm=step_mm, friction=mu, refine=False
        )
        push = np.array([step.push_N for step in passage.steps])
        at = np.array([step.insertion_mm for step in passage.steps])
        work = np.sum(np.diff(at) * (push[1:] + push[:-1]) / 2.0)
        stored = passage.steps[-1].energy_Nmm - passage.steps[0].energy_Nmm
        rubbed = passage.steps[-1].rubbed_Nmm
        lost.append(abs(work - stored - rubbed))
    assert lost[1] < 0.012 * work
    assert lost[1] < 0.6 * lost[0]
    assert (rubbed > 0.5 * stored) == (mu > 0.0)


def test_a_curved_rod_drives_itself_out_of_its_guide():
    """What held it straight comes free: EI k^2 / 2 a length, and with contacts too."""
    passage = navigate(CURVED, WIDE, NOTHING, step_mm=5.0, refine=False)
    for step, E_MPa in ((passage.steps[1], 1.0), (passage.steps[-1], 2.0)):
        free_N = 0.5 * E_MPa * 0.6 * 0.8**3 / 12.0 * 0.03**2
        assert step.push_N == pytest.approx(-free_N, rel=1e-6)
        assert step.energy_Nmm == pytest.approx(0.0, abs=1e-12)
    bend = Tube(name="bend", points_mm=helix(10.0, 20.0, 0.6), radius_mm=1.6)
    walk = navigate(CURVED, bend, NOTHING, step_mm=0.25, refine=False, way_mm=14.0)
    push = np.array([step.push_N for step in walk.steps]) + 0.5 * free_N
    at = np.array([step.insertion_mm for step in walk.steps])
    work = np.sum(np.diff(at) * (push[1:] + push[:-1]) / 2.0)
    stored = walk.steps[-1].energy_Nmm - walk.steps[0].energy_Nmm
    assert work == pytest.approx(stored, rel=0.02)


@pytest.mark.slow
def test_friction_in_a_winding_tube_is_the_capstans():
    """A soft rod, drawn at its tip, holds or pulls by exp(mu phi) at its guide.

    With phi the angle by which it turns between its first and last contact: up to what
    its stiffness adds where it bends and straightens.
    """
    rod, mu, tip_N = round_rod(26.0, 0.05, remanence_mT=100.0), 0.2, 0.01
    tube = Tube(
        name="half a turn", points_mm=helix(6.0, 10.0, 0.5, points=40), radius_mm=1.0,
        direction=(1.0, 0.0, 0.0),
    )  # fmt: skip
    x, y, z = tube.at(tube.length_mm)[1]

    def drawn(insertion_mm: float) -> Field:
        share = min(1.0, max(0.0, (insertion_mm - 18.0) / 4.0))
        return Field(
            Uniform(
                flux_mT=1e3 * share * tip_N / LOAD_N_T,
                angle_deg=math.degrees(math.atan2(y, x)),
                elevation_deg=math.degrees(math.atan2(z, math.hypot(x, y))),
            )
        )

    passage = navigate(
        rod, tube, drawn, friction=mu, way_mm=(24.0, 25.0, 24.0), step_mm=2.0,
        refine=False,
    )  # fmt: skip
    let, back = [s for s in passage.steps if s.insertion_mm in (24.0, 25.0)][1:]
    for step, way in ((let, -1.0), (back, 1.0)):
        first, last = step.contacts[0].s_mm, step.contacts[-1].s_mm
        inside = (step.s_mm >= first) & (step.s_mm <= last)
        phi = np.trapezoid(step.shape[6][inside], step.s_mm[inside])
        rope_N = tip_N * math.exp(way * mu * phi)
        assert -step.push_N == pytest.approx(rope_N, rel=0.07)


LOAD_N_T = math.pi / 4.0 * 1e-6 * 0.1 / (4e-7 * math.pi)
"""Dead load at the tip, per tesla, of a round rod of 1 mm and 100 mT."""


def buckling_load(length_mm: float, EI: float, spring: float, *, held: bool) -> float:
    """Return the least dead load that buckles a clamped beam on springs, in N.

    Cubic finite elements of a straight beam; its other end is free, or held in place.
    """
    n = 80
    h = length_mm / n
    bend = [[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]]
    mass = [
        [156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4],
    ]  # fmt: skip
    load = [[36, 3, -36, 3], [3, 4, -3, -1], [-36, -3, 36, -3], [3, -1, -3, 4]]
    K, G = np.zeros((2, 2 * n + 2, 2 * n + 2))
    for e in range(n):
        part = slice(2 * e, 2 * e + 4)
        K[part, part] += np.array(bend) * EI / h**3 + np.array(mass) * spring * h / 420
        G[part, part] += np.array(load) / (30.0 * h)
    kept = np.arange(2, 2 * n + 2)
    kept = kept[kept != 2 * n] if held else kept
    some = np.ix_(kept, kept)
    return 1.0 / eigh(G[some], K[some], eigvals_only=True)[-1]


def test_a_rod_that_lies_in_a_tube_buckles_as_a_beam_on_springs():
    """A tube's bottom pushes a heavy rod back by w / r of its way up the wall.

    A long rod held at its end buckles at 2 sqrt(EI w / r) (Dawson and Paslay 1984), one
    with a free end at half of that.
    """
    length_mm, room_mm = 40.0, 1.0
    rod = round_rod(length_mm, remanence_mT=100.0, density_kg_m3=20000.0)
    EI = stiffness(rod)
    weight = 20000e-9 * 9.80665 * math.pi / 4.0
    known = 2.0 * math.sqrt(EI * weight / room_mm)
    held = buckling_load(150.0, EI, weight / room_mm, held=True)
    assert held == pytest.approx(known, rel=5e-3)
    critical = buckling_load(length_mm, EI, weight / room_mm, held=False)
    assert critical == pytest.approx(0.5 * known, rel=1e-3)
    tube = Tube(
        name="straight", points_mm=[(0, 0, room_mm), (60, 0, room_mm)], radius_mm=1.5,
        entry_mm=(0, 0, 0),
    )  # fmt: skip

    def tip_goes(share: float) -> float:
        def load(insertion_mm: float) -> UniformField:
            part = share if insertion_mm > 39.0 else 0.0
            return UniformField(flux_mT=-1e3 * part * critical / LOAD_N_T, angle_deg=0)

        last = navigate(
            rod, tube, load, step_mm=13.0, support=DOWNWARD,
            refine=False,
        ).steps[-1]  # fmt: skip
        held_up = weight * length_mm - last.wall_N
        assert abs(held_up) < 0.02 * weight * length_mm
        return math.hypot(last.tip_mm[1], last.tip_mm[2])

    assert tip_goes(0.98) < 1e-6
    assert tip_goes(1.02) > 1e-2


@pytest.mark.slow
def test_a_rod_pushed_from_its_tip_winds_into_a_torsion_free_helix():
    """Energy EI sin^4 / 2 a^2 a length, at an angle psi to the axis, against F cos psi.

    F = 2 EI sin^2 psi cos psi / a^2, which is 8 pi^2 EI / pitch^2 for small angles
    (Lubinski, Althouse and Logan 1962); the wall bears EI sin^4 psi / a^3.
    """
    room_mm, pitch_mm = 0.5, 12.0
    rod = round_rod(40.0, remanence_mT=100.0)
    EI = stiffness(rod)
    psi = math.atan(2.0 * math.pi * room_mm / pitch_mm)
    push_N = 2.0 * EI * math.sin(psi) ** 2 * math.cos(psi) / room_mm**2
    tube = Tube(name="straight", points_mm=[(0, 0, 0), (60, 0, 0)], radius_mm=1.0)
    field = UniformField(flux_mT=-1e3 * push_N / LOAD_N_T, angle_deg=0.0)
    last = navigate(rod, tube, field, step_mm=8.0, elements=16, refine=False).steps[-1]
    x, y, z = last.shape[:3]
    middle = (last.s_mm > 16.0) & (last.s_mm < 28.0)
    assert np.hypot(y, z)[middle] == pytest.approx(room_mm, abs=1e-3)
    turn = np.polyfit(x[middle], np.unwrap(np.arctan2(z, y))[middle], 1)[0]
    assert 2.0 * math.pi / abs(turn) == pytest.approx(pitch_mm, rel=1e-3)
    inside = [c.force_N for c in last.contacts if 16.0 < c.s_mm < 28.0]
    bears = EI * math.sin(psi) ** 4 / room_mm**3
    assert sum(inside) / 12.0 == pytest.approx(bears, rel=1e-2)


def test_a_rod_that_turns_back_beside_its_guide_is_named():
    soft = round_rod(20.0, 0.05, remanence_mT=100.0)
    wide = Tube(name="wide", points_mm=[(0, 0, 0), (40, 0, 0)], radius_mm=2.0)
    back = UniformField(flux_mT=200.0, angle_deg=175.0)
    passage = navigate(soft, wide, back, refine=False)
    assert passage.outcome == "turned back behind the guide, where it has no room"
    assert min(step.shape[0].min() for step in passage.steps) > -0.6


def test_a_rod_snaps_on_and_snaps_back_later():
    """Where the tube widens the tip leaves the wall, and returns late on the way."""
    points = [
        (0.0, 0.0, 0.0), (4.8, -3.4, -2.2), (10.6, -5.4, 2.7), (13.2, -0.8, 8.5),
        (15.3, 2.7, 13.0), (18.7, 6.2, 16.4), (15.8, 9.3, 21.2),
    ]  # fmt: skip
    tube = Tube(
        name="wide and narrow", points_mm=points,
        radius_mm=(1.88, 1.78, 2.79, 1.09, 2.21, 1.63, 0.95),
    )  # fmt: skip
    passage = navigate(
        gmc(2), tube, NOTHING, way_mm=(21.5, 19.5), step_mm=0.5, refine=False
    )
    on, back = passage.snaps
    assert back.insertion_mm < on.insertion_mm - 0.05
    assert on.moved_mm > 0.5
    assert on.released_Nmm > 0.0
    assert back.released_Nmm > 0.0
    first, *_, last = (s for s in passage.steps if s.insertion_mm == 19.5)
    assert math.dist(first.tip_mm, last.tip_mm) < 1e-6
    assert passage.most("overlap_mm") < 1e-3


def test_many_rods_go_through_a_tube_as_each_by_itself():
    bend = Tube(name="bend", points_mm=helix(10.0, 20.0, 0.6), radius_mm=2.0)
    rods = [gmc(2), gmc(5)]
    together = navigate_many(rods, bend, OBLIQUE, way_mm=10.0, step_mm=2.0)
    for rod, way in zip(rods, together, strict=True):
        alone = navigate(rod, bend, OBLIQUE, way_mm=10.0, step_mm=2.0, refine=False)
        assert way.steps[-1].tip_mm == alone.steps[-1].tip_mm
