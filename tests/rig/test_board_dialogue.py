"""The twin board against the recorded dialogue of a real GRBL 1.1h board.

The host's bytes of the recording go to the twin, section by section; every line that
came back must come back, in the same order. What may differ is said here and counted:

* while the stage moves, the numbers of MPos, FS and the planner count (the recorder's
  machine ran up to three times slow, so "when" is taken from the recorded position);
* where a move was cut off, the place it stopped at: learnt once, then to the micron.

Every line must come when it came there, counted from the host's bytes or the line
before it, within a factor of four: the recorder's machine was busy and that slow.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import pytest

from magbend.rig.stage.grbl.protocol import Report, parse_report
from magbend.rig.virtual.board.firmware import GrblBoard

RECORDING = Path(__file__).parents[2] / "fixtures/rig/grbl_1.1h_dialogue.txt"
FRESH = {"A", "V", "W", "Y"}
MOVING = {"run", "jog", "home"}
STOP_SYNC_MM = 0.035  # half of a segment of 10 ms at 5 mm/s
POSITION_MM = 0.12
FEED_MM_MIN = 30.0
STOP_MM = 4.5
SLOWNESS = 4.0
SLACK_S = 0.15
ROW = re.compile(r"^\s*(\d+\.\d+) (>>|<<|##|--|!!) (.*)$")


@dataclass(frozen=True)
class Row:
    time_s: float
    kind: str
    text: str

    @property
    def data(self) -> bytes:
        return ast.literal_eval(self.text)


@dataclass
class Section:
    name: str
    rows: list[Row] = field(default_factory=list)


def read_sections() -> list[Section]:
    sections: list[Section] = []
    for line in RECORDING.read_text(encoding="utf-8").splitlines():
        if line.startswith("===="):
            sections.append(Section(line.split()[1]))
        elif sections and (match := ROW.match(line)):
            sections[-1].rows.append(Row(float(match[1]), match[2], match[3]))
    return [s for s in sections if s.name != "X"]  # another firmware, no times kept


def moving(report: Report) -> bool:
    return report.state in MOVING or (report.state == "hold" and report.substate == 1)


@dataclass(frozen=True)
class Delay:
    """How long after the host's last bytes, and after the line before, a line came."""

    line: str
    sent_s: float
    line_s: float


def alike(a_s: float, b_s: float) -> bool:
    return a_s <= SLOWNESS * b_s + SLACK_S and b_s <= SLOWNESS * a_s + SLACK_S


def recorded_delays(rows: list[Row]) -> list[Delay]:
    delays = []
    sent_s = line_s = rows[0].time_s
    for row in rows:
        if row.kind == "<<":
            line = row.data.decode()
            delays.append(Delay(line, row.time_s - sent_s, row.time_s - line_s))
            line_s = row.time_s
        elif row.kind in (">>", "##"):
            sent_s = row.time_s
    return delays


@dataclass
class Score:
    exact: int = 0
    tolerant: int = 0
    late: list[str] = field(default_factory=list)


class Replay:
    """Play one recording into the twin, in the order of its sections."""

    def __init__(self) -> None:
        self.board = GrblBoard()
        self.shift = 0.0
        self.scores: dict[str, Score] = {}

    def play(self, section: Section) -> None:
        if section.name in FRESH:
            self.board = GrblBoard()
            self.board.advance(0.2)
            self.board.read()
            self.shift = 0.0
        self.heard: list[Delay] = []
        self.tail = ""
        self.sent_s = self.line_s = self.board.now_s
        rows = section.rows
        last_s = rows[0].time_s
        due = 0
        for index, row in enumerate(rows):
            if row.kind in (">>", "##"):
                self._pass_time(row.time_s - last_s, due, rows[index:])
                self._do(row)
                last_s = row.time_s
                if "process ended" in row.text:
                    break
            elif row.kind == "<<":
                due += 1
        self._pass_time(3.0, due, [])
        self.scores[section.name] = self._compare(section.name, recorded_delays(rows))

    def _do(self, row: Row) -> None:
        self.sent_s = self.board.now_s
        if row.kind == ">>":
            self.board.receive(row.data)
        elif "toggle" in row.text:
            self.board.plant.stuck = not self.board.plant.stuck
        elif "board reset" in row.text:
            self.board.power_cycle()
            self.shift = 0.0

    def _lines(self) -> int:
        now_s = self.board.now_s
        *lines, self.tail = (self.tail + self.board.read().decode()).split("\n")
        for line in lines:
            delay = Delay(line + "\n", now_s - self.sent_s, now_s - self.line_s)
            self.heard.append(delay)
            self.line_s = now_s
        return len(self.heard)

    def _pass_time(self, duration_s: float, due: int, ahead: list[Row]) -> None:
        """Wait as the recording did, or until the stage is where it was then."""
        end_s = self.board.now_s + duration_s
        while self.board.now_s < end_s + 5.0 and self._lines() < due:
            self.board.advance(0.001)
        goal = self._goal(ahead)
        if goal is None:
            while self.board.now_s < end_s:
                self.board.advance(min(end_s - self.board.now_s, 0.01))
                self._lines()
        else:
            limit_s = self.board.now_s + 5.0
            while self.board.now_s < limit_s and not self._reached(*goal):
                self.board.advance(0.001)
        self._lines()

    def _goal(self, ahead: list[Row]) -> tuple[str, float] | None:
        """Where the recorded stage was when the next bytes were sent, if it moved."""
        if not ahead or not self.board.mover.running or self.board.state == "Home":
            return None
        kind = "at"
        for row, after in pairwise([*ahead, ahead[-1]]):
            if row.kind == ">>" and row is not ahead[0] and ahead[0].text == repr(b"?"):
                return None
            if kind == "at" and (row.kind == "##" or row.text == repr(b"\x18")):
                kind = "cut"
            elif kind == "at" and row.kind == ">>":
                if row.data in (b"!", b"\x85") or b"X-500" in row.data:
                    kind = "stop"
                elif (
                    row is not ahead[0]
                    and b"X" in row.data
                    and after.text == repr(b"ok\r\n")
                ):
                    return None
            report = parse_report(row.data.decode()[:-2]) if row.kind == "<<" else None
            if report is None or report.machine is None:
                continue
            if kind == "at":
                return (kind, report.machine[0]) if moving(report) else None
            if not moving(report):
                return (kind, report.machine[0]) if report.machine[0] else None
        return None

    def _reached(self, kind: str, place: float) -> bool:
        mover = self.board.mover
        here = self.board.position[0] / 250.0 + self.shift
        left = self.board.planned[0] / 250.0 + self.shift - here
        if not mover.running or not left:
            return True
        sign = 1.0 if left > 0.0 else -1.0
        if kind == "stop":  # v^2 / (2 a), from the end of what is prepared
            here += sign * (mover.speed_mm_s**2 / 20.0 + mover.prepared_mm)
        return (place - here) * sign <= (STOP_SYNC_MM if kind == "stop" else 1e-6)

    def _compare(self, name: str, wanted: list[Delay]) -> Score:
        got = self.heard
        if name == "Y":  # the recorder left out the rows between
            kept = ("$0=", "$100")
            got = [g for g in got if g.line[0] != "$" or g.line.startswith(kept)]
        assert len(got) == len(wanted), (name, got, wanted)
        score = Score()
        for mine_at, real_at in zip(got, wanted, strict=True):
            mine, real = mine_at.line, real_at.line
            in_time = alike(mine_at.sent_s, real_at.sent_s)
            if not (in_time or alike(mine_at.line_s, real_at.line_s)):
                score.late.append(f"section {name}: {mine_at} for {real_at}")
            if mine == real:
                score.exact += 1
            else:
                assert self._alike(mine, real), f"section {name}: {mine!r} for {real!r}"
                score.tolerant += 1
        return score

    def _alike(self, mine: str, real: str) -> bool:
        a, b = parse_report(mine.strip()), parse_report(real.strip())
        if a is None or b is None or a.machine is None or b.machine is None:
            return False
        same = (a.state, a.substate, a.pins, a.offset) == (
            b.state, b.substate, b.pins, b.offset,
        )  # fmt: skip
        same = same and list(a.fields) == list(b.fields)
        if moving(b):
            apart = [abs(x - y) for x, y in zip(a.machine, b.machine, strict=True)]
            apart[0] = abs(a.machine[0] + self.shift - b.machine[0])
            return (
                same
                and max(apart) < POSITION_MM
                and (abs(a.feed - b.feed) < FEED_MM_MIN)
            )
        shift = b.machine[0] - a.machine[0]
        others = a.machine[1:] == b.machine[1:] or a.machine[:2] == b.machine[:2]
        if abs(shift - self.shift) > 1e-6:
            self.shift = shift
        return same and others and abs(shift) < STOP_MM and a.buffer == b.buffer


@pytest.fixture(scope="module")
def sections() -> list[Section]:
    return read_sections()


def test_every_section_is_reproduced(sections, capsys):
    replay = Replay()
    for section in sections:
        replay.play(section)
    with capsys.disabled():
        print("\nboard dialogue, lines exact + tolerant:", end=" ")
        print(
            ", ".join(f"{n} {s.exact}+{s.tolerant}" for n, s in replay.scores.items())
        )
    exact = sum(s.exact for s in replay.scores.values())
    tolerant = sum(s.tolerant for s in replay.scores.values())
    late = [line for score in replay.scores.values() for line in score.late]
    with capsys.disabled():
        print(f"in time (factor {SLOWNESS:g}): {exact + tolerant - len(late)}")
    assert late == []
    assert len(replay.scores) == 24
    assert exact + tolerant == 433
    assert tolerant <= 48
