from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from magbend.analysis.runs.field_check import check_against_magnet, check_readings
from magbend.analysis.runs.field_scan import judge_scan
from magbend.analysis.twin.plan_preview import preview_plan
from magbend.core.errors import InputError
from magbend.core.magnet import Magnet
from magbend.core.specimen import Section, Specimen
from magbend.sim.magnet.fit import axis_share

GAPS_MM = (70.0, 60.0, 50.0)
READINGS_MT = (38.0, 50.0, 66.0)
PRINTED_T = (1.3578, 1.3050, 1.2938)


def test_of_the_papers_readings_two_pass_and_the_third_is_flagged() -> None:
    verdicts = check_readings(GAPS_MM, READINGS_MT, PRINTED_T, tolerance_percent=1.0)
    assert [verdict.verdict == "ok" for verdict in verdicts] == [True, True, False]
    third = verdicts[2]
    assert third.remanence_T == pytest.approx(1.2186, abs=5e-5)
    assert third.predicted_mT == pytest.approx(70.07, abs=0.005)
    assert "70.07 mT" in third.verdict
    # 2.6 mT/mm there: the missing 4 mT are 1.6 mm.
    assert third.gap_error_mm == pytest.approx(1.6, abs=0.1)


@given(
    gap_mm=st.floats(5.0, 300.0),
    remanence_T=st.floats(0.1, 1.5),
    side_mm=st.floats(10.0, 100.0),
    error_mm=st.floats(-0.3, 0.3),
)
def test_the_gap_error_is_found_again(gap_mm, remanence_T, side_mm, error_mm) -> None:
    magnet = Magnet.cube(side_mm, remanence_T)
    flux = 1e3 * remanence_T * axis_share(gap_mm + error_mm, magnet.sides_mm)
    (verdict,) = check_against_magnet([gap_mm], [flux], magnet)
    assert verdict.gap_error_mm == pytest.approx(error_mm, abs=0.03)


@pytest.mark.parametrize(
    ("factor", "word"), [(10.0, "unit G"), (0.1, "unit mT"), (-1.0, "turned round")]
)
def test_slips_of_unit_and_sign_are_named(factor: float, word: str) -> None:
    magnet = Magnet.cube(55.0, 1.305)
    (verdict,) = check_against_magnet([60.0], [factor * 50.0], magnet)
    assert word in verdict.verdict


def test_a_noisy_reading_is_allowed_two_deviations() -> None:
    magnet = Magnet.cube(55.0, 1.305)
    assert check_against_magnet([60.0], [51.5], magnet)[0].verdict != "ok"
    assert check_against_magnet([60.0], [51.5], magnet, sd_mT=[1.0])[0].verdict == "ok"


@pytest.mark.parametrize(
    ("gaps", "flux", "remanence"),
    [([60.0], [50.0, 40.0], 1.3), ([0.0], [50.0], 1.3), ([60.0], [float("nan")], 1.3)],
)
def test_impossible_input_is_named(gaps, flux, remanence) -> None:
    with pytest.raises(InputError):
        check_readings(gaps, flux, remanence)


def test_a_scan_gives_the_remanence_and_a_figure(tmp_path: Path) -> None:
    magnet = Magnet.cube(55.0, 1.305)
    gaps = [100.0, 80.0, 60.0]
    flux = [1330.0 * axis_share(gap, magnet.sides_mm) for gap in gaps]
    judged = judge_scan(tmp_path / "field.csv", gaps, flux, [0.05] * 3, magnet)
    assert judged.fit.remanence_T == pytest.approx(1.33, rel=1e-9)
    assert all(v.verdict != "ok" for v in judged.verdicts)
    assert (tmp_path / "field.svg").read_text().startswith("<?xml")
    assert "1.3300 T" in judged.lines()[0]
    assert judged.as_dict()["readings"][0]["beside_the_others"] == "ok"


def test_the_preview_agrees_with_the_axis_formula() -> None:
    rod = Specimen(
        name="r", side_mm=1.0, remanence_mT=20.07,
        sections=(Section(length_mm=30.0, E_MPa=15.0),),
    )  # fmt: skip
    magnet = Magnet.cube(55.0, 1.305)
    steps = preview_plan(rod, magnet, GAPS_MM)
    for step in steps:
        expected = 1305.0 * axis_share(step.gap_mm, magnet.sides_mm)
        assert step.flux_mT == pytest.approx(expected, rel=1e-9)
        assert step.status == "stable"
        assert step.tip_mm[1] > 0.0
