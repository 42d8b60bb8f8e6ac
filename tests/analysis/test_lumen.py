"""A rod in a printed channel on the twin: photographed, measured, contacts flagged."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from magbend.analysis.lumen.contacts import fed
from magbend.analysis.lumen.place import place
from magbend.analysis.lumen.run import measure_in_lumen
from magbend.analysis.runs.load import load_runs
from magbend.analysis.twin.lumen_bench import LumenBench
from magbend.analysis.twin.run import calibrate_twin, run_on_twin
from magbend.cli import rig
from magbend.core.errors import (
    ConfigError,
    MagbendError,
    RigError,
    StoreError,
    VisionError,
)
from magbend.core.magnet import Magnet
from magbend.rig import check_run, read_plan, write_templates
from magbend.sim import gmc
from magbend.sim.navigate import channel, read_lumen
from magbend.vision import Setting, as_photo, measure

LUMENS = Path(__file__).parents[2] / "fixtures" / "lumens"
RUNS = Path(__file__).parents[2] / "fixtures" / "runs"
FEED = """
[[axis]]
name = "insertion_mm"
driver = "twin"
min = 0.0
max = 30.0
"""
PLAN = """
order = "free"

[[along]]
axis = "insertion_mm"
values = [16.0, 24.0]

[lumen]
file = "bend90.toml"
wall_height_mm = 1.4
"""


def planned(folder: Path, plan: str = PLAN) -> Path:
    write_templates(folder, twin=True)
    (folder / "bend90.toml").write_text((LUMENS / "bend90.toml").read_text())
    bench, path = folder / "rig.toml", folder / "plan.toml"
    bench.write_text(bench.read_text() + FEED)
    text = path.read_text().replace("[70.0, 60.0, 50.0]", "[90.0, 80.0]")
    path.write_text(text.replace("\n[settle]", f"{plan}\n[settle]", 1))
    return path


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Return the twin, the folder of its run, and what was measured in it."""
    folder = tmp_path_factory.mktemp("lumen")
    bench, _ = run_on_twin(read_plan(planned(folder)), folder / "run", seed=4)
    calibrate_twin(bench, folder / "run")
    return bench, folder / "run", measure_in_lumen(folder / "run", friction=0.1)


def test_walls_are_not_taken_for_the_rod_whose_place_is_known_to_hundredths(ran):
    bench, _, found = ran
    truth = bench.pose
    off = (found.placed.pose.x_mm - truth.x_mm, found.placed.pose.y_mm - truth.y_mm)
    assert np.hypot(*off) < 0.015
    for image, fed_mm in (("step_000.png", 16.0), ("step_001.png", 24.0)):
        assert found.run.frames[image].status == "ok"
        assert found.fed[image].fed_mm == pytest.approx(fed_mm, abs=0.04)
    last = bench.resting(80.0)
    seen = found.fed["step_001.png"]
    x, y = (np.interp(seen.s_mm, last.s_mm, row) for row in last.shape[:2])
    off = np.hypot(*(seen.points_mm.T - np.array([x, y])))[seen.s_mm > 0.0]
    assert off.max() < 0.04


def test_contacts_are_flagged_where_the_rod_is_pressed_and_nowhere_else(ran):
    bench, folder, found = ran
    pressed = [(c.wall, c.s_mm) for c in bench.resting(80.0).contacts]
    seen = found.fed["step_001.png"].touches
    assert [touch.wall for touch in seen] == [wall for wall, _ in pressed]
    for touch, (_, s_mm) in zip(seen, pressed, strict=True):
        assert touch.from_mm - 0.5 < s_mm < touch.to_mm + 0.5
    lines = pd.read_csv(folder / "centrelines.csv")
    touching = lines[(lines["image"] == "step_001.png") & (lines["contact"] == 1)]
    assert 1 < len(touching) < 30
    frames = pd.read_csv(folder / "frames.csv")
    assert frames["contacts"].tolist() == [2, 2]
    assert frames["contact_walls"].tolist() == ["left;right"] * 2
    table = pd.read_csv(folder / "lumen.csv")
    assert table["missed"].tolist() == table["extra"].tolist() == [0, 0]
    assert (table["rms_mm"] < 0.1).all()
    assert not check_run(folder).problems


def test_a_run_without_its_empty_channel_says_how_to_take_one(ran):
    _, folder, _ = ran
    with pytest.raises(ConfigError, match="take one before the rod is fed in"):
        measure_in_lumen(folder, bare=folder / "gone.png")


def test_it_is_not_compared_with_a_free_rod(ran):
    _, folder, _ = ran
    with pytest.raises(StoreError, match="its rod lies in a lumen"):
        load_runs([folder])


def test_a_rod_across_a_wide_channel_touches_nothing():
    wide = channel("wide", width_mm=14.0, legs=[(30.0, 0.0), (10.0, 40.0)])
    bench = LumenBench(
        gmc(2), Magnet.cube(55.0, 1.305), wide, seed=3, wall_height_mm=1.4
    )
    bench.axes = {"insertion_mm": SimpleNamespace(value=18.0)}
    picture, bare = bench.photograph(60.0, 0.0), bench.stills()["bare.png"]
    camera = bench._camera
    placed, setting = place(
        wide, as_photo(bare), camera, wall_height_mm=1.4, side_mm=1.0,
        setting=Setting(calibration=camera, rod_height_mm=bench.axis_height_mm),
    )  # fmt: skip
    found = measure(as_photo(picture), setting)
    sides = [
        np.column_stack(
            [np.full(121, k), np.arange(121)]
            + [found.points[f"{side}_{axis}_px"] for axis in "xy"]
        )
        for k, side in enumerate(("left", "right"))
    ]
    seen = fed(
        found.points, np.vstack(sides), wide, placed, camera,
        axis_height_mm=bench.axis_height_mm, wall_sd_mm=0.05,
    )  # fmt: skip
    assert seen.touches == ()
    assert seen.gap_mm.min() > 3.0
    bench.axes["insertion_mm"].value = 10.0
    with pytest.raises(RigError, match="never fall"):
        bench.photograph(60.0, 1.0)


def test_another_lumen_than_the_one_in_the_picture_is_not_found():
    bend = read_lumen(LUMENS / "bend90.toml")
    bench = LumenBench(
        gmc(2), Magnet.cube(55.0, 1.305), bend, seed=3, wall_height_mm=1.4
    )
    bare = as_photo(bench.stills()["bare.png"])
    with pytest.raises(VisionError, match="walls are not to be seen"):
        place(
            read_lumen(LUMENS / "fork.toml"), bare, bench._camera, wall_height_mm=1.4,
            setting=Setting(rod_height_mm=0.9), side_mm=1.0,
        )  # fmt: skip


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("[16.0, 24.0]", "[16.0]"), "one value a gap, 2; instead it gives 1"),
        (("[16.0, 24.0]", "[16.0, 31.0]"), "must be from 0 to 30; instead received 31"),
        (('"bend90.toml"', '"gone.toml"'), "gone.toml: there is no such file"),
        (("[[along]]", "[[scan]]"), ""),
        ((PLAN[PLAN.index("[[") : PLAN.index("[lumen]")], ""), "be fed by an axis"),
    ],
)  # fmt: skip
def test_a_plan_that_cannot_be_is_refused_in_a_sentence(tmp_path, change, said):
    path = planned(tmp_path, PLAN.replace(*change))
    if not said:
        assert len(read_plan(path).stops) == 4
        return
    with pytest.raises(ConfigError, match=said):
        read_plan(path)


def test_a_dry_run_does_not_foretell_a_free_rods_tip(tmp_path):
    said = CliRunner().invoke(
        rig.app, ["run", str(planned(tmp_path)), "--twin", "--dry-run", "--json"]
    )
    steps = json.loads(said.stdout)["steps"]
    assert [step["predicted_tip_x_mm"] for step in steps] == [None, None]
    assert {step["predicted_status"] for step in steps} == {"in a lumen"}


def test_a_run_without_a_lumen_is_named():
    folder = next(path.parent for path in RUNS.glob("*/run.json"))
    with pytest.raises(MagbendError, match=r"has no table \[lumen\]"):
        measure_in_lumen(folder)
