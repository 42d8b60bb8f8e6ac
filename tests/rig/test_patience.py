"""One missing answer ends nothing; a pause is a hold; half a twin is no twin."""

from __future__ import annotations

import termios
import threading

import pytest

from magbend.core.errors import ConfigError, MeterError
from magbend.rig.bench.config import read_plan
from magbend.rig.bench.template import write_templates
from magbend.rig.camera.chunked import Chunks
from magbend.rig.clock import SteppedClock
from magbend.rig.meter.protocol import Sample, combine
from magbend.rig.ports import SERIAL_ERRORS, why_not_open
from magbend.rig.runs.control import RunControl
from magbend.rig.runs.runner import run
from magbend.rig.virtual.bench import open_twin, twin_board

from .stage_bench import homed_bench
from .twin_run import render


@pytest.fixture(autouse=True)
def runtime_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MAGBEND_RUNTIME_DIR", str(tmp_path))


def _deaf_to(board, count: int) -> None:
    """Let the next status queries go unanswered."""
    receive, left = board.receive, [count]

    def hear(data: bytes) -> None:
        if data == b"?" and left[0]:
            left[0] -= 1
        else:
            receive(data)

    board.receive = hear


@pytest.mark.parametrize("missing", [1, 2])
def test_a_status_is_asked_for_again(missing):
    bench = homed_bench()
    _deaf_to(bench.board, missing)
    assert bench.stage.status().state == "idle"
    _deaf_to(bench.board, missing)
    assert bench.stage.assume_gap(90.0) == pytest.approx(110.0)


def test_a_pause_holds_the_stage_on_its_way_and_it_goes_on_after(tmp_path):
    write_templates(tmp_path, twin=True)
    plan = read_plan(tmp_path / "plan.toml")
    clock, board = SteppedClock(), twin_board()
    devices = open_twin(
        plan.rig, render, lambda gap_mm: 38.0 * (70.0 / gap_mm) ** 2,
        clock=clock, board=board,
    )  # fmt: skip
    control, places = RunControl(), []

    def report(line: str) -> None:
        if line.startswith("\apaused"):
            places.append((board.mover.running, board.plant.carriage_mm[0]))
            threading.Timer(0.02, control.resume).start()

    def look() -> None:
        if board.plant.carriage_mm[0] < -84.0 and not places and not control.is_paused:
            control.pause()

    board.plant.watch(look)
    summary = run(plan, devices, tmp_path / "run", control=control, report=report)
    devices.close()
    assert summary.status == "success"
    running, place_mm = places[0]
    assert not running
    assert -90.0 < place_mm < -84.0  # between the gaps of 70 and 60 mm


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('port = "twin://board.json"', 'port = "/dev/ttyUSB9"', "/dev/ttyUSB9"),
        ("source = 0", 'source = "photos"', "photos"),
        ('backend = "twin"', 'backend = "folder"', "camera.backend = 'folder'"),
        ('driver = "twin"', 'driver = "lakeshore_425"', "lakeshore_425"),
    ],
)
def test_half_a_twin_is_refused_by_name(tmp_path, old, new, named):
    from magbend.cli.rig_bench import needs_twin

    write_templates(tmp_path, twin=True)
    rig = tmp_path / "rig.toml"
    assert needs_twin(read_plan(tmp_path / "plan.toml"))
    assert old in rig.read_text()
    rig.write_text(rig.read_text().replace(old, new, 1))
    with pytest.raises(ConfigError, match="is the computed bench") as refused:
        needs_twin(read_plan(tmp_path / "plan.toml"))
    assert named in str(refused.value)


@pytest.mark.parametrize("cut", [1, 2, 7, 100])
def test_chunks_are_put_together_however_they_are_cut(cut):
    body = bytes(range(256)) * 3
    wire = b"".join(
        b"%x;x=1\r\n%s\r\n" % (len(piece), piece)
        for piece in (body[:5], body[5:300], body[300:])
    )
    wire += b"0\r\n\r\n"
    chunks, got = Chunks(), b""
    for at in range(0, len(wire), cut):
        got += chunks.feed(wire[at : at + cut])
    assert got == body
    assert chunks.is_over


def test_a_port_that_refuses_parity_is_a_sentence():
    error = termios.error(22, "Invalid argument")
    assert isinstance(error, SERIAL_ERRORS)
    assert "refuses the line's settings" in why_not_open("/dev/ttyS9", error)


def test_silence_a_torn_answer_garbage_and_another_unit_are_four_outcomes():
    for kind in ("silent", "torn", "garbled", "unit"):
        found = combine([Sample(outcome=kind, raw="x")] * 3)
        assert (found.status, found.raw) == (kind, ("x",) * 3)


def test_a_meter_on_such_a_port_is_a_sentence(monkeypatch):
    import serial

    from magbend.rig.meter.description import read_description
    from magbend.rig.meter.serial import SerialMeter

    class Port:
        def open(self) -> None:
            raise termios.error(22, "Invalid argument")

    monkeypatch.setattr(serial, "serial_for_url", lambda *_a, **_k: Port())
    monkeypatch.setattr("magbend.rig.meter.serial.check_port", lambda _port: None)
    with pytest.raises(MeterError, match="refuses the line's settings"):
        SerialMeter(read_description("lakeshore_425"), "/dev/ttyS9")
