"""A fit knows when it is wrong, and does not cry when it is right."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from analysis_factory import write_run
from numpy.polynomial.legendre import legval
from scipy import stats
from wrong_models import GAPS_MM, MAGNET, WRONG, Wrong, all_off, bench_of, wrong_run

from magbend import sim
from magbend.analysis import (
    compare_run,
    fit_runs,
    load_run,
    model_sentence,
    with_refitted,
)
from magbend.analysis.fit.noise import MODES, mode_matrix, noise_mm, spectrum
from magbend.analysis.fit.nuisance import NUISANCE_NAMES, Nuisance
from magbend.analysis.fit.problem import with_prior
from magbend.analysis.fit.residuals import residuals
from magbend.analysis.fit.result import write_fit
from magbend.analysis.fit.search import Limits, priors, search
from magbend.analysis.twin.bench import HiddenTruth, TwinBench
from magbend.analysis.twin.lines import LineErrors, lines_run
from magbend.core.errors import SolverError
from magbend.core.specimen import Section, Specimen

HELD = Nuisance(**dict.fromkeys(NUISANCE_NAMES, 0.0))


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_model_is_covered_or_not_supported(name: str) -> None:
    run, moduli = wrong_run(WRONG[name], seed=101)
    fit = fit_runs([run])
    verdict = fit.verdict
    assert verdict is not None
    assert "e-" not in " ".join(verdict.reasons)  # numbers for people
    z = (np.array(fit.E_MPa) - moduli) / fit.E_sd_MPa
    assert np.all(np.abs(z) < 1.96) or verdict.verdict != "supported"
    if WRONG[name].told:
        first_two = [suspect.name for suspect in verdict.suspects[:2]]
        assert any(suspect.startswith(WRONG[name].right) for suspect in first_two)


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG)
def test_wrong_models_are_covered_or_not_supported_often(name: str) -> None:
    held = []
    for seed in range(200, 220):
        run, moduli = wrong_run(WRONG[name], seed)
        fit = fit_runs([run])
        z = (np.array(fit.E_MPa) - moduli) / fit.E_sd_MPa
        assert fit.verdict is not None
        doubted = fit.verdict.verdict != "supported"
        held.append(doubted or bool(np.all(np.abs(z) < 1.96)))
    assert np.mean(held) >= 0.95


@pytest.mark.parametrize("runs", [6, pytest.param(200, marks=pytest.mark.slow)])
def test_a_right_model_is_supported_and_covered(runs: int) -> None:
    z, words = [], []
    for seed in range(700, 700 + runs):
        bench, errors, rng = all_off(seed)
        fit = fit_runs([lines_run(bench, GAPS_MM, rng, errors)])
        assert fit.verdict is not None
        words.append(fit.verdict.verdict)
        for i, section in enumerate(bench.truth.specimen.sections):
            if math.isfinite(fit.E_MPa[i]):
                z.append((fit.E_MPa[i] - section.E_MPa) / fit.E_sd_MPa[i])
    inside = int(np.sum(np.abs(z[::3]) < 1.96))
    # Moduli of a run err together: each run counts once.
    assert stats.binom.cdf(inside, len(z[::3]), 0.95) > 0.01
    alarms = sum(word != "supported" for word in words)
    assert stats.binom.sf(alarms - 1, runs, 0.05) > 0.01


def test_file_has_the_words_of_the_verdict(tmp_path: Path) -> None:
    run, _ = wrong_run(WRONG["gap +3 mm"], seed=102)
    fit = fit_runs([run])
    write_fit(tmp_path / "fit.json", fit)
    data = json.loads((tmp_path / "fit.json").read_text())
    assert data["verdict"] in ("doubtful", "contradicted")
    assert 0.0 <= data["p_value"] < 0.05
    assert data["pulls"]["gap_mm"] > 3.0
    best = data["suspects"][0]
    assert set(best) == {"name", "value", "sd", "unit", "delta_chi2"}
    assert (best["name"], best["unit"]) == ("gap_mm", "mm")
    assert best["value"] == pytest.approx(3.0, abs=3.0 * best["sd"])
    assert best["delta_chi2"] >= data["suspects"][1]["delta_chi2"]
    for whole, noise in zip(
        data["E_sd_MPa"], data["E_sd_statistical_MPa"], strict=True
    ):
        assert 0.0 < noise < whole
    assert {model["model"] for model in data["models"]} == {
        "magnet", "uniform", "solid"
    }  # fmt: skip
    assert set(data["models"][0]) >= {"model", "aic", "rms_um"}


def test_the_uniform_field_is_contradicted_and_the_magnet_named() -> None:
    run, _ = wrong_run(WRONG["side +3 %"], seed=103)
    fit = fit_runs([run], model="uniform")
    assert fit.verdict is not None
    assert fit.verdict.verdict == "contradicted"
    assert "the magnet's field" in fit.verdict.suspects[0].name
    assert fit.verdict.models[-1].model == "uniform"
    assert "a uniform field leaves" in model_sentence(fit.verdict.models)


def test_the_budget_is_that_of_the_formula() -> None:
    """A plain rod in a field: E goes as side^-2 and as the remanence, nothing else."""
    run, _ = wrong_run(WRONG["bow 1/5000 per mm"], seed=104)
    priors = replace(HELD, side_percent=2.0, remanence_percent=3.0)
    bare = replace(
        run,
        frames={name: replace(f, width_mm=math.nan) for name, f in run.frames.items()},
    )
    fit = fit_runs([bare], nuisance=priors, judged=False)
    for i in range(3):
        whole = fit.E_sd_MPa[i] / fit.E_MPa[i]
        noise = fit.E_sd_statistical_MPa[i] / fit.E_MPa[i]
        assert whole == pytest.approx(math.hypot(0.04, 0.03, noise), rel=0.02)
        assert fit.budget["side_percent"][i] == pytest.approx(0.04, rel=0.02)
        assert fit.budget["remanence_percent"][i] == pytest.approx(0.03, rel=0.02)


def test_a_stated_deviation_replaces_the_assumed_one() -> None:
    run, _ = wrong_run(WRONG["side +3 %"], seed=105)
    stated = replace(
        run.specimen, side_sd_mm=0.002, length_sd_mm=0.03, remanence_sd_mT=0.2,
        natural_curvature_sd_per_mm=1e-5,
    )  # fmt: skip
    fit = fit_runs([replace(run, specimen=stated)], judged=False)
    prior = {row["name"]: row["prior_sd"] for row in fit.nuisance}
    assert prior["side_percent"] == pytest.approx(0.2 / stated.side_mm)
    assert prior["length_mm"] == 0.03
    assert prior["remanence_percent"] == pytest.approx(20.0 / stated.remanence_mT)
    assert prior["natural_curvature_per_mm"] == 1e-5
    assert prior["magnet_percent"] == pytest.approx(1.3 / 1.305)


def test_wide_priors_do_not_hide_lines_that_no_rod_can_have() -> None:
    """A wave that turns round from photograph to photograph, 2.7 times their errors.

    Everything else is within its prior: the misfit as a whole does not show it.
    """
    run, _ = wrong_run(Wrong(right=()), seed=311)
    frames = {}
    for k, (name, frame) in enumerate(run.frames.items()):
        line = frame.centreline
        wave = legval(2.0 * line.s_mm / line.length_mm - 1.0, [0.0, 0.0, 0.0, 1.0])
        off_mm = 0.8e-3 * math.sqrt(7.0) * (-1) ** k * wave
        waved = replace(
            line,
            x_mm=line.x_mm - off_mm * np.sin(line.theta_rad),
            y_mm=line.y_mm + off_mm * np.cos(line.theta_rad),
        )
        frames[name] = replace(frame, centreline=waved)
    for seen, supported in ((run.frames, True), (frames, False)):
        verdict = fit_runs([replace(run, frames=seen)]).verdict
        assert verdict is not None
        assert (verdict.verdict == "supported") is supported


def test_a_rod_found_too_soft_does_not_look_surer() -> None:
    """One that hardly bends: its shape tells 1/E, whose errors are even."""
    rod = Specimen(
        name="one", side_mm=1.0, remanence_mT=20.0,
        sections=(Section(length_mm=30.0, E_MPa=15.0),),
    )  # fmt: skip
    truth = HiddenTruth(specimen=rod, magnet=MAGNET, clamp_angle_deg=0.0)
    z = []
    for seed in range(40):
        bench = TwinBench(rod, MAGNET, seed=seed, truth=truth)
        errors = LineErrors(30.0, *[0.0] * 6)
        run = lines_run(bench, (200.0,), np.random.default_rng([seed, 41]), errors)
        fit = fit_runs([run], nuisance=HELD, judged=False)
        z.append((fit.E_MPa[0] - 15.0) / fit.E_sd_MPa[0])
    assert np.nanmax(np.abs(z)) < 3.0
    assert np.nanmean(np.abs(z) < 1.0) > 0.68


def test_a_search_ends_where_its_derivatives_ask_for_no_step() -> None:
    """Derivatives of its start would end it elsewhere, where much is left over."""
    run, _ = wrong_run(WRONG["smooth stiffness gradient"], seed=101)
    fit = fit_runs([run], judged=False)
    wide = with_prior(fit.problem, "remanence_profile_percent", 0, 30.0)
    limits = Limits()
    found = search(wide, limits, np.append(fit.unknowns, 0.0))
    data, slopes = residuals(wide, found)
    rows = np.diag(priors(wide, limits)[:, 1])
    step = np.linalg.pinv(np.vstack([slopes, rows])) @ [*data, *(rows @ found)]
    assert np.max(np.abs(step)) < 0.02


@pytest.mark.parametrize("size_um", [0.3, 5.0])
def test_lines_show_their_own_errors(size_um: float) -> None:
    """Whatever their measurement states, ten times too much here."""
    rng = np.random.default_rng(1)
    lines = [
        1e-3 * size_um * spectrum(MODES) * rng.standard_normal(MODES) for _ in range(6)
    ]
    found = noise_mm(lines, [1e-2 * size_um] * 6)
    assert np.median(found) == pytest.approx(1e-3 * size_um, rel=0.4)


def test_modes_are_those_of_the_values() -> None:
    s = np.sort(np.random.default_rng(2).uniform(0.0, 30.0, 80))
    x = 2.0 * (s - s[0]) / (s[-1] - s[0]) - 1.0
    modes = mode_matrix(s) @ (2.0 + 0.5 * math.sqrt(3.0) * x)
    assert modes == pytest.approx([2.0, 0.5, *[0.0] * (MODES - 2)], abs=1e-9)
    assert len(mode_matrix(s[:9])) == 3


def test_a_modulus_on_its_bound_is_said() -> None:
    run, _ = wrong_run(WRONG["side +3 %"], seed=106)
    free = fit_runs([run], judged=False).E_MPa[0]
    fit = fit_runs([run], bounds_MPa=(5.0, 0.8 * free))
    assert "E_MPa[0] lies on its bound" in fit.on_bounds[0]
    assert fit.verdict is not None
    assert fit.verdict.verdict != "supported"
    assert fit.on_bounds[0] in fit.verdict.reasons


def test_flags_of_the_photographs_come_along() -> None:
    run, _ = wrong_run(WRONG["tip section 11 mm"], seed=107)
    frames = {
        name: replace(frame, flags=("length_mismatch", "shadow"))
        for name, frame in run.frames.items()
    }
    verdict = fit_runs([replace(run, frames=frames)]).verdict
    assert verdict is not None
    assert verdict.flags == {"length_mismatch": 3, "shadow": 3}
    assert "3 of 3 photographs are flagged length_mismatch" in verdict.reasons


def test_a_default_bench_with_a_density_is_fitted() -> None:
    """The camera looks down on the rod, its weight leaves the plane."""
    bench, _, rng = all_off(3)
    heavy = replace(bench.specimen, density_kg_m3=2640.0)
    bench.specimen = heavy
    bench.truth = replace(bench.truth, specimen=replace(
        bench.truth.specimen, density_kg_m3=2640.0))  # fmt: skip
    run = lines_run(bench, GAPS_MM, rng)
    assert run.support.gravity_m_s2[2] < -9.8
    fit = fit_runs([run], judged=False)
    truth = [section.E_MPa for section in bench.truth.specimen.sections]
    assert np.all(np.abs(np.array(fit.E_MPa) - truth) < 3.0 * np.array(fit.E_sd_MPa))


def test_a_solid_rod_is_a_model_of_its_own() -> None:
    run, _ = wrong_run(WRONG["side +3 %"], seed=108)
    plain, solid = (fit_runs([run], model=m, judged=False) for m in ("magnet", "solid"))
    assert 0.0 < abs(solid.E_MPa[0] / plain.E_MPa[0] - 1.0) < 0.02


def test_a_rod_that_bends_the_other_way_is_told_by_its_sign() -> None:
    run, _ = wrong_run(WRONG["side +3 %"], seed=109)
    wrong = replace(run.specimen, remanence_mT=-run.specimen.remanence_mT)
    with pytest.raises(SolverError, match="bends the other way in every photograph"):
        fit_runs([replace(run, specimen=wrong)])


def test_a_strongly_bowed_rod_gets_the_right_reason() -> None:
    """Once refused as a gap of 8.61 mm."""
    bowed = replace(
        WRONG["bow 1/2000 per mm"], off={"natural_curvature_per_mm": 1 / 500}
    )
    run, _ = wrong_run(bowed, seed=110)
    verdict = fit_runs([run]).verdict
    assert verdict is not None
    assert verdict.verdict == "contradicted"
    assert verdict.suspects[0].name == "natural_curvature_per_mm"
    assert verdict.suspects[0].value == pytest.approx(1 / 500, rel=0.1)


def test_models_are_compared_like_with_like(tmp_path: Path) -> None:
    """With nominal moduli that are wrong the wrong theory can look better."""
    nominal = sim.gmc(2)
    stiff = tuple(replace(s, E_MPa=1.12 * s.E_MPa) for s in nominal.sections)
    write_run(tmp_path / "a", specimen=nominal, truth=replace(nominal, sections=stiff))
    done = with_refitted(compare_run(load_run(tmp_path / "a")))
    rms = {
        (one.moduli, one.model): one.errors.rms_mm
        for one in done.comparisons
        if one.errors and one.step.index == 2
    }
    assert len(rms) == 4
    assert rms["refitted", "magnet"] < 0.1 * rms["refitted", "uniform"]
    assert rms["refitted", "magnet"] < 0.1 * rms["nominal", "magnet"]


def test_a_picture_without_field_pins_the_bow() -> None:
    bench, errors, _ = all_off(11)
    sds = []
    for gaps_mm in (GAPS_MM, (149.0, *GAPS_MM)):
        run = lines_run(bench, gaps_mm, np.random.default_rng(3), errors)
        rows = fit_runs([run], judged=False).nuisance
        sds += [r["sd"] for r in rows if r["name"] == "natural_curvature_per_mm"]
    assert sds[1] < 0.8 * sds[0]


@pytest.mark.parametrize("measured", [True, False])
def test_what_no_photograph_tests_is_said(measured: bool) -> None:
    """Told another remanence, the moduli are off by as much as is said."""
    run, _ = wrong_run(WRONG["bow 1/5000 per mm"], seed=111)
    if not measured:
        frames = {k: replace(f, width_mm=math.nan) for k, f in run.frames.items()}
        run = replace(run, frames=frames)
    fit = fit_runs([run])
    assert fit.verdict is not None
    told = {one.name: one for one in fit.verdict.rests_on}
    assert set(told) == {"remanence_percent"} | (
        set() if measured else {"side_percent"}
    )
    other = run.specimen.remanence_mT * (1.0 + told["remanence_percent"].sd / 100.0)
    again = fit_runs(
        [replace(run, specimen=replace(run.specimen, remanence_mT=other))], judged=False
    )
    change = 100.0 * np.log(np.array(again.E_MPa) / fit.E_MPa)
    assert told["remanence_percent"].moduli_percent == pytest.approx(change, rel=0.05)
    assert "remanence_mT = " in fit.verdict.told_sentence()


def test_a_photograph_of_another_gap_is_named() -> None:
    """Taken at 55 mm, said to be at 60: the field there is known to be stronger."""
    bench, _ = bench_of(WRONG["gap +3 mm"], seed=112)
    run, other = (
        lines_run(bench, gaps_mm, np.random.default_rng(4))
        for gaps_mm in (GAPS_MM, (70.0, 55.0, 50.0))
    )
    odd = run.steps[1].image
    frames = run.frames | {odd: other.frames[odd]}
    verdict = fit_runs([replace(run, frames=frames)]).verdict
    assert verdict is not None
    assert verdict.verdict == "contradicted"
    found = verdict.suspects[0]
    assert found.name == f"field_percent ({run.label}, step 2)"
    stronger = bench.flux_mT(55.0) / bench.flux_mT(60.0)
    assert found.value == pytest.approx(100.0 * (stronger - 1.0), rel=0.1)


def test_theories_that_fit_alike_are_not_ranked() -> None:
    """One photograph tells no field from a uniform one."""
    bench, errors, rng = all_off(12)
    verdict = fit_runs([lines_run(bench, (50.0,), rng, errors)]).verdict
    assert verdict is not None
    best, second = verdict.models[:2]
    assert second.aic - best.aic < 2.0
    assert "is preferred" not in model_sentence(verdict.models)
    assert " is as good as " in model_sentence(verdict.models)


def test_readings_in_gauss_are_doubted_where_no_magnet_tells() -> None:
    """Ten times the field and ten times the moduli fit as well as the right ones."""
    run, _ = wrong_run(WRONG["bow 1/5000 per mm"], seed=113)
    steps = tuple(replace(step, flux_mT=10.0 * step.flux_mT) for step in run.steps)
    bare = replace(run, magnet=None)
    right, wrong = (
        fit_runs([one], model="uniform").verdict
        for one in (bare, replace(bare, steps=steps))
    )
    assert right is not None
    assert wrong is not None
    assert not any("a unit is wrong" in reason for reason in right.reasons)
    assert wrong.verdict != "supported"
    assert "a unit is wrong" in wrong.reasons[0]
    assert "the readings of the field" in wrong.told_sentence()
