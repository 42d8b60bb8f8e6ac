"""Each fault of the bench in the middle of a run: a named ending, nothing lost.

The stage is the real driver on the twin board. In every cell the first step is
recorded, then the fault strikes; afterwards it is mended, fresh devices are opened, and
the run is resumed to its end.
"""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from magbend.core.errors import InputError, StageError
from magbend.rig.bench.config import Plan, read_plan
from magbend.rig.bench.devices import Devices
from magbend.rig.clock import SteppedClock
from magbend.rig.runs import folder as run_folder
from magbend.rig.runs.read import read_run
from magbend.rig.runs.runner import run
from magbend.rig.runs.verify import verify_run
from magbend.rig.virtual.bench import open_twin, twin_board
from magbend.rig.virtual.board.firmware import GrblBoard

from .twin_run import render


class FaultClock(SteppedClock):
    """The twin's time; does something at a given moment."""

    def __init__(self) -> None:
        super().__init__()
        self._due: list[tuple[float, Callable[[], object]]] = []

    def after(self, wait_s: float, action: Callable[[], object]) -> None:
        self._due.append((self.monotonic_s() + wait_s, action))

    def sleep(self, duration_s: float) -> None:
        super().sleep(duration_s)
        for item in [i for i in self._due if i[0] <= self.monotonic_s()]:
            self._due.remove(item)
            item[1]()


@dataclass
class Rig:
    """The twin of one cell; `strike` is called when the first step is recorded."""

    plan: Plan
    board: GrblBoard = field(default_factory=twin_board)
    clock: FaultClock = field(default_factory=FaultClock)
    camera: dict = field(default_factory=dict)
    meter: dict = field(default_factory=dict)
    devices: Devices | None = None

    def open(self) -> Devices:
        self.devices = open_twin(
            self.plan.rig,
            render,
            lambda gap_mm: 38.0 * (70.0 / gap_mm) ** 2,
            clock=self.clock,
            board=self.board,
            camera=self.camera,
            meter=self.meter,
        )
        return self.devices


def in_move(action: Callable[[Rig], object]) -> Callable[[Rig], None]:
    """While the second step's move is on."""
    return lambda rig: rig.clock.after(1.0, lambda: action(rig))


def standing(action: Callable[[Rig], object]) -> Callable[[Rig], None]:
    """While the second step settles."""

    def strike(rig: Rig) -> None:
        plain = rig.devices.camera.at_step

        def at_step(index: int, gap_mm: float) -> None:
            plain(index, gap_mm)
            if index == 1:
                rig.clock.after(0.3, lambda: action(rig))

        rig.devices.camera.at_step = at_step

    return strike


def interrupt(_rig: Rig) -> None:
    raise KeyboardInterrupt


def silent(rig: Rig) -> None:
    rig.board.lose_output(1e9)


def stuck(rig: Rig) -> None:
    rig.board.plant.stuck = True


def soft_limit(rig: Rig) -> None:
    rig.board.receive(b"G90G1X-5000F300\n")


def unplug(rig: Rig) -> None:
    rig.board.plugged = False


def swallow(rig: Rig) -> None:
    rig.board.lose_input(3.0)


def ignored_stop(rig: Rig) -> None:
    rig.board.heeds_stops = False
    rig.devices.stage.request_stop()


def lose_an_answer(rig: Rig) -> None:
    rig.board.lose_output(0.9)


CELLS: dict[str, tuple[Callable[[Rig], object], str, str]] = {
    "timeout: board silent": (in_move(silent), "fail", "silent"),
    "timeout: motor stalls": (
        in_move(lambda r: setattr(r.board.mover, "stalled", True)), "fail", "reach"),
    "alarm 1: switch in motion": (in_move(stuck), "fail", "ALARM:1"),
    "alarm 1: switch standing": (standing(stuck), "fail", "stand|ALARM"),
    "alarm 2: soft limit": (standing(soft_limit), "fail", "stand|ALARM"),
    "alarm 3: reset in motion": (
        in_move(lambda r: r.board.receive(b"\x18")), "fail", "ALARM:3"),
    "restart in motion": (
        in_move(lambda r: r.board.power_cycle()), "fail", "position|restart"),
    "restart standing": (
        standing(lambda r: r.board.power_cycle()), "fail", "stand|position|restart"),
    "unplugged in motion": (in_move(unplug), "fail", "port|link"),
    "unplugged standing": (standing(unplug), "fail", "port|link"),
    "torn line": (in_move(lambda r: r.board.send(b"<Run|MP")), "success", "every"),
    "garbage": (
        in_move(lambda r: r.board.send(b"\xff\x00~{\r\n")), "success", "every"),
    "line swallowed": (lambda rig: swallow(rig), "fail", "answer|arriv"),
    "Ctrl-C in motion": (in_move(interrupt), "abort", "operator"),
    "Ctrl-C standing": (standing(interrupt), "abort", "operator"),
    "stop from another terminal": (
        in_move(lambda r: r.devices.stage.request_stop()), "abort",
        "by jog cancel.*position was kept"),
    "stop that the board ignores": (
        in_move(ignored_stop), "abort", "by reset.*position is unverified"),
    "one answer missing": (in_move(lose_an_answer), "success", "every"),
    "one answer missing standing": (standing(lose_an_answer), "success", "every"),
}  # fmt: skip


def mend_and_resume(rig: Rig, out: Path) -> None:
    """Mend everything, open fresh devices on the same stage, resume to the end."""
    before = read_run(out).steps
    rig.board.plant.stuck = False
    rig.board.mover.stalled = False
    rig.board.heeds_stops = True
    rig.board.plugged = True
    rig.board.lose_output(0.0)
    rig.camera.clear()
    rig.meter.clear()
    rig.clock = FaultClock()
    rig.board.power_cycle()
    summary = run(rig.plan, rig.open(), out, resume=True, twin=True)
    rig.devices.close()
    assert (summary.status, summary.steps_done) == ("success", 3), summary.reason
    assert read_run(out).steps[: len(before)] == before
    assert verify_run(out) == []


@pytest.mark.parametrize("name", CELLS)
def test_a_stage_fault_ends_the_run_by_name_and_is_mended(
    name: str, plan_file: Path, tmp_path: Path
) -> None:
    strike, status, reason = CELLS[name]
    rig = Rig(read_plan(plan_file))
    out = tmp_path / "out"
    devices = rig.open()

    def report(line: str) -> None:
        if line.startswith("step 1 of"):
            strike(rig)

    summary = run(rig.plan, devices, out, twin=True, report=report)
    devices.close()
    print(f"{name:28} {summary.status:8} {summary.steps_done} steps; {summary.reason}")
    assert summary.status == status
    assert read_run(out).end["status"] == status
    assert re.search(reason, summary.reason), summary.reason
    assert verify_run(out) == []
    if status != "success":
        assert summary.steps_done == 1
        mend_and_resume(rig, out)


def lose_switches(rig: Rig) -> None:
    rig.board.plant._high_mm = 1e9


@pytest.mark.parametrize(
    ("strike", "reason"),
    [(stuck, "ALARM:8"), (lose_switches, "ALARM:9")],
    ids=["alarm 8", "alarm 9"],
)
def test_homing_that_fails_ends_the_run_before_any_step(
    strike: Callable[[Rig], None], reason: str, plan_file: Path, tmp_path: Path
) -> None:
    rig = Rig(read_plan(plan_file))
    devices = rig.open()
    strike(rig)
    out = tmp_path / "out"
    summary = run(rig.plan, devices, out, twin=True)
    devices.close()
    print(f"homing: {summary.status}, {summary.reason}")
    assert (summary.status, summary.steps_done) == ("fail", 0)
    assert reason in summary.reason
    rig.board = twin_board()  # switch repaired, carriage pushed back by hand
    mend_and_resume(rig, out)


def test_a_restart_without_homing_is_noticed(plan_file: Path, tmp_path: Path) -> None:
    """With $22=0 the board says Idle at 0 after a power cut, as if nothing happened."""
    rig_file = plan_file.with_name("rig.toml")
    rig_file.write_text(
        rig_file.read_text().replace("[limits]", 'homing = "manual"\n[limits]')
    )
    rig = Rig(read_plan(plan_file))
    for setting in (20, 21, 22):
        rig.board.eeprom.values[setting] = 0
    rig.board.power_cycle()
    devices = rig.open()
    devices.stage.assume_gap(149.0)
    strike = in_move(lambda r: r.board.power_cycle())
    out = tmp_path / "out"
    summary = run(
        rig.plan, devices, out, twin=True,
        report=lambda line: strike(rig) if line.startswith("step 1 of") else None,
    )  # fmt: skip
    devices.close()
    print(f"restart, homing off: {summary.status}, {summary.reason}")
    assert (summary.status, summary.steps_done) == ("fail", 1)
    assert verify_run(out) == []


@pytest.mark.parametrize(
    "action", [stuck, lambda rig: rig.board.power_cycle(), unplug],
    ids=["alarm", "restart", "unplugged"],
)  # fmt: skip
def test_a_fault_in_a_long_settling_time_is_noticed_within_a_second(
    action: Callable[[Rig], object], plan_file: Path, tmp_path: Path
) -> None:
    text = plan_file.read_text()
    plan_file.write_text(re.sub(r"\ntime_s = .*", "\ntime_s = 15.0", text))
    rig = Rig(read_plan(plan_file))
    devices = rig.open()
    struck_s = []

    def strike(rig: Rig) -> None:
        action(rig)
        struck_s.append(rig.clock.monotonic_s())

    standing(strike)(rig)
    ended_s = []
    devices.stage.hold = lambda: ended_s.append(rig.clock.monotonic_s())
    summary = run(rig.plan, devices, tmp_path / "out", twin=True)
    assert (summary.status, summary.steps_done) == ("fail", 1)
    assert ended_s[0] - struck_s[0] < 1.0


def test_device_faults_that_are_flags_and_failures(
    plan_file: Path, tmp_path: Path
) -> None:
    cells = {
        "camera stalls": ({"faults": {14: "stall"}}, {}, "fail", ""),
        "meter overloads": ({}, {"overload_mT": 50.0}, "success", "flux_overload"),
        "meter silent": ({}, {"silent_gaps_mm": [60.0]}, "success", "flux_silent"),
        "lamp fails": (
            {"faults": dict.fromkeys(range(16, 90), "dark")}, {}, "success",
            "brightness_drift",
        ),
    }  # fmt: skip
    for name, (camera, meter, status, flag) in cells.items():
        rig = Rig(read_plan(plan_file), camera=dict(camera), meter=dict(meter))
        out = tmp_path / name
        summary = run(rig.plan, rig.open(), out, twin=True)
        rig.devices.close()
        print(f"{name:28} {summary.status:8} {summary.flagged} {summary.reason}")
        assert summary.status == status
        assert flag in " ".join(summary.flagged)
        assert verify_run(out) == []
        if status == "fail":
            mend_and_resume(rig, out)


def test_a_disk_that_fills_up_holds_the_stage(
    plan_file: Path, tmp_path: Path, monkeypatch
) -> None:
    rig = Rig(read_plan(plan_file))
    devices = rig.open()
    out = tmp_path / "out"

    def full(*_args: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "disk")

    def report(line: str) -> None:
        if line.startswith("step 1 of"):
            patch.setattr(run_folder, "write_bytes", full)
            patch.setattr(run_folder, "write_text", full)

    with monkeypatch.context() as patch:
        summary = run(rig.plan, devices, out, twin=True, report=report)
    assert devices.stage.status().state == "idle"
    devices.close()
    print(f"disk full: {summary.status}, {summary.reason}")
    assert summary.status == "fail"
    assert "No space left" in summary.reason
    assert read_run(out).status == "cut off"
    mend_and_resume(rig, out)


def test_a_folder_that_cannot_be_written_moves_nothing(
    plan_file: Path, tmp_path: Path
) -> None:
    rig = Rig(read_plan(plan_file))
    devices = rig.open()
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError):
        run(rig.plan, devices, tmp_path / "file" / "out", twin=True)
    assert devices.stage.position_state == "unknown"
    devices.close()
    with pytest.raises(StageError):
        devices.stage.status()
