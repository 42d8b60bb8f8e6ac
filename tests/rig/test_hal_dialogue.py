"""Stops against the recorded words of a grblHAL, at their recorded times."""

from __future__ import annotations

import ast
import itertools
import re
from pathlib import Path

import pytest

from magbend.rig.errors import StoppedError
from magbend.rig.stage.config import StageConfig
from magbend.rig.stage.grbl.stage import GrblStage
from magbend.rig.virtual.protocol_twin import register_board

from .stage_bench import InterruptingClock

RECORDING = Path(__file__).parents[2] / "fixtures/rig/grblhal_stop_dialogue.txt"
_NAMES = itertools.count()
Row = tuple[float, str, bytes]


@pytest.fixture(autouse=True)
def runtime_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MAGBEND_RUNTIME_DIR", str(tmp_path))


def section(name: str) -> list[Row]:
    text = RECORDING.read_text(encoding="utf-8").split(f"==== {name} ")[1]
    found = re.findall(r"^\s*([\d.]+) (<<|>>) (b.*)$", text.split("====")[0], re.M)
    return [(float(at), way, ast.literal_eval(data)) for at, way, data in found]


class Replay:
    """A board that can only say what the recorded one said, when it said it."""

    def __init__(self, rows: list[Row]) -> None:
        self.rows, self.now_s, self._zero_s = rows, 0.0, -1e9
        self.plugged, self.port_taken, self.restart_on_open = True, False, False
        self.heard: list[bytes] = []
        self._out, self._line = b"", b""
        self._settings = [b"$20=0", b"$21=0", b"$22=0", b"$100=250.00000",
                          b"$110=500.000", b"$120=10.000", b"$130=200.000"]  # fmt: skip

    def advance(self, duration_s: float) -> None:
        self.now_s += duration_s

    def read(self) -> bytes:
        data, self._out = self._out, b""
        return data

    def receive(self, data: bytes) -> None:
        for byte in (bytes([number]) for number in data):
            if byte == b"?":
                self._out += self._report()
            elif byte in (b"\x85", b"!", b"\x18"):
                self.heard.append(byte)
                self._jump_to(byte)
            elif byte == b"\n":
                self._take(self._line)
                self._line = b""
            else:
                self._line += byte

    def _jump_to(self, sent: bytes) -> None:
        """Go to where this byte was sent; a reset is followed by the banner."""
        times = [t for t, way, data in self.rows if (way, data) == (">>", sent)]
        if times and self._zero_s > -1e9:
            self._zero_s = self.now_s - times[0]
        if sent == b"\x18":
            self._out += b"GrblHAL 1.1f ['$' or '$HELP' for help]\r\n"

    def _take(self, line: bytes) -> None:
        if line.startswith(b"$J="):
            self._zero_s = self.now_s
        if line == b"$$":
            self._out += b"\r\n".join(self._settings) + b"\r\n"
        self._out += b"ok\r\n"

    def _report(self) -> bytes:
        since_s = self.now_s - self._zero_s
        said = [(t, data) for t, way, data in self.rows if data.startswith(b"<")]
        if self._zero_s == -1e9:
            place = said[0][1].split(b"MPos:")[1].split(b"|")[0]
            return b"<Idle|MPos:" + place + b"|Bf:100,1023|FS:0,0>\r\n"
        return [data for t, data in said if t <= since_s + 0.05 or data is said[0][1]][
            -1
        ]


def stage_on(board: Replay) -> tuple[GrblStage, float]:
    clock = InterruptingClock()
    port = register_board(f"hal-{next(_NAMES)}", board, clock)
    stage = GrblStage(StageConfig(port=port, homing="manual"), clock)
    stage.connect()
    here = stage.status().machine_mm
    stage.assume_homed(here, (0.0, 1))
    at = next(t for t, way, data in board.rows if data == b"\x85")
    clock.at(clock.monotonic_s() + max(at, 0.05), stage.request_stop)
    return stage, here


def test_a_grblhal_that_stays_in_jog_is_reset_where_it_stands():
    board = Replay(section("stays-in-jog"))
    stage, here = stage_on(board)
    with pytest.raises(StoppedError, match="the board stays in jog, though nothing"):
        stage.move_to(here + 8.413, feed_mm_min=300.0)
    proof = stage.last_stop
    assert board.heard[-2:] == [b"\x85", b"\x18"]  # a feed hold would do nothing here
    assert (proof.means, proof.machine_mm) == ("reset", 7.092)
    assert proof.is_place_kept  # it stood for a second: no step was lost
    assert stage.position_state == "homed"
    assert proof.run_out_mm <= 1.2 * (1.25 + 0.1 * 5.0)  # as docs/rig.md states it


def test_a_jog_that_is_cancelled_on_its_way_up_stands():
    board = Replay(section("cancelled"))
    stage, here = stage_on(board)
    with pytest.raises(StoppedError, match="it stands by jog cancel"):
        stage.move_to(here + 8.671, feed_mm_min=300.0)
    assert board.heard[-1] == b"\x85"
    assert stage.last_stop.machine_mm == 15.820
    assert stage.position_state == "homed"
