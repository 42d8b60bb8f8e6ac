"""Rods that pass a lumen: of one stiffness, and better than one picked by hand."""

from __future__ import annotations

from pathlib import Path

import pytest

from magbend.analysis.design.makeable import Makeable
from magbend.analysis.design.through import design_through, tip_stiffness_N_mm
from magbend.core.errors import SolverError
from magbend.sim import UniformField, gmc
from magbend.sim.navigate import navigate, read_lumen

LUMENS = Path(__file__).parents[2] / "fixtures" / "lumens"
NOTHING = UniformField(flux_mT=0.0)


def test_the_stiffness_of_a_uniform_rod_is_3_EI_over_L3():
    rod = gmc(2)
    like = type(rod)(
        name="uniform",
        side_mm=1.0,
        remanence_mT=0.0,
        sections=tuple(
            type(s)(length_mm=s.length_mm, E_MPa=12.0) for s in rod.sections
        ),
    )
    assert tip_stiffness_N_mm(like) == pytest.approx(3.0 * 12.0 / 12.0 / 30.0**3)


def test_a_design_presses_less_than_the_papers_rod_of_its_stiffness():
    bend = read_lumen(LUMENS / "bend90.toml")
    wanted = tip_stiffness_N_mm(gmc(2))
    best = design_through(
        bend, NOTHING, Makeable(side_mm=(1.0, 1.0)), stiffness_N_mm=wanted,
        friction=0.2, trials=16, count=2,
    )[0]  # fmt: skip
    assert tip_stiffness_N_mm(best.specimen) == pytest.approx(wanted, rel=1e-3)
    assert best.passage.outcome == "inserted"
    by_hand = navigate(gmc(2), bend, NOTHING, friction=0.2, refine=False)
    assert best.passage.most("wall_N") < by_hand.most("wall_N")
    moduli = [section.E_MPa for section in best.specimen.sections]
    assert all(8.0 <= E <= 50.0 for E in moduli)
    assert moduli == sorted(moduli, reverse=True)


def test_a_stiffness_that_nothing_makeable_has_is_named():
    bend = read_lumen(LUMENS / "bend90.toml")
    with pytest.raises(SolverError, match=r"tip stiffness of 9 N/mm"):
        design_through(bend, NOTHING, Makeable(), stiffness_N_mm=9.0, trials=8)
