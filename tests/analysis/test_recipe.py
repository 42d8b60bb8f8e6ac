"""A law of mixing finds what rods were made by, and predicts rods nobody made."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from wrong_models import CAREFUL, CAREFUL_LINES, GAPS_MM, MAGNET

from magbend import sim
from magbend.analysis import (
    Law,
    Mixture,
    fit_law,
    fit_rods,
    mixtures,
    predict_mixture,
    read_law,
    read_ratio,
    write_law,
)
from magbend.analysis.design.goals import radius_goal
from magbend.analysis.design.makeable import Makeable
from magbend.analysis.design.mixtures import mixed_recipes
from magbend.analysis.design.search import find_designs
from magbend.analysis.runs.data import RunData
from magbend.analysis.twin.bench import TwinBench
from magbend.analysis.twin.deviations import deviating, drawn
from magbend.analysis.twin.lines import lines_run
from magbend.core.errors import InputError, StoreError
from magbend.core.specimen import Section, Specimen

PCL = "2:1 5:1 6:1"
ROD, SECTION = 0.05, 0.02


def true_values(mixture: Mixture) -> tuple[float, float]:
    """Modulus and remanence of a law of another form than the one fitted."""
    soft_MPa, rigid_MPa = 5.0, 20.0
    v = mixture.volume_share
    matrix = soft_MPa + mixture.rigid_share * (rigid_MPa - soft_MPa)
    return matrix * (1.0 + 2.5 * v + 14.1 * v * v), 90.0 * v


def rod_run(name: str, ndfeb: float, rng: np.random.Generator) -> RunData:
    """Return a run of a rod mixed by the law, with scatter, and stated as measured."""
    plain = Specimen(
        name=name, side_mm=1.0, remanence_mT=20.0, remanence_sd_mT=0.3,
        sections=tuple(Section(length_mm=10.0, E_MPa=12.0) for _ in range(3)),
        recipe=(("pcl", PCL), ("ndfeb", ndfeb)),
    )  # fmt: skip
    values = [true_values(mixture) for mixture in mixtures(plain)]
    whole = math.exp(ROD * rng.standard_normal())
    E_MPa = [e * whole * math.exp(SECTION * rng.standard_normal()) for e, _ in values]
    remanence = values[0][1] * math.exp(0.02 * rng.standard_normal())
    nominal = replace(plain, remanence_mT=remanence + 0.3 * rng.standard_normal())
    sections = tuple(
        replace(section, E_MPa=e)
        for section, e in zip(plain.sections, E_MPa, strict=True)
    )
    true = replace(nominal, remanence_mT=remanence, sections=sections)
    off = drawn(CAREFUL, 3, rng, E_percent=0.0) | {"remanence_percent": 0.0}
    truth = deviating(true, MAGNET, off)
    bench = TwinBench(nominal, MAGNET, seed=1, truth=truth)
    return lines_run(bench, GAPS_MM, rng, CAREFUL_LINES, name=name)


@pytest.fixture(scope="module")
def law() -> Law:
    rng = np.random.default_rng(31)
    runs = [rod_run(f"{p} {k}", p, rng) for p in (100.0, 150.0, 200.0) for k in "ab"]
    return fit_law(fit_rods(runs))


@pytest.mark.parametrize(("pcl", "ndfeb"), [("3:1", 175.0), ("5:1", 120.0)])
def test_a_mixture_nobody_made_is_predicted(law: Law, pcl: str, ndfeb: float) -> None:
    mixture = Mixture(soft_per_rigid=read_ratio(pcl), ndfeb_percent=ndfeb)
    found = predict_mixture(law, mixture)
    E_MPa, remanence_mT = true_values(mixture)
    assert found.inside
    assert found.E_interval_MPa[0] < E_MPa < found.E_interval_MPa[1]
    low, high = found.remanence_interval_mT
    assert low < remanence_mT < high
    # Useful, not only safe.
    assert found.E_interval_MPa[1] / found.E_interval_MPa[0] < 1.6


def test_scatter_is_found_and_rods_are_named(law: Law) -> None:
    assert 0.01 < law.rod_scatter < 0.12
    assert len(law.rods) == 6
    assert law.ndfeb_percent == (100.0, 200.0)


def test_outside_the_mixtures_that_were_fitted_is_said(law: Law) -> None:
    near, far = (
        predict_mixture(law, Mixture(soft_per_rigid=r, ndfeb_percent=150.0))
        for r in (4.0, 0.1)
    )
    assert near.inside
    assert not far.inside
    width = [math.log(p.E_interval_MPa[1] / p.E_interval_MPa[0]) for p in (near, far)]
    assert width[1] > 1.2 * width[0]


def test_rods_on_one_bench_err_together() -> None:
    """By what nobody knows of magnet and meter, and not by what is of each rod."""
    rng = np.random.default_rng(32)
    rods = fit_rods([rod_run("a", 200.0, rng), rod_run("b", 100.0, rng)])
    covariance = rods.covariance
    assert np.all(np.linalg.eigvalsh(covariance) > 0.0)
    between = covariance[0, 3] / math.sqrt(covariance[0, 0] * covariance[3, 3])
    assert 0.02 < between < 0.6
    within = covariance[0, 1] / math.sqrt(covariance[0, 0] * covariance[1, 1])
    assert within > between


def test_volume_share_and_density_are_those_of_the_weights() -> None:
    mixture = Mixture(soft_per_rigid=5.0, ndfeb_percent=200.0)
    volumes = 2.0 / 7500.0, 1.0 / 1145.0
    assert mixture.volume_share == pytest.approx(volumes[0] / sum(volumes))
    assert mixture.density_kg_m3 == pytest.approx(3.0 / sum(volumes))
    assert mixture.rigid_share == pytest.approx(1.0 / 6.0)


def test_a_law_is_kept(law: Law, tmp_path: Path) -> None:
    write_law(tmp_path / "recipe.json", law)
    assert read_law(tmp_path / "recipe.json") == law


def test_what_is_designed_can_be_mixed(law: Law) -> None:
    offered = mixed_recipes(law, 3)
    assert len(offered) > 50
    limits = Makeable(recipe=offered)
    found = find_designs(
        radius_goal(120.0), sim.UniformField(flux_mT=60.0), limits, count=2
    )
    for one in found:
        mixed = mixtures(one.specimen)
        E_MPa = [section.E_MPa for section in one.specimen.sections]
        assert E_MPa == pytest.approx(
            [predict_mixture(law, mixture).E_MPa for mixture in mixed], rel=1e-3
        )
        assert E_MPa == sorted(E_MPa, reverse=True)
        assert all(predict_mixture(law, mixture).inside for mixture in mixed)


@pytest.mark.parametrize("text", ["", "3", "a:b", "1:0", "-1:2", "nan:1", "1:2:3"])
def test_a_ratio_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="soft:rigid by weight"):
        read_ratio(text)


def test_what_cannot_be_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"must have a \[recipe\]"):
        mixtures(sim.gmc(2))
    rod = replace(sim.gmc(2), recipe=(("pcl", "2:1 5:1"), ("ndfeb", 200.0)))
    with pytest.raises(InputError, match="one ratio or 3"):
        mixtures(rod)
    with pytest.raises(InputError, match="number in percent"):
        mixtures(replace(rod, recipe=(("pcl", "2:1"), ("ndfeb", "much"))))
    with pytest.raises(InputError, match="ndfeb in percent must be above zero"):
        Mixture(soft_per_rigid=2.0, ndfeb_percent=-1.0)
    with pytest.raises(StoreError, match="there is no such law"):
        read_law(tmp_path / "none.json")
    (tmp_path / "bad.json").write_text('{"coefficients": [1]}')
    with pytest.raises(StoreError, match="is no law of mixing"):
        read_law(tmp_path / "bad.json")
