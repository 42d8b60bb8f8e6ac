"""Plans for real days: references, repeats, ways back, any order, series, baselines."""

from __future__ import annotations

import itertools
import json
import re

import pytest
from typer.testing import CliRunner

from magbend.cli.main import app
from magbend.core.errors import ConfigError
from magbend.rig.bench.config import read_plan
from magbend.rig.bench.template import write_templates
from magbend.rig.clock import SteppedClock
from magbend.rig.runs.read import read_run
from magbend.rig.runs.runner import run
from magbend.rig.runs.verify import verify_run
from magbend.rig.virtual.bench import open_twin

from .twin_run import render

TOP = 'rig = "rig.toml"\n'


@pytest.fixture(autouse=True)
def runtime_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MAGBEND_RUNTIME_DIR", str(tmp_path))


def _plan(tmp_path, keys: str, **tables: str):
    if not (tmp_path / "rig.toml").exists():
        write_templates(tmp_path, twin=True)
    text = (tmp_path / "plan.toml").read_text().replace(TOP, TOP + keys)
    for table, rows in tables.items():
        text = re.sub(rf"(\[{table}\][^\n]*\n)", rf"\1{rows}\n", text)
    (tmp_path / "plan.toml").write_text(text)
    return read_plan(tmp_path / "plan.toml")


def _devices(plan):
    return open_twin(
        plan.rig, render, lambda gap_mm: 38.0 * (70.0 / gap_mm) ** 2,
        clock=SteppedClock(),
    )  # fmt: skip


def test_a_plan_unfolds_to_its_stops(tmp_path):
    plan = _plan(
        tmp_path, 'sweep = "return"\nrepeats = 2\nreference = true\n',
        flux="baseline = true",
    )  # fmt: skip
    assert [(stop.kind, stop.gap_mm, stop.turn) for stop in plan.stops] == [
        ("reference", 149.0, 0),
        ("approach", 70.0, 1), ("approach", 60.0, 1), ("approach", 50.0, 1),
        ("return", 60.0, 1), ("return", 70.0, 1),
        ("approach", 70.0, 2), ("approach", 60.0, 2), ("approach", 50.0, 2),
        ("return", 60.0, 2), ("return", 70.0, 2),
        ("baseline", 149.0, 0),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("reference = true\nreference_gap_mm = 30.0\n", "reference_gap_mm = 30 mm is"),
        ("reference = true\nreference_gap_mm = 400.0\n", "beyond the largest gap"),
        ("repeats = 0\n", "repeats"),
        ("repeats = 1000\nsweep = 'return'\n", None),
        ("sweep = 'zigzag'\n", "sweep"),
    ],
)
def test_what_would_leave_the_limits_is_refused_before_anything_moves(
    tmp_path, keys, said
):
    if said is None:
        assert len(_plan(tmp_path, keys).stops) == 5000
        return
    with pytest.raises(ConfigError, match=said):
        _plan(tmp_path, keys)


def test_gaps_in_an_order_of_ones_own_must_say_so(tmp_path):
    write_templates(tmp_path, twin=True)
    path = tmp_path / "plan.toml"
    path.write_text(
        path.read_text().replace("[70.0, 60.0, 50.0]", "[50.0, 70.0, 50.0]")
    )
    with pytest.raises(ConfigError, match='order = "free"'):
        read_plan(path)
    plan = _plan(tmp_path, 'order = "free"\n')
    assert plan.gaps_mm == (50.0, 70.0, 50.0)


def test_a_day_at_the_bench_is_run_resumed_and_verified(tmp_path):
    plan = _plan(
        tmp_path, 'sweep = "return"\nreference = true\n',
        flux="baseline = true", photograph="series = 3\ninterval_s = 0.4",
    )  # fmt: skip
    devices = _devices(plan)
    out = tmp_path / "run"

    def stop_at_three(done: int, _total: int) -> None:
        if done == 3:
            devices.stage.request_stop()

    assert run(plan, devices, out, progress=stop_at_three).status == "abort"
    devices.close()
    devices = _devices(plan)
    summary = run(plan, devices, out, resume=True)
    devices.close()
    assert (summary.status, summary.steps_done) == ("success", 7)
    steps = read_run(out).steps
    assert [step["kind"] for step in steps] == [
        "reference", "approach", "approach", "approach", "return", "return", "baseline",
    ]  # fmt: skip
    assert [step["gap_mm"] for step in steps] == [149, 70, 60, 50, 60, 70, 149]
    for step in steps:
        assert len(step["files"]) == 4
        assert step["files"][0]["path"] == f"images/step_{step['index']:03d}.png"
        times = [frame["arrival_s"] for frame in step["series"]]
        gaps = [later - before for before, later in itertools.pairwise(times)]
        assert all(gap >= 0.39 for gap in gaps)
    assert verify_run(out) == []
    (out / "images" / "step_002_s001.png").unlink()
    assert any("step_002_s001.png" in problem for problem in verify_run(out))


def test_settling_by_time_looks_at_no_picture(tmp_path):
    plan = _plan(tmp_path, "", settle='by = "time"')
    devices = _devices(plan)
    run(plan, devices, tmp_path / "run")
    devices.close()
    settle = read_run(tmp_path / "run").steps[0]["settle"]
    assert (settle["status"], settle["time_s"], settle["frames"]) == ("waited", 2.0, 0)


def test_the_dry_run_shows_every_stop(tmp_path):
    _plan(tmp_path, 'sweep = "return"\nreference = true\n')
    words = ["rig", "run", str(tmp_path / "plan.toml"), "--dry-run", "--json"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    rows = json.loads(result.output)["steps"]
    assert [row["kind"] for row in rows][::5] == ["reference", "return"]
    assert all(row["time_s"] > 0.0 for row in rows)
