"""The twin bench hides something, keeps it, and obeys the physics it hides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from magbend.analysis.twin.bench import HiddenTruth, TwinBench, hide
from magbend.core.magnet import Magnet
from magbend.sim import gmc

PAPER_MAGNET = Magnet.cube(55.0, 1.305)


def test_the_truth_is_hidden_seeded_and_near() -> None:
    nominal = gmc(2)
    truth = hide(nominal, PAPER_MAGNET, seed=5)
    assert truth == hide(nominal, PAPER_MAGNET, seed=5)
    assert truth != hide(nominal, PAPER_MAGNET, seed=6)
    ratios = [
        true.E_MPa / section.E_MPa
        for true, section in zip(truth.specimen.sections, nominal.sections, strict=True)
    ]
    assert all(0.6 < ratio < 1.6 for ratio in ratios)
    assert len(set(ratios)) == len(ratios)
    assert truth.specimen.length_mm == nominal.length_mm


def test_the_probe_reads_the_field_of_the_magnet_at_the_undeformed_tip() -> None:
    nominal = gmc(2)
    known = HiddenTruth(specimen=nominal, magnet=PAPER_MAGNET, clamp_angle_deg=0.0)
    bench = TwinBench(nominal, PAPER_MAGNET, seed=0, truth=known)
    # 50.0003843 mT at 60 mm from the face: the 40-digit closed form of the reference.
    assert bench.flux_mT(60.0) == pytest.approx(50.0003843251659, rel=1e-9)
    assert bench.flux_mT(50.0) > bench.flux_mT(60.0) > bench.flux_mT(70.0) > 0.0


@pytest.mark.parametrize("axis_angle_deg", [90.0, -90.0, 60.0])
def test_the_probe_follows_the_nominal_axis(axis_angle_deg: float) -> None:
    magnet = replace(PAPER_MAGNET, axis_angle_deg=axis_angle_deg)
    known = HiddenTruth(specimen=gmc(2), magnet=magnet, clamp_angle_deg=0.0)
    bench = TwinBench(gmc(2), magnet, seed=0, truth=known)
    assert bench.flux_mT(60.0) == pytest.approx(50.0003843251659, rel=1e-9)


def test_two_photographs_of_a_still_rod_differ_by_noise_only() -> None:
    bench = TwinBench(gmc(2), PAPER_MAGNET, seed=3)
    first = bench.photograph(60.0, 0.0).astype(float)
    second = bench.photograph(60.0, 1.0).astype(float)
    assert first.shape == (1200, 1600, 3)
    assert 0.1 < np.std(first - second) < 6.0
    moved = bench.photograph(50.0, 2.0).astype(float)
    assert np.abs(moved - second).max() > 60.0
