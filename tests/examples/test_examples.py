"""Every example runs, draws its figure and gives a number that physics confirms."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path
from types import ModuleType

import matplotlib as mpl
import numpy as np
import pytest

from magbend import sim
from magbend.analysis.compare.metrics import fit_circle
from magbend.analysis.twin.bench import hide
from magbend.core.magnet import Magnet

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("gallery")


@pytest.fixture(scope="module", autouse=True)
def _importable() -> None:
    mpl.use("Agg")
    if str(EXAMPLES) not in sys.path:
        sys.path.append(str(EXAMPLES))


def example(name: str) -> ModuleType:
    return importlib.import_module(name)


def test_every_example_is_listed_and_tested() -> None:
    names = {path.stem for path in EXAMPLES.glob("[!_]*.py")}
    listed = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    here = Path(__file__).read_text(encoding="utf-8")
    for name in names:
        assert f"({name}.py)" in listed
        assert f'"{name}"' in here


def test_no_example_needs_the_sources() -> None:
    for kind in ("*.py", "*.ipynb"):  # `magbend examples` copies them anywhere
        for path in EXAMPLES.glob(kind):
            assert "fixtures" not in path.read_text(encoding="utf-8"), path.name


def test_a_graded_rod_bends_nearer_to_a_circle(folder: Path) -> None:
    share = example("simulate_a_shape").main(folder)
    # A weakly bent uniform rod under a tip load: curvature falls linearly, 3/4.
    assert share["uniform"] == pytest.approx(0.75, abs=0.03)
    assert share["graded"] > share["uniform"] + 0.1
    assert (folder / "simulate_a_shape.svg").is_file()


def test_a_photograph_is_measured_as_it_was_rendered(folder: Path) -> None:
    module = example("measure_a_photograph")
    found = module.main(folder)
    truth = json.loads(module.ROD.with_suffix(".json").read_text(encoding="utf-8"))
    assert found.length_mm == pytest.approx(truth["length_mm"], abs=0.05)
    assert np.hypot(*np.subtract(found.tip_mm, truth["tip_mm"])) < 0.15
    assert (folder / "measure_a_photograph.png").is_file()


def test_the_magnet_predicts_the_twin_better_than_a_uniform_field(folder: Path) -> None:
    module = example("run_the_twin_bench")
    worst = module.main(folder)
    assert 0.0 < worst["magnet"] < worst["uniform"] < 3.0
    assert (folder / "run_the_twin_bench.svg").is_file()


def test_the_fit_finds_the_twins_hidden_moduli(folder: Path) -> None:
    fit = example("fit_the_stiffness").main(folder)
    seed = example("run_the_twin_bench").SEED
    (cube,) = fit.problem.shots[0].field.sources
    magnet = Magnet(sides_mm=cube.sides_mm, remanence_T=cube.remanence_T)
    truth = hide(sim.gmc(2), magnet, seed=seed)
    for i, section in enumerate(truth.specimen.sections):
        low, high = fit.interval_MPa(i)
        assert low < section.E_MPa < high
    assert (folder / "fit_the_stiffness.svg").is_file()


def test_designs_bend_to_the_wanted_radius(folder: Path) -> None:
    module = example("design_backwards")
    found = module.main(folder)
    assert len(found) == 5
    for one in found:
        line = sim.solve(one.specimen, module.FIELD, points=241).centreline
        assert line is not None
        radius_mm = fit_circle(line.points_mm).radius_mm
        assert radius_mm == pytest.approx(module.RADIUS_MM, rel=0.005)
    assert (folder / "design_backwards.svg").is_file()


def test_a_field_from_behind_makes_a_hook(folder: Path) -> None:
    hooks = example("hook_descriptor").main(folder)
    for flux_mT, hook_mm in hooks.items():
        field = sim.UniformField(flux_mT=flux_mT, angle_deg=150.0)
        line = sim.solve(sim.gmc(2), field).centreline
        # A rod hooks back exactly if its tip has turned beyond the upright.
        assert (hook_mm > 0.0) == (line.theta_rad[-1] > np.pi / 2.0)
    assert hooks[800.0] > 5.0


def test_more_current_bends_more_until_the_core_saturates(folder: Path) -> None:
    module = example("electromagnet_source")
    tips_mm = module.main(folder)
    low, high = tips_mm.values()
    assert 0.0 < low < high < 8.0 / 2.0 * low
    # On the axis the poles' fields add up to what the probe read.
    magnet = module.Electromagnet(0.06)
    at_tip = magnet.flux_mT(np.array([[30.0, 0.0, 0.0]]))[0]
    assert at_tip == pytest.approx([0.0, 0.06 * 12.0, 0.0], rel=1e-3)


def test_drivers_of_ones_own_are_tested_with_the_rig() -> None:
    rig = EXAMPLES.parent / "tests" / "rig"
    for module in ("zaber_stage", "hall_xyz_meter"):
        assert example(module).__doc__
        texts = [path.read_text(encoding="utf-8") for path in rig.glob("test_*.py")]
        assert any(module in text for text in texts)


def test_a_graded_rod_needs_less_push_round_a_bend() -> None:
    module = example("does_grading_help")
    graded = sim.gmc(2)
    plain = module.uniform_like(graded)
    assert module.tip_compliance(plain) == pytest.approx(module.tip_compliance(graded))
    task = ("90 degrees",)
    push_mN = [module.tried(rod, task)["90 degrees"].push_mN for rod in (graded, plain)]
    assert push_mN[0] < 0.7 * push_mN[1]
    # What it carries across a gap, its tip on a smooth wall, is Euler's column.
    EI_Nmm2 = plain.sections[0].E_MPa * plain.side_mm**4 / 12.0
    euler_N = 0.25 * np.pi**2 * EI_Nmm2 / plain.length_mm**2
    assert module.delivered_N(plain) == pytest.approx(euler_N, rel=0.05)
