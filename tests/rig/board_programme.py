"""A bounded programme of short motions for any GRBL board: the twin's, or your own.

It never leaves the stretch between where the stage stands and `stretch_mm` from there,
moves slowly, and checks what the driver promises: who answers, arrival to a step, a
hold that keeps the position, one line in flight, a position that outlives the program.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from magbend.rig.clock import Clock
from magbend.rig.errors import InterlockError, StoppedError
from magbend.rig.stage.config import StageConfig
from magbend.rig.stage.grbl.stage import GrblStage
from magbend.rig.wire_log import WireLog

_SLOWEST_MM_MIN = 100.0
_ROW = re.compile(r"^(\S+) \S+ stage (>>|<<|--) (.*) #\w+$")


@dataclass
class Programme:
    """The steps, in order; each says in `said` what it found."""

    port: str
    clock: Clock
    log_path: Path
    stretch_mm: float
    may_home: bool = False
    axis: str = "X"
    said: list[str] = field(default_factory=list)

    def carry_out(self) -> None:
        """Do every step; an assertion, or an error of the driver, ends it."""
        self._log = WireLog(self.log_path, self.clock)
        with contextlib.closing(self._log):
            self._carry_out()
        self._one_line_in_flight()

    def _carry_out(self) -> None:
        stage = self._connected("manual")
        is_homed_by_switches = stage.identity.settings["22"] not in ("0", "0.000")
        if is_homed_by_switches and self.may_home:
            stage.close()
            stage = self._connected("switches")
            self._homed(stage)
        else:
            self._trusted_here(stage)
        try:
            self._answers(stage)
            self._goes_there_and_back(stage)
            self._holds_on_the_way(stage)
            self._refuses_beyond_the_travel(stage)
            self._recovers(stage)
        finally:
            stage.close()
        self._comes_back(is_homed_by_switches and self.may_home)

    def _connected(self, homing: str) -> GrblStage:
        options: dict[str, Any] = {"port": self.port, "homing": homing}
        config = StageConfig(
            gap_at_zero_mm=0.0, feed_mm_min=_SLOWEST_MM_MIN / 2.0, axis=self.axis,
            piece_mm=abs(self.stretch_mm) / 2.0, **options,
        )  # fmt: skip
        stage = GrblStage(config, self.clock, log=self._log)
        stage.connect()
        self._say(f"connected: {stage.identity.firmware}, {stage.limits}")
        return stage

    def _homed(self, stage: GrblStage) -> None:
        stage.home()
        assert stage.position_state == "homed"
        self._say(f"homed at {self._here(stage):.3f} mm")

    def _trusted_here(self, stage: GrblStage) -> None:
        status = stage.status()
        assert status.state == "idle", (
            f"the board is in {status.state}: home it, or let the programme do it"
        )
        stage.assume_homed(self._here(stage), (0.0, 1))

    def _here(self, stage: GrblStage) -> float:
        machine_mm = stage.status().machine_mm
        assert machine_mm is not None
        return machine_mm

    def _answers(self, stage: GrblStage) -> None:
        begin_s = self.clock.monotonic_s()
        states = {stage.status().state for _ in range(20)}
        took_s = (self.clock.monotonic_s() - begin_s) / 20.0
        assert states == {"idle"}
        assert took_s < 0.5
        self._say(f"answers a question in {1000.0 * took_s:.0f} ms")

    def _feed(self, stage: GrblStage) -> float:
        return min(_SLOWEST_MM_MIN, stage.limits.max_feed_mm_min / 2.0)

    def _goes_there_and_back(self, stage: GrblStage) -> None:
        start_mm = self._here(stage)
        for target_mm in (start_mm + self.stretch_mm, start_mm):
            feed, seen = self._feed(stage), list[float]()
            begin_s, from_mm = self.clock.monotonic_s(), self._here(stage)
            stage.move_to(target_mm, feed_mm_min=feed, moved=seen.append)
            took_s = self.clock.monotonic_s() - begin_s
            off_mm = self._here(stage) - target_mm
            assert abs(off_mm) <= stage.limits.tolerance_mm
            assert took_s >= 0.9 * abs(target_mm - from_mm) / feed * 60.0
            steps = [b - a for a, b in pairwise(seen)]
            sign = 1.0 if target_mm > from_mm else -1.0
            assert all(sign * step >= -stage.limits.step_mm for step in steps)
            self._say(
                f"moved to {target_mm:.3f} mm in {took_s:.1f} s, {off_mm:+.4f} off"
            )

    def _holds_on_the_way(self, stage: GrblStage) -> None:
        start_mm = self._here(stage)

        def stop_half_way(here_mm: float) -> None:
            if abs(here_mm - start_mm) > 0.3 * abs(self.stretch_mm):
                stage.request_stop()

        feed = self._feed(stage)
        assert _raises(
            StoppedError,
            lambda: stage.move_to(
                start_mm + self.stretch_mm, feed_mm_min=feed, moved=stop_half_way
            ),
        )
        held_mm = self._here(stage)
        assert stage.position_state == "homed"
        assert stage.status().state == "idle"
        assert 0.0 < abs(held_mm - start_mm) < abs(self.stretch_mm)
        stage.move_to(start_mm, feed_mm_min=feed)
        self._say(f"held at {held_mm:.3f} mm with its position, and came back")

    def _refuses_beyond_the_travel(self, stage: GrblStage) -> None:
        travel = stage.limits.travel_mm
        if travel is None:
            return
        before = self.log_path.read_text()
        beyond_mm = travel[1] + 5.0
        assert _raises(
            InterlockError, lambda: stage.move_to(beyond_mm, feed_mm_min=50.0)
        )
        assert self.log_path.read_text() == before, "a byte was sent"
        self._say(f"refused {beyond_mm:g} mm before a byte was sent")

    def _recovers(self, stage: GrblStage) -> None:
        before_mm = self._here(stage)
        stage.recover()
        assert abs(self._here(stage) - before_mm) <= stage.limits.step_mm
        assert stage.position_state == "homed"
        self._say("kept its position in a soft reset at standstill")

    def _comes_back(self, with_switches: bool) -> None:
        stage = self._connected("switches" if with_switches else "manual")
        state = stage.position_state
        stage.close()
        assert state in ("homed", "unknown")
        self._say(f"opened again: position {state} (unknown: opening restarts it)")

    def _one_line_in_flight(self) -> None:
        """No line went out before the one before it was answered."""
        waiting, lines = "", 0
        for row in self.log_path.read_text().splitlines():
            match = _ROW.match(row)
            if not match or match[2] == "--":
                continue
            data = match[3][2:-1]
            if match[2] == ">>" and (r"\x18" in data or not data.endswith(r"\n")):
                waiting = "" if r"\x18" in data else waiting
            elif match[2] == ">>":
                assert not waiting, f"{data} was sent before {waiting} was answered"
                waiting, lines = data, lines + 1
            elif data.startswith(("ok", "error:", "ALARM:")):
                waiting = ""
        assert lines > 10
        self._say(f"{lines} lines, never two in flight")

    def _say(self, text: str) -> None:
        self.said.append(text)


def _raises(kind: type[Exception], action: Callable[[], object]) -> bool:
    try:
        action()
    except kind:
        return True
    return False
