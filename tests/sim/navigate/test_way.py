"""What happens on the way: branches, jams, snaps, forth and back."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from magbend.core.magnet import Magnet
from magbend.core.specimen import Section, Specimen
from magbend.sim import MagnetField, Support, UniformField, gmc
from magbend.sim.navigate import Lumen, Wall, channel, navigate, polyline, read_lumen
from magbend.sim.navigate.curves import outline

LUMENS = Path(__file__).parents[3] / "fixtures" / "lumens"
NOTHING = UniformField(flux_mT=0.0)


def mirrored(lumen: Lumen) -> Lumen:
    def flip(points):
        return [(x, -y) for x, y in points]

    lines = [
        [arc.at(0.0) for arc in wall.arcs] + [wall.arcs[-1].at(1.0)]
        for wall in lumen.walls
    ]
    return Lumen(
        name=lumen.name,
        walls=tuple(
            Wall(wall.name, polyline(flip(line)))
            for wall, line in zip(lumen.walls, lines, strict=True)
        ),
        inside_mm=(lumen.inside_mm[0], -lumen.inside_mm[1]),
    )


@pytest.mark.parametrize(("sign", "branch"), [(1, "left branch"), (-1, "right branch")])
def test_the_field_chooses_the_branch(sign, branch):
    fork = read_lumen(LUMENS / "fork.toml")
    field = UniformField(flux_mT=sign * 60.0)
    passage = navigate(gmc(2), fork, field, way_mm=26.0, refine=False)
    assert passage.gates == (branch,)
    assert passage.outcome == "inserted"


@pytest.mark.parametrize("step_mm", [1.0, 0.5, 0.05])
def test_a_tip_that_meets_an_edge_head_on_carries_eulers_load(step_mm):
    """A column of two sections, one end clamped, the other free to move aside."""
    fork = read_lumen(LUMENS / "fork.toml")
    passage = navigate(
        gmc(2), fork, NOTHING, step_mm=step_mm, way_mm=14.0, refine=False
    )
    assert all(event.kind != "coarse" for event in passage.events)
    soft, stiff = 10e6 * 1e-12 / 12.0, 15e6 * 1e-12 / 12.0  # E I, N m2; 10 and 3.5 mm
    load_N = brentq(
        lambda load: (
            math.tan(math.sqrt(load / soft) * 10e-3)
            * math.tan(math.sqrt(load / stiff) * 3.5e-3)
            - math.sqrt(stiff / soft)
        ),
        5e-3, 18e-3,
    )  # fmt: skip
    assert passage.most("push_N") == pytest.approx(load_N, rel=1e-3)


def test_the_mirrored_lumen_gives_the_mirrored_rod():
    zigzag = Lumen(
        name="zigzag",
        walls=(
            Wall("top", polyline([(0, 1.5), (8, 1.5), (20, 8), (31, 8)])),
            Wall("bottom", polyline([(0, -1.5), (9, -1.5), (21, 5), (31, 5)])),
        ),
        inside_mm=(1.0, 0.0),
    )
    one = navigate(gmc(2), zigzag, NOTHING, refine=False).steps[-1]
    other = navigate(gmc(2), mirrored(zigzag), NOTHING, refine=False).steps[-1]
    assert one.tip_mm == pytest.approx((other.tip_mm[0], -other.tip_mm[1]), abs=1e-7)
    assert one.push_N == pytest.approx(other.push_N, rel=1e-6)
    assert len(one.contacts) == len(other.contacts) == 3


def test_every_shape_stays_in_the_lumen_and_touches_where_it_is_pressed():
    bend = read_lumen(LUMENS / "bend90.toml")
    passage = navigate(gmc(4), bend, NOTHING, refine=False)
    half_mm = 0.5 * max(gmc(4).sides_mm)
    for step in passage.steps:
        for contact in step.contacts:
            assert contact.force_N > 0.0
            x, y = contact.x_mm, contact.y_mm
            if x >= 5.0 and y <= 10.0:
                off = abs(math.hypot(x - 5.0, y - 10.0) - 10.0)
                assert off == pytest.approx(1.25 - half_mm, abs=1e-6)
    assert passage.most("overlap_mm") < 1e-3


def test_without_friction_and_snaps_the_way_back_is_the_way():
    bend = channel("bend", width_mm=2.5, legs=[(5.0, 0.0), (15.0, 60.0), (15.0, 0.0)])
    passage = navigate(gmc(2), bend, NOTHING, way_mm=(28.0, 18.0), refine=False)
    out = {step.insertion_mm: step.push_N for step in passage.steps[:56]}
    back = passage.steps[-1]
    assert back.push_N == pytest.approx(out[18.0], abs=1e-9)


def test_friction_leaves_a_loop_of_the_work_it_took():
    bend = channel("bend", width_mm=2.5, legs=[(5.0, 0.0), (15.0, 60.0), (15.0, 0.0)])
    passage = navigate(
        gmc(2), bend, NOTHING, way_mm=(28.0, 18.0), friction=0.2, refine=False
    )
    out = next(s for s in passage.steps if s.insertion_mm == 18.0)
    assert passage.steps[-1].push_N < out.push_N - 1e-4
    assert passage.steps[-1].rubbed_Nmm > out.rubbed_Nmm


def test_the_error_is_known_with_friction_too_on_a_way_forth_and_back():
    bend = channel("bend", width_mm=2.5, legs=[(5.0, 0.0), (15.0, 60.0), (15.0, 0.0)])
    coarse, fine = (
        navigate(
            gmc(2), bend, NOTHING, way_mm=(28.0, 18.0), friction=0.2, elements=n,
            step_mm=1.0, refine=n == 6,
        )
        for n in (6, 48)
    )  # fmt: skip
    off_mm = math.dist(coarse.steps[-1].tip_mm, fine.steps[-1].tip_mm)
    assert 0.5 * off_mm < coarse.error_mm < 20.0 * off_mm
    assert coarse.error_mm < 0.05


def blind() -> Lumen:
    return Lumen(
        name="blind",
        walls=(Wall("box", polyline([(0, 2), (20, 2), (20, -2), (0, -2)])),),
        inside_mm=(1.0, 0.0),
    )


def test_a_push_beyond_its_limit_ends_the_way():
    passage = navigate(
        gmc(2), blind(), UniformField(flux_mT=5.0), push_limit_N=0.1, refine=False
    )
    assert passage.outcome == "push force beyond its limit"
    assert 19.5 < passage.reached_mm < 22.0
    assert passage.steps[-1].push_N > 0.1


def test_a_blind_end_makes_the_rod_snap_and_it_snaps_back_later():
    """Forth it snaps near 24.5 mm, back near 22.8 mm: between, two states each."""
    passage = navigate(
        gmc(2), blind(), UniformField(flux_mT=5.0),
        way_mm=(22.0, 24.0, 24.52, 24.0, 22.0), refine=False,
    )  # fmt: skip
    turn = next(i for i, s in enumerate(passage.steps) if s.insertion_mm == 24.52)
    out, back = passage.steps[:turn], passage.steps[turn:]
    assert max(step.push_N for step in out) > 0.5
    forth, home = (
        max(snaps, key=lambda event: event.released_Nmm)
        for snaps in (
            [e for e in passage.snaps if e.insertion_mm > 24.0],
            [e for e in passage.snaps if e.insertion_mm < 23.5],
        )
    )
    assert forth.released_Nmm > 0.0
    assert home.released_Nmm > 0.0
    assert forth.moved_mm > 1.0
    assert home.insertion_mm < forth.insertion_mm - 1.0

    def push_N(steps, at_mm):
        return next(s.push_N for s in steps if abs(s.insertion_mm - at_mm) < 1e-6)

    assert push_N(back, 24.0) < 0.2 * push_N(out, 24.0)
    assert push_N(back, 22.0) == pytest.approx(push_N(out, 22.0), rel=1e-3)
    for step in passage.steps:
        assert step.shape[0].max() < 20.0
        assert abs(step.shape[1]).max() < 2.0


def large_snaps(step_mm: float):
    passage = navigate(
        gmc(2), blind(), UniformField(flux_mT=5.0), way_mm=(24.5, 22.5),
        step_mm=step_mm, refine=False,
    )  # fmt: skip
    return [e for e in passage.snaps if abs(e.released_Nmm) > 0.05]


@pytest.mark.slow
def test_folds_are_where_they_are_whatever_the_steps():
    """To 1/256 of a step; and no rod snaps to a state of more energy."""
    folds = []
    for step_mm in (0.4, 0.3, 0.2):
        large = large_snaps(step_mm)
        assert all(event.released_Nmm > 0.0 for event in large)
        folds.append([event.insertion_mm for event in large])
    assert len(folds[0]) == 2
    for others in folds[1:]:
        assert folds[0] == pytest.approx(others, abs=3e-3)


@pytest.mark.slow
def test_no_rod_goes_back_uphill_to_the_state_that_it_left():
    forth, home = large_snaps(0.25)
    assert forth.released_Nmm > 0.0
    assert home.released_Nmm > 0.0


def test_a_rod_that_is_pulled_onto_the_magnet_is_named():
    rod = Specimen(
        name="soft", side_mm=0.5, remanence_mT=-200.0,
        sections=(Section(length_mm=40.0, E_MPa=0.5),),
    )  # fmt: skip
    field = MagnetField(magnet=Magnet.cube(30.0, 1.3), gap_mm=6.0)
    lumen = channel("wide", width_mm=60.0, legs=[(60.0, 0.0)])
    passage = navigate(rod, lumen, field, elements=12, refine=False)
    assert "magnet" in passage.outcome
    assert passage.reached_mm < 40.0


def test_a_pushed_rod_buckles_outside_of_the_lumen():
    """Held at its root, it is a column between its clamp and the mouth."""
    rod = Specimen(
        name="soft", side_mm=1.0, remanence_mT=0.0,
        sections=(Section(length_mm=40.0, E_MPa=2.0),),
    )  # fmt: skip
    narrow = Lumen(
        name="narrow",
        walls=(
            Wall("box", polyline([(0, 0.55), (15, 0.55), (15, -0.55), (0, -0.55)])),
        ),
        inside_mm=(1.0, 0.0),
        mode="push",
    )
    passage = navigate(rod, narrow, NOTHING, way_mm=(14.499, 14.52), refine=False)
    last = passage.steps[-1]
    free_mm = 40.0 - last.insertion_mm
    EI = 2.0 / 12.0
    clamped_N = 4.0 * math.pi**2 * EI / free_mm**2
    assert 0.4 * clamped_N < last.push_N < 1.1 * clamped_N
    assert abs(last.shape[1]).max() > 0.1


def test_a_rod_that_meets_itself_is_named_and_one_in_a_bend_is_not():
    room = [(0, 0.6), (0, 8), (16, 8), (16, -8), (0, -8), (0, -0.6)]
    closed = Lumen(
        name="room", walls=(Wall("box", polyline(room)),), inside_mm=(1.0, 0.0),
        entry_mm=(0.5, 0.0),
    )  # fmt: skip
    rod = Specimen(
        name="soft", side_mm=1.0, remanence_mT=0.0,
        sections=(Section(length_mm=75.0, E_MPa=1.0),),
    )  # fmt: skip
    passage = navigate(
        rod, closed, NOTHING, way_mm=47.0, step_mm=1.0, elements=36, refine=False
    )
    met = [e for e in passage.events if e.kind == "self-contact"]
    assert len(met) == 1
    # Once round the room, and not before its length allows it.
    assert 30.0 < met[0].insertion_mm < 47.0
    turn = channel("turn", width_mm=2.5, legs=[(2.0, 0.0), (math.pi * 4.5, 180.0)])
    around = navigate(gmc(2), turn, NOTHING, way_mm=15.0, refine=False)
    assert all(event.kind != "self-contact" for event in around.events)


def test_weight_across_the_lumen_is_refused():
    lumen = channel("tube", width_mm=3.0, legs=[(40.0, 0.0)])
    with pytest.raises(ValueError, match="a floor would carry it"):
        navigate(gmc(2), lumen, NOTHING, support=Support(gravity_m_s2=(0.0, 0.0, -9.8)))


def crossings(shape, line) -> int:
    """Count where one polyline crosses another, by the signs of areas."""
    a, b = shape[:-1, None], shape[1:, None]
    c, d = line[None, :-1], line[None, 1:]

    def area(p, q, r):
        return (q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0]

    apart = area(a, b, c) * area(a, b, d) < 0.0
    return int((apart & (area(c, d, a) * area(c, d, b) < 0.0)).sum())


@pytest.mark.parametrize("seed", range(6))
def test_no_rod_passes_a_wall_in_lumens_nobody_chose(seed):
    rng = np.random.default_rng(1000 + seed)
    legs = [(3.0, 0.0)]
    while sum(length for length, _ in legs) < 40.0:
        legs.append((float(rng.uniform(5.0, 12.0)), float(rng.uniform(-110.0, 110.0))))
    rod = gmc(int(rng.integers(1, 8)))
    lumen = channel(
        "any",
        width_mm=rod.side_mm * float(rng.uniform(1.3, 2.5)),
        legs=legs,
        mode=str(rng.choice(["feed", "push"])),
    )
    passage = navigate(
        rod, lumen, UniformField(flux_mT=float(rng.uniform(-80.0, 80.0))),
        friction=float(rng.choice([0.0, 0.3])), push_limit_N=0.5, refine=False,
    )  # fmt: skip
    assert len(passage.steps) > 10
    for step in passage.steps:
        shape = step.shape[:2].T
        assert all(crossings(shape, outline(wall.arcs)) == 0 for wall in lumen.walls)
        assert step.overlap_mm < 1e-2
