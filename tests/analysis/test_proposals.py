"""What is promised of an experiment is what it gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from wrong_models import GAPS_MM, WRONG, all_off

from magbend.analysis import FitResult, fit_runs, limits_of_knowledge, proposals
from magbend.analysis.fit.nuisance import Nuisance
from magbend.analysis.twin.lines import lines_run

CLOSE = Nuisance(remanence_percent=0.1, side_percent=0.1)
"""Priors under which photographs matter."""


def worst_percent(fit: FitResult) -> float:
    return 100.0 * float(np.max(np.array(fit.E_sd_MPa) / fit.E_MPa))


def test_a_photograph_gives_what_was_promised() -> None:
    bench, errors, _ = all_off(21)
    errors = errors._replace(shape_um=2.0, frame_angle_deg=0.1)
    run = lines_run(bench, GAPS_MM, np.random.default_rng(1), errors)
    fit = fit_runs([run], nuisance=CLOSE, judged=False)
    promised = {one.change: one for one in proposals(fit, [run])}
    again = promised["all photographs once more"]
    assert again.minutes == 6.0
    assert again.predicted_sd_percent < worst_percent(fit)
    taken = lines_run(bench, GAPS_MM * 2, np.random.default_rng(1), errors)
    done = fit_runs([taken], nuisance=CLOSE, judged=False)
    # The run states more readings too, and shows its errors anew.
    assert again.predicted_sd_percent == pytest.approx(worst_percent(done), rel=0.15)


def test_a_measured_size_gives_what_was_promised() -> None:
    bench, errors, rng = all_off(22)
    run = lines_run(bench, GAPS_MM, rng, errors)
    fit = fit_runs([run], judged=False)
    (best, *_) = proposals(fit, [run])
    assert best.change == "measure the rod's remanence to 2 %"
    closer = fit_runs([run], nuisance=Nuisance(remanence_percent=2.0), judged=False)
    assert best.predicted_sd_percent == pytest.approx(worst_percent(closer), rel=0.01)
    short = proposals(fit, [run], minutes=5.0)
    assert short
    assert all(one.minutes <= 5.0 for one in short)
    stuck = limits_of_knowledge(fit)
    assert "remanence_percent" in stuck[1]
    assert float(stuck[0].split()[0]) > 6.0


def test_a_heavy_rod_is_told_to_lie_on_its_side() -> None:
    """In-plane weight parts modulus and remanence."""
    assert WRONG["density -10 %"].up is not None
    bench, errors, rng = all_off(23)
    bench.specimen = replace(bench.specimen, density_kg_m3=2640.0)
    run = replace(lines_run(bench, GAPS_MM, rng, errors), record={})
    fit = fit_runs([run], judged=False)
    turned = next(one for one in proposals(fit, [run]) if "on its side" in one.change)
    assert turned.predicted_sd_percent < 0.9 * worst_percent(fit)
