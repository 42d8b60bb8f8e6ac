"""The field as a witness: units, order, lost steps, corrections with their history."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from magbend.analysis.runs.witness import FieldWitness, witness_of
from magbend.cli.main import app
from magbend.core.errors import InputError
from magbend.core.magnet import Magnet
from magbend.rig.bench.config import read_plan
from magbend.rig.bench.template import write_templates
from magbend.rig.runs.read import read_run
from magbend.rig.runs.runner import run
from magbend.rig.runs.verify import verify_run
from magbend.rig.runs.witness import FieldDoubt

CUBE = FieldWitness(Magnet.cube(55.0, 1.305))
LOST = """
[[twin.fault]]
kind = "lost steps"
lost_mm = 1.5
at_gap_mm = 65.0
"""


@pytest.fixture(autouse=True)
def runtime_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MAGBEND_RUNTIME_DIR", str(tmp_path))
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("reading", "earlier", "said"),
    [
        ((70.0, 380.0), [], "is that gauss"),
        ((60.0, 500.0), [(70.0, 380.0)], "is that gauss"),
        ((70.0, 3.65), [], "is the unit right"),
        ((60.0, 38.0), [(70.0, 50.0)], "were two readings exchanged"),
        ((60.0, 75.0), [], "no magnet has more than 1.5 T"),
        ((60.0, 46.8), [], "a gap off by"),
    ],
)
def test_a_reading_that_cannot_be_is_doubted(reading, earlier, said):
    assert said in CUBE.judge(*reading, None, earlier).sentence


def test_good_readings_of_a_magnet_that_is_a_little_off_are_left_alone():
    # The remanence is 2 % off; the order and the run itself agree.
    readings = [(70.0, 37.25), (60.0, 50.93), (50.0, 71.36)]
    for count, (gap_mm, flux_mT) in enumerate(readings):
        assert CUBE.judge(gap_mm, flux_mT, 0.02, readings[:count]).sentence == ""


def test_a_millimetre_and_a_half_shows_beside_the_runs_own_readings():
    said = CUBE.judge(60.0, 47.5, 0.02, [(70.0, 36.52)])
    assert "off what the other readings of this run would give" in said.sentence
    assert said.gap_error_mm == pytest.approx(1.52, abs=0.1)


def test_without_a_magnet_the_order_alone_is_judged():
    nobody = FieldWitness(None)
    assert nobody.judge(60.0, 5000.0, None, []) == FieldDoubt()
    assert "exchanged" in nobody.judge(60.0, 38.0, None, [(70.0, 50.0)]).sentence


def _twin(tmp_path, policy: str, faults: str = ""):
    write_templates(tmp_path, twin=True)
    rig = tmp_path / "rig.toml"
    rig.write_text(rig.read_text() + faults)
    plan = tmp_path / "plan.toml"
    plan.write_text(
        plan.read_text().replace("samples = 5", f'samples = 5\npolicy = "{policy}"')
    )
    return read_plan(plan)


def _carry_out(plan, folder):
    from magbend.analysis.twin.run import open_twin_bench
    from magbend.rig.clock import SteppedClock

    _, devices = open_twin_bench(plan, seed=3, clock=SteppedClock())
    said: list[str] = []
    summary = run(
        plan, devices, folder, twin=True, witness=witness_of(plan), report=said.append
    )
    devices.close()
    return summary, said


@pytest.mark.parametrize("policy", ["flag", "abort"])
def test_lost_steps_of_the_twin_are_found_by_the_field(tmp_path, policy):
    plan = _twin(tmp_path, policy, LOST)
    summary, said = _carry_out(plan, tmp_path / "run")
    steps = read_run(tmp_path / "run").steps
    assert "field_disagrees" not in steps[0]["flags"]
    assert "field_disagrees" in steps[1]["flags"]
    assert steps[1]["field"]["gap_error_mm"] == pytest.approx(1.5, abs=0.3)
    assert any("a gap off by" in line for line in said)
    if policy == "abort":
        assert summary.status == "fail"
        assert "step 2 is recorded and flagged" in summary.reason
    else:
        assert summary.status == "success"
        assert "step 2: field_disagrees" in summary.flagged


def test_a_good_run_of_the_twin_is_not_flagged(tmp_path):
    plan = _twin(tmp_path, "abort")
    assert _carry_out(plan, tmp_path / "run")[0].status == "success"
    # and a reading is corrected with its history
    result = CliRunner().invoke(
        app, ["rig", "amend-flux", "run", "--step", "2", "--flux-mT", "500"]
    )
    assert result.exit_code == 0, result.output
    assert "is that gauss" in result.output
    CliRunner().invoke(
        app, ["rig", "amend-flux", "run", "--step", "2", "--flux-mT", "50.1",
              "--reason", "typed in gauss"],
    )  # fmt: skip
    step = read_run(tmp_path / "run").steps[1]
    assert (step["flux_mT"], step["flux_status"], step["flags"]) == (50.1, "manual", [])
    rows = (tmp_path / "run" / "amendments.jsonl").read_text().splitlines()
    history = [json.loads(row) for row in rows]
    assert [row["flux_mT"] for row in history] == [500.0, 50.1]
    assert history[1]["was_mT"] == 500.0
    assert history[1]["reason"] == "typed in gauss"
    assert verify_run(tmp_path / "run") == []


def test_typed_readings_in_gauss_are_refused_before_anything_moves(tmp_path):
    write_templates(tmp_path)
    rig = tmp_path / "rig.toml"
    rig.write_text(rig.read_text().replace('port = "auto"', 'port = "twin://x.json"'))
    words = ["rig", "run", "plan.toml", "--flux-mT", "380,500,660", "--out", "run"]
    result = CliRunner().invoke(app, words)
    assert isinstance(result.exception, InputError)
    assert "is that gauss? 10 G are 1 mT; nothing was moved" in str(result.exception)
    assert not (tmp_path / "run").exists()
