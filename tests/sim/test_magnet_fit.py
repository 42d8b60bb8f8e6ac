"""The remanence from readings: the paper's three, and readings with known truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.special import stdtrit

from magbend.core.errors import ConfigError, InputError
from magbend.core.magnet import Magnet
from magbend.sim import fit_magnet, magnet_flux_mT
from magbend.sim.magnet.fit import (
    axis_flux_by_integral_mT,
    axis_share,
)
from magbend.sim.magnet.readings import paper_readings, read_readings
from magbend.sim.magnet.student_t import student_t_95


def test_the_papers_readings() -> None:
    paper = paper_readings()
    fit = fit_magnet([r.gap_mm for r in paper], [r.flux_mT for r in paper])
    alone = [reading.remanence_T for reading in fit.readings]
    # Dossier, section 4, to all digits given there.
    assert alone == pytest.approx(
        [1.35781205021257, 1.30498996919027, 1.21859680191715], rel=1e-13
    )
    assert [round(value, 4) for value in alone[:2]] == [1.3578, 1.3050]
    assert round(alone[2], 4) != paper[2].printed_T
    assert paper[2].flux_needed_mT == pytest.approx(70.073, abs=5e-4)
    assert fit.remanence_T == pytest.approx(1.2886, abs=5e-5)
    residuals = [reading.residual_percent for reading in fit.readings]
    assert residuals == pytest.approx([-5.1, -1.3, 5.7], abs=0.05)
    assert fit.readings[2].verdict != "ok"


def test_a_free_offset_is_unphysical_for_the_paper() -> None:
    paper = paper_readings()
    fit = fit_magnet(
        [r.gap_mm for r in paper], [r.flux_mT for r in paper], free_offset=True
    )
    assert fit.remanence_T == pytest.approx(2.33, abs=0.005)
    assert fit.offset_mm == pytest.approx(19.5, abs=0.05)


@pytest.mark.parametrize("sides", [(55.0, 55.0, 55.0), (30.0, 20.0, 10.0)])
@pytest.mark.parametrize("gap_mm", [5.0, 60.0, 300.0])
def test_three_roads_to_the_axis(sides: tuple[float, ...], gap_mm: float) -> None:
    magnet = Magnet(sides_mm=sides, remanence_T=1.3)
    point = (30.0, 0.0, 0.0)
    kernel = magnet_flux_mT(magnet, point, length_mm=30.0, gap_mm=gap_mm)[1]
    closed = 1.3e3 * axis_share(gap_mm, sides)
    integral = axis_flux_by_integral_mT(1.3, gap_mm, sides)
    assert closed == pytest.approx(kernel, rel=2e-11)
    assert integral == pytest.approx(kernel, rel=2e-11)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_recovers_remanence_and_offset(sign: float) -> None:
    gaps = np.linspace(30.0, 90.0, 9)
    flux = sign * 1.31e3 * axis_share(gaps + 2.5)
    fit = fit_magnet(gaps, flux, free_offset=True)
    assert fit.remanence_T == pytest.approx(sign * 1.31, rel=1e-6)
    assert fit.offset_mm == pytest.approx(2.5, abs=1e-4)
    assert all(reading.verdict == "ok" for reading in fit.readings)


def test_the_uncertainty_is_the_scatter() -> None:
    rng = np.random.default_rng(8)
    gaps = np.linspace(30.0, 90.0, 8)
    truth = 1.3e3 * axis_share(gaps)
    pulls = []
    for _ in range(300):
        sd = 0.3 * np.ones(8)
        fit = fit_magnet(gaps, truth + rng.normal(0.0, 0.3, 8), sd_mT=sd)
        pulls.append((fit.remanence_T - 1.3) / fit.remanence_sd_T)
    assert np.std(pulls) == pytest.approx(1.0, abs=0.12)
    assert abs(np.mean(pulls)) < 0.2


@pytest.mark.parametrize(
    ("count", "understated", "free_offset"),
    [(3, 1.0, False), (8, 5.0, False), (3, 5.0, True), (8, 1.0, True)],
)
def test_the_interval_covers_though_the_stated_sd_are_too_small(
    count: int, understated: float, free_offset: bool
) -> None:
    rng = np.random.default_rng(9)
    gaps = np.linspace(30.0, 90.0, count)
    truth = 1.3e3 * axis_share(gaps)
    covered, times = 0, 400
    for _ in range(times):
        sd = np.full(count, 0.03 / understated)
        flux = truth + rng.normal(0.0, 0.03, count)
        fit = fit_magnet(gaps, flux, sd_mT=sd, free_offset=free_offset)
        low, high = fit.remanence_95_T
        covered += low < 1.3 < high
        assert fit.birge_ratio == max(1.0, np.sqrt(fit.chi2_reduced))
    # Of 95 % of 400 three standard deviations are 3.3 %.
    assert covered / times > 0.917
    if understated > 1.0:
        assert covered / times < 0.983


@pytest.mark.parametrize("freedom", [1, 2, 3, 4, 7, 30, 1001])
def test_students_t_is_scipys(freedom: int) -> None:
    assert student_t_95(freedom) == pytest.approx(stdtrit(freedom, 0.975), rel=1e-11)


def test_stated_sd_that_are_too_large_narrow_nothing() -> None:
    gaps = np.linspace(30.0, 90.0, 8)
    flux = 1.3e3 * axis_share(gaps)
    fit = fit_magnet(gaps, flux, sd_mT=0.01 * flux)
    assert fit.birge_ratio == 1.0
    assert fit.remanence_sd_T == pytest.approx(0.013 / np.sqrt(8.0))
    low, high = fit.remanence_95_T
    assert high - low == pytest.approx(2 * 1.95996 * fit.remanence_sd_T, rel=1e-5)


def test_one_wrong_reading_does_not_blame_the_others() -> None:
    gaps = [40.0, 50.0, 60.0, 70.0, 80.0]
    flux = [float(1.3e3 * axis_share(gap)) for gap in gaps]
    flux[1] *= 0.9
    verdicts = [reading.verdict for reading in fit_magnet(gaps, flux).readings]
    assert [verdict == "ok" for verdict in verdicts] == [True, False, True, True, True]


def test_a_reading_given_again_to_its_last_digit_makes_nothing_surer() -> None:
    once = fit_magnet([70.0, 60.0, 50.0], [38.0, 50.0, 66.0])
    twice = fit_magnet([70.0, 60.0, 50.0] * 2, [38.0, 50.0, 66.0] * 2)
    assert twice.remanence_95_T == pytest.approx(once.remanence_95_T)
    assert np.isnan(fit_magnet([70.0] * 3, [38.0] * 3).remanence_sd_T)


def test_readings_at_one_gap_tell_no_offset() -> None:
    with pytest.raises(InputError, match="2 or more different gap_mm"):
        fit_magnet([70.0] * 3, [38.0, 38.0, 39.0], free_offset=True)


def test_one_reading_has_no_uncertainty_of_its_own() -> None:
    fit = fit_magnet([60.0], [50.0])
    assert np.isnan(fit.remanence_sd_T)
    assert fit_magnet([60.0], [50.0], sd_mT=[0.5]).remanence_sd_T == pytest.approx(
        0.01 * fit.remanence_T
    )


@pytest.mark.parametrize(
    ("gaps", "flux", "sd", "pattern"),
    [
        ([], [], None, "reading"),
        ([60.0], [50.0, 40.0], None, "one length"),
        ([0.0], [50.0], None, r"gap_mm.*mm"),
        ([60.0], [np.nan], None, r"flux_mT.*mT"),
        ([60.0, 70.0], [50.0, -38.0], None, r"flux_mT.*sign"),
        ([60.0], [50.0], [0.0], r"sd_mT.*mT"),
    ],
)
def test_bad_readings_are_refused(
    gaps: list[float], flux: list[float], sd: list[float] | None, pattern: str
) -> None:
    with pytest.raises(InputError, match=pattern):
        fit_magnet(gaps, flux, sd_mT=sd)


def test_reads_a_table(tmp_path: Path) -> None:
    path = tmp_path / "readings.csv"
    path.write_text("gap_mm, flux_mT, sd_mT\n70, 38, 0.5\n60, 50, 0.5\n")
    assert read_readings(path) == ([70.0, 60.0], [38.0, 50.0], [0.5, 0.5])


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("gap_mm,flux_mT\n", "at least one row"),
        ("gap,flux\n1,2\n", "without a unit; head it gap_mm"),
        ("gap_mm,flux_mT\n70,38\n60,much\n", "line 3: flux_mT"),
        ("gap_mm,flux_mT\n70\n", "line 2: has 1 of the 2 values"),
    ],
)
def test_bad_tables_name_the_line(tmp_path: Path, text: str, pattern: str) -> None:
    path = tmp_path / "readings.csv"
    path.write_text(text)
    with pytest.raises(ConfigError, match=pattern):
        read_readings(path)


def test_absurd_readings_are_refused_with_their_unit(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gap_mm must be from 0 to 100000 mm"):
        fit_magnet([1e300, 60.0], [38.0, 50.0])
    with pytest.raises(InputError, match=r"flux_mT must be from -30000 to 30000 mT"):
        fit_magnet([70.0, 60.0], [38.0, 1e300])
    path = tmp_path / "readings.csv"
    path.write_text("gap_mm,flux_mT\n70,5,38\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"line 2: has more values"):
        read_readings(path)
