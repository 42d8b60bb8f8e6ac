from __future__ import annotations

from pathlib import Path

import pytest

from magbend.core.errors import RigError, StoreError
from magbend.rig.bench.config import read_plan
from magbend.rig.errors import AlarmError, LinkLostError
from magbend.rig.runs.control import RunControl
from magbend.rig.runs.read import read_run
from magbend.rig.runs.runner import run
from magbend.rig.runs.verify import verify_run


def cut_off(bench, out: Path, move: str = "move -100") -> None:
    """Run until the link is lost before the third step."""

    def before(call: str) -> None:
        if call == move:
            raise LinkLostError("the port is gone")

    bench.raw.before = before
    assert run(bench.plan, bench.devices, out).status == "fail"


def test_resume_homes_checks_and_takes_only_what_is_missing(
    make_bench, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    cut_off(make_bench(), out)
    first = read_run(out).steps
    bench = make_bench(seed=2)
    summary = run(bench.plan, bench.devices, out, resume=True)
    assert (summary.status, summary.steps_done) == ("success", 3)
    assert read_run(out).steps[:2] == first
    assert bench.raw.calls[:3] == ["connect", "home", "move -90"]
    sessions = (out / "sessions.jsonl").read_text()
    assert "the port is gone" in sessions
    assert "position_check" in sessions
    assert verify_run(out) == []


def test_a_stage_that_moved_meanwhile_is_noticed(make_bench, tmp_path: Path) -> None:
    out = tmp_path / "out"
    cut_off(make_bench(), out)
    bench = make_bench()
    bench.meter._gap = lambda: bench.devices.stage.to_gap_mm(bench.raw.machine_mm) - 1.0
    summary = run(bench.plan, bench.devices, out, resume=True)
    assert summary.status == "fail"
    assert "was moved" in summary.reason
    assert summary.steps_done == 2
    assert verify_run(out) == []


@pytest.mark.parametrize(
    ("file", "old", "new", "named"),
    [
        ("plan.toml", "50.0]", "45.0]", "plan.gaps_mm"),
        ("plan.toml", "frames = 3", "frames = 4", "plan.settle.frames"),
        ("specimen.toml", "20.07", "25.07", "specimen.remanence_mT"),
        ("rig.toml", "150.0", "151.0", "rig.stage.gap_at_zero_mm"),
        ("rig.toml", "1.305", "1.3", "rig.magnet.remanence_T"),
    ],
)
def test_a_changed_plan_specimen_or_rig_is_refused(
    make_bench, plan_file: Path, tmp_path: Path, file, old, new, named
) -> None:
    out = tmp_path / "out"
    cut_off(make_bench(), out)
    before = (out / "steps.jsonl").read_bytes()
    changed = plan_file.with_name(file)
    changed.write_text(changed.read_text().replace(old, new))
    bench = make_bench()
    with pytest.raises(StoreError, match=named):
        run(read_plan(plan_file), bench.devices, out, resume=True)
    assert bench.raw.calls == ["connect"]
    assert (out / "steps.jsonl").read_bytes() == before
    assert read_run(out).status == "fail"


def test_resume_of_nothing_begins(bench, tmp_path: Path) -> None:
    summary = run(bench.plan, bench.devices, tmp_path / "out", resume=True)
    assert summary.status == "success"


def test_a_run_can_fail_and_resume_many_times(make_bench, tmp_path: Path) -> None:
    out = tmp_path / "out"
    for move in ("move -80", "move -90", "move -100"):
        bench = make_bench()
        failing = [move]

        def before(call: str, failing=failing) -> None:
            if call in failing:
                failing.clear()
                raise AlarmError(1, "hard limit", "home it", position_kept=False)

        bench.raw.before = before
        summary = run(bench.plan, bench.devices, out, resume=True)
    assert summary.status == "fail"
    bench = make_bench()
    assert run(bench.plan, bench.devices, out, resume=True).status == "success"
    assert [step["index"] for step in read_run(out).steps] == [0, 1, 2]
    assert verify_run(out) == []


def test_a_caller_and_the_key_hold_the_run() -> None:
    control = RunControl()
    lines: list[str] = []

    def report(line: str) -> None:
        lines.append(line)
        control.toggle_pause()

    assert not control.wait_while_paused(report)
    control.toggle_pause()
    assert control.wait_while_paused(lambda line: report(line) if not lines else None)
    assert lines[0].startswith("\apaused")
    control.pause()
    assert control.is_paused
    with pytest.raises(RigError, match="paused already"):
        control.pause()
    control.resume()
    assert not control.is_paused
    with pytest.raises(RigError, match="not paused"):
        control.resume()


def test_a_paused_step_says_so(bench, tmp_path: Path) -> None:
    control = RunControl()
    control.toggle_pause()

    def report(line: str) -> None:
        if "paused" in line:
            control.toggle_pause()

    run(bench.plan, bench.devices, tmp_path / "out", control=control, report=report)
    assert [s["paused"] for s in read_run(tmp_path / "out").steps] == [
        True, False, False,
    ]  # fmt: skip
