"""Branches that a rod leaves in snaps: unstable states, folds, what lies beyond."""

from __future__ import annotations

import math

import pytest

from magbend.cli.sim_navigate import _print as show
from magbend.cli.sim_navigate import _summary as summary
from magbend.core.errors import InputError
from magbend.core.specimen import Section, Specimen
from magbend.sim import UniformField, find_equilibria, gmc
from magbend.sim.navigate import (
    Lumen,
    Passage,
    Wall,
    channel,
    draw_passage,
    navigate,
    polyline,
)
from magbend.sim.navigate.branch import follow_branch
from magbend.sim.navigate.in_plane import State, at_rest
from magbend.sim.navigate.settle import SETTLED, SOFT
from magbend.sim.navigate.solver import planar_walk
from magbend.sim.tube import Tube


def soft(length_mm: float) -> Specimen:
    return Specimen(
        name="soft", side_mm=1.0, remanence_mT=60.0,
        sections=(Section(length_mm=length_mm, E_MPa=2.0),),
    )  # fmt: skip


def turning(insertion_mm: float) -> UniformField:
    """Return a field that turns a rod of 28 mm round by 210 degrees on 2 mm more."""
    turn_deg = 90.0 * max(0.0, insertion_mm - 28.0)
    return UniformField(flux_mT=40.0, angle_deg=150.0 + turn_deg)


@pytest.fixture(scope="module")
def turned() -> Passage:
    return navigate(
        soft(30.0), channel("wide", width_mm=90.0, legs=[(100.0, 0.0)]), turning,
        way_mm=(28.0, 29.3), step_mm=0.5, refine=False, branches=True,
    )  # fmt: skip


def test_a_free_rod_that_loses_its_state_swings_to_the_one_that_is_left(turned):
    """Just behind a fold the way down begins slowly; it is gone to the end."""
    assert turned.outcome == "inserted"
    last = turned.steps[-1]
    (there,) = [
        e for e in find_equilibria(soft(29.3), turning(29.3)) if e.morse_index == 0
    ]
    assert math.dist(last.tip_mm, there.centreline.tip_mm) < 1e-6


def test_a_free_rods_branch_is_that_of_all_equilibria(turned):
    (branch,) = turned.branches
    snap = turned.snaps[0]
    assert branch.folds_mm[0] == pytest.approx(snap.insertion_mm, abs=2 * 0.5 / 256)
    pairs = list(zip(branch.steps, branch.indices, strict=True))
    assert {index for _, index in pairs[3:]} == {1}
    for step, index in pairs[5::20]:
        found = find_equilibria(soft(step.insertion_mm), turning(step.insertion_mm))
        nearest = min(found, key=lambda e: math.dist(e.centreline.tip_mm, step.tip_mm))
        assert math.dist(nearest.centreline.tip_mm, step.tip_mm) < 1e-7
        assert nearest.morse_index == index


def test_a_branch_is_told_in_a_line(turned, capsys):
    show(summary(turned), turned)
    lines = [s for s in capsys.readouterr().out.splitlines() if "branch left" in s]
    (fold_mm,) = turned.branches[0].folds_mm
    assert len(lines) == 1
    assert f"folds at {fold_mm:.3f}; stable again nowhere" in lines[0]


def test_branches_are_refused_where_there_are_none():
    lumen = channel("straight", width_mm=3.0, legs=[(40.0, 0.0)])
    with pytest.raises(InputError, match="friction must be 0 to follow branches"):
        navigate(gmc(2), lumen, turning, friction=0.1, branches=True)
    tube = Tube(name="pipe", points_mm=[(0, 0, 0), (40, 0, 0)], radius_mm=2.0)
    with pytest.raises(InputError, match="branches are followed in planar lumens"):
        navigate(gmc(2), tube, turning, branches=True)


@pytest.mark.slow
def test_in_a_blind_end_the_branch_goes_through_folds_and_corners(tmp_path):
    """A rod pushed on an end wall snaps, and back: where its branch goes from there.

    It turns at folds, where an index changes, and at corners, where a wall is first
    touched. What it calls stable the ordinary way of coming to rest leaves as it is.
    """
    blind = Lumen(
        name="blind",
        walls=(Wall("box", polyline([(0, 2), (20, 2), (20, -2), (0, -2)])),),
        inside_mm=(1.0, 0.0),
    )
    walk = planar_walk(
        gmc(2), blind, UniformField(flux_mT=5.0), step_mm=0.5, friction=0.0
    )
    assert walk.go_to(24.52)
    assert walk.go_to(22.5)
    left, step_mm = walk.left[-1]
    states: list[State] = []

    def seen(state: State):
        states.append(state)
        return walk.seen(state)

    branch = follow_branch(walk.case, left, math.copysign(1.0, step_mm), 0.5, seen)
    back_mm = walk.events[-1].insertion_mm
    assert branch.folds_mm[0] == pytest.approx(back_mm, abs=2 * 0.5 / 256)
    (high, low), *_ = branch.stable_mm
    assert 23.0 < low < high < 24.0
    won = branch.steps[-1].energy_Nmm - branch.steps[0].energy_Nmm
    assert branch.work_Nmm == pytest.approx(won, rel=5e-3)
    assert min(c.force_N for step in branch.steps for c in step.contacts) > 0.0
    for state, index in list(zip(states, branch.indices, strict=True))[1:40:3]:
        outcome, rested = at_rest(walk.case, state, state.insertion_mm, SOFT)
        stays = outcome == SETTLED and rested.moved < 1e-5
        assert stays or index > 0
    passage = Passage(
        lumen="blind", specimen="GMC 2", outcome=walk.outcome, error_mm=math.nan,
        steps=tuple(walk.steps), events=tuple(walk.events), branches=(branch,),
    )  # fmt: skip
    draw_passage(tmp_path / "blind.svg", blind, passage, side_mm=gmc(2).side_mm)
    assert "dotted where unstable" in (tmp_path / "blind.svg").read_text()
