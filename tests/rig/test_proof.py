"""A run proves itself: one changed bit, a missing line, a file too many are named."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from magbend.core.derived import note_derived
from magbend.core.errors import StoreError
from magbend.core.files import write_bytes, write_text
from magbend.core.owned import MARK, owning_folder
from magbend.rig import check_run, run, verify_run
from magbend.rig.bench.devices import Devices
from magbend.rig.runs.folder import RunFolder
from magbend.rig.runs.read import read_run
from magbend.rig.wire_log import WireLog, check_wire_log


def logged(bench) -> Devices:
    """The devices of a bench with a log of what they said."""
    log = WireLog(None, bench.clock)
    for word in (b"$$\r\n", b"ok\r\n", b"<Idle>\r\n"):
        log.record("stage", "<<", word)
    old = bench.devices
    return Devices(
        stage=old.stage, camera=old.camera, meter=old.meter, clock=old.clock, log=log
    )


def derive(out: Path) -> None:
    """Leave the derived files of a measured and fitted run."""
    with owning_folder(out, "run", "vision extract"):
        write_text(out / "calibration.json", '{"schema": 1}\n')
        write_text(out / "centrelines.csv", "image,s_mm\nstep_000.png,0\n")
        (out / "overlays").mkdir()
        write_bytes(out / "overlays" / "step_000.png", b"drawn")
        note_derived([out / "calibration.json"], sources=[], command="vision calibrate")
        note_derived(
            [out / "centrelines.csv", out / "overlays" / "step_000.png"],
            sources=[out / "images" / "step_000.png", out / "calibration.json"],
            command="vision extract",
        )


@pytest.fixture
def finished(bench, tmp_path: Path) -> Path:
    out = tmp_path / "run"
    devices = logged(bench)
    assert run(bench.plan, devices, out).status == "success"
    devices.log.record("stage", "--", "closed")
    devices.log.close()
    derive(out)
    return out


@pytest.fixture
def cut_off(bench, tmp_path: Path, monkeypatch) -> Path:
    """A run whose process died after two steps, in a session that was a resumption."""
    out = tmp_path / "run"
    devices = logged(bench)
    bench.raw.before = lambda call: 1 / 0 if call == "move -90" else None
    with pytest.raises(ZeroDivisionError):
        run(bench.plan, devices, out)
    bench.raw.before = lambda call: None
    plain = RunFolder.commit_step

    def die(self, record, images):
        if record["index"] == 2:
            raise KeyboardInterrupt
        return plain(self, record, images)

    monkeypatch.setattr(RunFolder, "commit_step", die)
    monkeypatch.setattr(RunFolder, "finish", lambda *_: {"status": "", "reason": ""})
    run(bench.plan, devices, out, resume=True)
    monkeypatch.undo()
    devices.log.close()
    derive(out)
    return out


def files_of(out: Path) -> list[Path]:
    return sorted(path for path in out.rglob("*") if path.is_file())


def named(out: Path) -> set[str]:
    """Every file, and every sentence, of which a check says that it is not good."""
    check = check_run(out)
    bad = {one.name for one in check.files if one.status != "good"}
    return bad | set(check.problems)


@pytest.mark.parametrize("state", ["finished", "cut_off"])
def test_one_bit_flipped_in_any_file_is_named(state, request):
    out = request.getfixturevalue(state)
    assert verify_run(out) == []
    generator = random.Random(11)
    kinds = {path.relative_to(out).as_posix() for path in files_of(out)}
    expected = {"run.json", "plan.toml", "steps.jsonl", "wire.log", "manifest.json"}
    expected |= {"images/step_001.png", f"{MARK}/folder.json", "sessions.jsonl"}
    expected |= {"end.json", "steps.csv"} if state == "finished" else set()
    assert expected - {"sessions.jsonl"} <= kinds
    for path in files_of(out):
        data = path.read_bytes()
        few = generator.sample(range(len(data)), min(len(data), 30))
        places = [*few, len(data) - 1] if data else []
        for at in places:
            flipped = bytearray(data)
            flipped[at] ^= 1 << generator.randrange(8)
            path.write_bytes(flipped)
            name = path.relative_to(out).as_posix()
            assert any(name in one for one in named(out)), (name, at)
        path.write_bytes(data)
    assert verify_run(out) == []


Harm = Callable[[Path], object]


def without_line(path: Path, number: int) -> None:
    lines = path.read_bytes().splitlines(keepends=True)
    del lines[number]
    path.write_bytes(b"".join(lines))


def swapped(path: Path) -> None:
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([lines[1], lines[0], *lines[2:]]))


HARMS: dict[str, tuple[Harm, str]] = {
    "a derived file altered": (
        lambda p: (p / "centrelines.csv").write_text("other"),
        "centrelines.csv: altered",
    ),
    "an overlay gone": (
        lambda p: (p / "overlays" / "step_000.png").unlink(),
        "overlays/step_000.png: missing",
    ),
    "a calibration replaced": (
        lambda p: (
            (p / "calibration.json").write_text("{}"),
            note_derived([p / "calibration.json"], sources=[], command="x"),
        ),
        "centrelines.csv: older input",
    ),
    "a file of somebody": (
        lambda p: (p / "notes.txt").write_text("x"),
        "notes.txt: extra",
    ),
    "a picture too many": (
        lambda p: (p / "images" / "step_007.png").write_bytes(b"x"),
        "images/step_007.png: extra",
    ),
    "the first step taken out": (
        lambda p: without_line(p / "steps.jsonl", 0),
        "steps.jsonl: altered (a line before line 1 is missing)",
    ),
    "the last step taken out": (
        lambda p: without_line(p / "steps.jsonl", -1),
        "images/step_00",
    ),
    "two steps swapped": (lambda p: swapped(p / "steps.jsonl"), "steps.jsonl: altered"),
    "a row of the log taken out": (
        lambda p: without_line(p / "wire.log", 1),
        "wire.log: altered (row 2",
    ),
    "the end of the log cut": (
        lambda p: [without_line(p / "wire.log", -1) for _ in range(2)],
        "wire.log: altered (it had",
    ),
    "a flux changed": (
        lambda p: (p / "steps.jsonl").write_text(
            (p / "steps.jsonl").read_text().replace('"flux_mT": 3', '"flux_mT": 4', 1)
        ),
        "steps.jsonl: altered (line 1",
    ),
    "the log gone": (lambda p: (p / "wire.log").unlink(), "wire.log: missing"),
    "the plan replaced": (
        lambda p: (p / "plan.toml").write_text("other"),
        "plan.toml: altered",
    ),
}


@pytest.mark.parametrize("harm", HARMS)
@pytest.mark.parametrize("state", ["finished", "cut_off"])
def test_each_kind_of_harm_is_named(state, harm, request):
    out = request.getfixturevalue(state)
    act, sentence = HARMS[harm]
    act(out)
    problems = verify_run(out)
    assert any(sentence in problem for problem in problems), problems


def test_an_ending_that_counts_other_steps_is_named(finished):
    from magbend.core.seal import sealed

    end = json.loads((finished / "end.json").read_text())
    del end["seal"]
    (finished / "end.json").write_text(sealed({**end, "steps": 99}, indent=1))
    assert verify_run(finished) == ["end.json counts 99 steps, steps.jsonl holds 3"]


@pytest.mark.parametrize("harm", ["deleted", "a line cut"])
def test_success_is_not_claimed_over_records_that_are_gone(harm, bench, tmp_path):
    out = tmp_path / "run"

    def before(call: str) -> None:
        path = out / "steps.jsonl"
        if call != "move -100" or not path.exists():
            return
        path.unlink() if harm == "deleted" else without_line(path, -1)

    bench.raw.before = before
    summary = run(bench.plan, bench.devices, out)
    assert summary.status == "fail"
    assert "steps.jsonl: was changed or removed by somebody else" in summary.reason
    bench.raw.before = lambda call: None
    summary = run(bench.plan, bench.devices, out, resume=True)
    assert summary.status == "success"
    assert [step["gap_mm"] for step in read_run(out).steps][-1] == 50.0
    assert sorted(step["index"] for step in read_run(out).steps) == [0, 1, 2]
    assert verify_run(out) == []


def test_a_picture_gone_at_the_end_is_no_success(bench, tmp_path):
    out = tmp_path / "run"
    bench.raw.before = lambda call: (
        (out / "images" / "step_000.png").unlink() if call == "move -100" else None
    )
    summary = run(bench.plan, bench.devices, out)
    assert summary.status == "fail"
    assert "step_000.png was written and is missing" in summary.reason


def test_a_second_run_is_told_who_holds_the_folder(make_bench, tmp_path):
    out = tmp_path / "run"
    first, second = make_bench(), make_bench()
    told = []

    def before(call: str) -> None:
        if call == "move -90":
            import threading

            def other() -> None:
                for resume in (False, True):
                    try:
                        run(second.plan, second.devices, out, resume=resume)
                    except StoreError as error:
                        told.append(str(error))

            thread = threading.Thread(target=other)
            thread.start()
            thread.join()

    first.raw.before = before
    assert run(first.plan, first.devices, out).status == "success"
    assert len(told) == 2
    assert all("is being written by magbend rig run, process" in one for one in told)
    assert second.raw.calls == ["connect"]
    assert verify_run(out) == []


def test_a_torn_log_is_cut_and_goes_on(tmp_path, bench):
    path = tmp_path / "wire.log"
    log = WireLog(path, bench.clock)
    log.record("stage", ">>", b"a\n")
    log.close()
    whole = path.read_bytes()
    path.write_bytes(whole + b"0.0 torn")
    log = WireLog(path, bench.clock)
    log.record("meter", "--", "two\nlines")
    log.close()
    check = check_wire_log(path)
    assert (check.head.rows, check.bad_row) == (2, 0)
    assert path.read_bytes().startswith(whole)


def test_a_refused_run_leaves_no_folder(bench, tmp_path):
    out = tmp_path / "run"
    bench.devices.stage.check_gap = lambda gap: 1 / 0
    with pytest.raises(ZeroDivisionError):
        run(bench.plan, bench.devices, out)
    assert not out.exists()
    shutil.rmtree(out, ignore_errors=True)
