from __future__ import annotations

import json
import re
from pathlib import Path

import cv2
import pandas as pd
import pytest

from magbend.core.errors import CameraError, StoreError
from magbend.rig.errors import InterlockError, LinkLostError
from magbend.rig.runs.control import RunControl
from magbend.rig.runs.read import read_run
from magbend.rig.runs.records import SCHEMA
from magbend.rig.runs.runner import run
from magbend.rig.runs.verify import verify_run


def test_a_run_records_every_step_and_verifies(bench, tmp_path: Path) -> None:
    out = tmp_path / "out"
    summary = run(bench.plan, bench.devices, out)
    assert (summary.status, summary.steps_done) == ("success", 3)
    assert verify_run(out) == []
    record = read_run(out)
    assert [step["gap_mm"] for step in record.steps] == [70.0, 60.0, 50.0]
    assert all(step["settle"]["status"] == "settled" for step in record.steps)
    assert record.steps[0]["flux_mT"] == pytest.approx(38.0, abs=0.2)
    assert record.manifest["specimen"]["name"] == "GMC 2"
    assert record.manifest["rig"]["magnet"]["side_mm"] == 55.0
    assert record.manifest["devices"]["stage"]["settings"] == {"$100": "250.000"}
    image = cv2.imread(str(out / "images/step_002.png"), cv2.IMREAD_UNCHANGED)
    assert image.shape == (96, 128)
    table = pd.read_csv(out / "steps.csv")
    assert list(table["gap_mm"]) == [70.0, 60.0, 50.0]
    assert table["flux_mT"].dtype == float
    assert table["image"][2] == "images/step_002.png"


def test_every_gap_is_reached_from_the_far_side(bench, tmp_path: Path) -> None:
    run(bench.plan, bench.devices, tmp_path / "out")
    moves = [float(c.split()[1]) for c in bench.raw.calls if c.startswith("move")]
    assert moves == sorted(moves, reverse=True)


def test_the_manifest_is_written_before_anything_moves(bench, tmp_path: Path) -> None:
    out = tmp_path / "out"
    seen: list[bool] = []

    def before(call: str) -> None:
        if call == "home":
            seen.append(json.loads((out / "run.json").read_text())["schema"] == SCHEMA)

    bench.raw.before = before
    run(bench.plan, bench.devices, out)
    assert seen == [True]


def test_an_existing_run_is_never_overwritten(bench, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(bench.plan, bench.devices, out)
    before = (out / "steps.jsonl").read_bytes()
    with pytest.raises(StoreError, match="holds a run already"):
        run(bench.plan, bench.devices, out)
    with pytest.raises(StoreError, match="is finished"):
        run(bench.plan, bench.devices, out, resume=True)
    assert (out / "steps.jsonl").read_bytes() == before


def test_a_gap_that_the_stage_refuses_moves_nothing(bench, tmp_path: Path) -> None:
    bench.plan.model.gaps_mm.append(30.0)
    with pytest.raises(InterlockError):
        run(bench.plan, bench.devices, tmp_path / "out")
    assert bench.raw.calls == ["connect"]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("phase", ["home", "move", "settle", "flux", "photograph"])
def test_ctrl_c_in_each_phase_holds_and_ends_as_abort(
    make_bench, tmp_path: Path, phase: str, monkeypatch
) -> None:
    bench = make_bench()
    out = tmp_path / "out"

    def interrupt(*_args, **_kwargs):
        raise KeyboardInterrupt

    if phase == "home":
        bench.raw.before = lambda c: interrupt() if c == "home" else None
    elif phase == "move":
        bench.raw.before = lambda c: interrupt() if c.startswith("move -90") else None
    elif phase == "settle":
        monkeypatch.setattr("magbend.rig.runs.session.settle", interrupt)
    elif phase == "flux":
        bench.meter.read_flux = interrupt
    else:
        monkeypatch.setattr("magbend.rig.runs.session.grab_median", interrupt)
    summary = run(bench.plan, bench.devices, out)
    assert summary.status == "abort"
    assert bench.raw.calls[-1] == "hold"
    assert read_run(out).status == "abort"
    assert verify_run(out) == []
    assert len(read_run(out).steps) == (1 if phase == "move" else 0)


@pytest.mark.parametrize("phase", ["settle", "still picture", "stall", "pause"])
def test_rig_stop_ends_a_run_whose_stage_stands_within_a_second(
    make_bench, plan_file: Path, tmp_path: Path, phase: str
) -> None:
    text = plan_file.read_text()
    if phase == "settle":
        text = re.sub(r"\ntime_s = .*", "\ntime_s = 15.0", text)
    plan_file.write_text(text)
    camera = {
        "stall": {"faults": {1: "stall"}, "timeout_s": 10.0},
        "still picture": {"swing_mm": 4.0, "damping_s": 1e9},
    }
    bench = make_bench(camera=camera.get(phase))
    control = RunControl()
    asked_s = []
    plain_step, plain_sleep = bench.camera.at_step, bench.clock.sleep

    def at_step(index: int, gap_mm: float) -> None:
        plain_step(index, gap_mm)
        asked_s.append(bench.clock.monotonic_s() + 1.5)
        if phase == "pause":
            bench.raw.request_stop()
            control.toggle_pause()

    def sleep(duration_s: float) -> None:
        plain_sleep(duration_s)
        if asked_s and bench.clock.monotonic_s() >= asked_s[0]:
            bench.raw.request_stop()

    bench.camera.at_step = at_step
    bench.clock.sleep = sleep
    summary = run(bench.plan, bench.devices, tmp_path / "out", control=control)
    assert summary.status == "abort"
    assert "magbend rig stop" in summary.reason
    assert bench.clock.monotonic_s() < asked_s[0] + 1.0
    assert len(asked_s) == 1
    assert bench.raw.calls[-1] == "hold"


def test_a_second_ctrl_c_stops_at_once(bench, tmp_path: Path) -> None:
    def before(call: str) -> None:
        if call.startswith("move -90") or call == "hold":
            raise KeyboardInterrupt

    bench.raw.before = before
    summary = run(bench.plan, bench.devices, tmp_path / "out")
    assert summary.status == "abort"
    assert bench.raw.calls[-2:] == ["hold", "stop"]


def test_retract_policy_moves_away_after_the_ending(
    bench, tmp_path: Path, plan_file: Path
) -> None:
    plan_file.write_text(plan_file.read_text() + '[abort]\npolicy = "retract"\n')
    from magbend.rig.bench.config import read_plan

    def before(call: str) -> None:
        if call == "move -90":
            bench.raw.before = lambda call: None
            raise KeyboardInterrupt

    bench.raw.before = before
    run(read_plan(plan_file), bench.devices, tmp_path / "out")
    assert bench.raw.calls[-1] == "move -1"


def test_link_lost_ends_as_fail_and_stays_stopped(bench, tmp_path: Path) -> None:
    def before(call: str) -> None:
        if call == "move -90" or call == "hold":
            raise LinkLostError("the port is gone")

    bench.raw.before = before
    out = tmp_path / "out"
    summary = run(bench.plan, bench.devices, out)
    assert (summary.status, summary.reason) == ("fail", "the port is gone")
    assert summary.steps_done == 1
    assert not any(c.startswith("move -100") for c in bench.raw.calls)
    assert verify_run(out) == []


def test_camera_stall_ends_as_fail(make_bench, tmp_path: Path) -> None:
    bench = make_bench(camera={"faults": {9: "stall"}})
    out = tmp_path / "out"
    summary = run(bench.plan, bench.devices, out)
    assert summary.status == "fail"
    assert "twin camera" in summary.reason
    assert verify_run(out) == []


def test_overload_and_silence_are_flags_not_numbers(make_bench, tmp_path: Path) -> None:
    bench = make_bench(meter={"overload_mT": 60.0, "silent_gaps_mm": [60.0]})
    out = tmp_path / "out"
    summary = run(bench.plan, bench.devices, out)
    steps = read_run(out).steps
    assert summary.status == "success"
    assert [s["flux_status"] for s in steps] == ["ok", "silent", "overload"]
    assert [s["flux_mT"] is None for s in steps] == [False, True, True]
    assert summary.flagged == ("step 2: flux_silent", "step 3: flux_overload")


def test_a_rod_that_never_rests_is_flagged(make_bench, tmp_path: Path) -> None:
    bench = make_bench(camera={"swing_mm": 4.0, "damping_s": 1e9})
    summary = run(bench.plan, bench.devices, tmp_path / "out")
    assert summary.status == "success"
    assert "step 1: settle_timeout" in summary.flagged


def test_a_lamp_that_fails_is_flagged(make_bench, tmp_path: Path) -> None:
    frames = dict.fromkeys(range(12, 60), "dark")
    bench = make_bench(camera={"faults": frames})
    summary = run(bench.plan, bench.devices, tmp_path / "out")
    assert "step 3: brightness_drift" in summary.flagged


def test_a_photograph_during_motion_is_not_recorded(bench, tmp_path: Path) -> None:
    flux = bench.meter.read_flux

    def push(samples: int, *, gap_mm: float, **options):
        if gap_mm == 60.0:
            bench.raw.machine_mm += 0.5
        return flux(samples, gap_mm=gap_mm, **options)

    bench.meter.read_flux = push
    summary = run(bench.plan, bench.devices, tmp_path / "out")
    assert summary.status == "fail"
    assert "must stand at" in summary.reason
    assert summary.steps_done == 1


def test_a_defect_of_ours_still_ends_the_run(bench, tmp_path: Path) -> None:
    def broken(*_args, **_kwargs):
        raise ZeroDivisionError("oops")

    bench.meter.read_flux = broken
    with pytest.raises(ZeroDivisionError):
        run(bench.plan, bench.devices, tmp_path / "out")
    assert read_run(tmp_path / "out").end["reason"].startswith("internal error")


def test_camera_error_is_a_camera_error(make_bench) -> None:
    bench = make_bench(camera={"faults": {1: "stall"}})
    with pytest.raises(CameraError):
        bench.camera.grab_after(0.0)


def test_no_password_of_a_camera_stands_in_the_record(bench, tmp_path: Path) -> None:
    from dataclasses import replace

    camera = bench.plan.rig.camera.model_copy(
        update={"source": "http://me:hunter2@cam/live?token=sesame"}
    )
    rig = bench.plan.rig.model_copy(update={"camera": camera})
    run(replace(bench.plan, rig=rig), bench.devices, tmp_path / "out")
    for path in (tmp_path / "out").rglob("*"):
        if path.is_file():
            data = path.read_bytes()
            assert b"hunter2" not in data
            assert b"sesame" not in data
