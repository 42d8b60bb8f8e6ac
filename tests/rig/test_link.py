"""The serial link: whole lines, one owner, a lost device, every byte on record."""

from __future__ import annotations

import os
import threading
from dataclasses import dataclass

import pytest

from magbend.core.errors import StageError
from magbend.rig.clock import ScaledClock, SteppedClock, SystemClock
from magbend.rig.errors import LinkLostError, StageTimeoutError
from magbend.rig.link import Link
from magbend.rig.ports import resolve_port
from magbend.rig.stage.grbl.session import GrblSession
from magbend.rig.stage.presence import LeftPlace, Presence
from magbend.rig.virtual.board.firmware import GrblBoard
from magbend.rig.virtual.protocol_twin import register_board
from magbend.rig.virtual.pty_server import PtyBoard
from magbend.rig.wire_log import WireLog

from .stage_bench import make_bench

posix = pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are POSIX")


@pytest.fixture
def twin():
    clock, board = SteppedClock(), GrblBoard()
    link = Link(register_board("link", board, clock), baud=115200, clock=clock)
    link.open()
    while link.read_line(0.2):
        pass
    yield board, link, clock
    link.close()


def test_a_line_in_pieces_is_one_line(twin):
    board, link, _ = twin
    board.send(b"<Idle|MP")
    assert link.read_line(0.1) is None
    board.send(b"os:0,0,0>\r\nok\r")
    assert link.read_line(0.1) == "<Idle|MPos:0,0,0>"
    assert link.read_line(0.1) is None
    board.send(b"\n")
    assert link.read_line(0.1) == "ok"


def test_bytes_of_no_text_do_not_break_a_line(twin):
    board, link, _ = twin
    board.send(b"\xff\x00\xfe\r\nok\r\n")
    assert link.read_line(0.1)
    assert link.read_line(0.1) == "ok"


def test_an_endless_line_does_not_fill_the_memory(twin):
    board, link, _ = twin
    board.send(b"x" * 20_000)
    assert link.read_line(3.0) is None
    board.send(b"\r\nok\r\n")
    lines = [link.read_line(0.2), link.read_line(0.2)]
    assert "ok" in lines


class _Babbler:
    """A port on which something talks without end, as another device does."""

    in_waiting = 16

    def __init__(self, clock, text: bytes) -> None:
        self._clock, self._text = clock, text

    def read(self, size: int) -> bytes:
        self._clock.sleep(0.001)
        return self._text[:1] if size == 1 else self._text[1:]

    def write(self, data: bytes) -> None:
        pass


@pytest.mark.parametrize("text", [b"x" * 16, b"23.4\n" * 4])
def test_a_device_that_never_falls_quiet_is_given_its_time_and_no_more(twin, text):
    _, link, clock = twin
    port, link._serial = link._serial, _Babbler(clock, text)
    session = GrblSession(link, clock, answer_timeout_s=1.0)
    begin_s = clock.monotonic_s()
    assert session.ask(0.5) is None
    with pytest.raises(StageTimeoutError, match="did not answer"):
        session.command("$$")
    assert clock.monotonic_s() - begin_s < 12.0
    link._serial = port


def test_waiting_takes_the_time_of_the_clock(twin):
    _, link, clock = twin
    before_s = clock.monotonic_s()
    assert link.read_line(7.0) is None
    assert clock.monotonic_s() - before_s == pytest.approx(7.0, abs=0.05)


def test_a_device_that_vanishes_is_a_lost_link_on_read_and_write(twin):
    board, link, _ = twin
    board.plugged = False
    with pytest.raises(LinkLostError, match="link lost"):
        link.read_line(0.1)
    with pytest.raises(LinkLostError):
        link.write(b"$$\n")
    assert not link.is_open


def test_only_the_owner_speaks_lines_but_anybody_may_stop(twin):
    _, link, _ = twin
    errors = []

    def other():
        link.write_realtime(b"!")
        try:
            link.write(b"$$\n")
        except StageError as error:
            errors.append(str(error))

    thread = threading.Thread(target=other)
    thread.start()
    thread.join()
    assert "belongs to the thread" in errors[0]


def test_the_log_holds_every_byte_both_ways(twin, tmp_path):
    board, _, clock = twin
    board.port_taken = False
    log = WireLog(tmp_path / "wire.log", clock)
    link = Link("twin://link", baud=115200, clock=clock, log=log, device="stage")
    link.open()
    link.write(b"$I\n")
    assert link.read_line(1.0) == "[VER:1.1h.20190830:]"
    link.close()
    log.close()
    log.record("stage", ">>", b"late")  # a closed log stops nobody
    text = (tmp_path / "wire.log").read_text()
    assert "stage >> b'$I\\n'" in text
    assert "stage << b'[VER:1.1h.20190830:]\\r\\n'" in text
    assert text.count(" -- ") == 2


@posix
def test_the_same_code_talks_through_a_pseudo_terminal():
    clock = SystemClock()
    with PtyBoard(GrblBoard(), ScaledClock(10.0)) as served:
        link = Link(served.port, baud=115200, clock=clock)
        link.open()
        link.write(b"\x18")
        lines = [link.read_line(2.0)]
        link.write(b"$I\n")
        lines += [link.read_line(2.0), link.read_line(2.0), link.read_line(2.0)]
        second = Link(served.port, baud=115200, clock=clock)
        with pytest.raises(StageError, match="in use"):
            second.open()
        served.unplug()
        with pytest.raises(LinkLostError):
            [link.read_line(1.0) for _ in range(9)]
        with pytest.raises(LinkLostError):
            link.write(b"?")
    assert "[VER:1.1h.20190830:]" in lines


def test_a_remembered_place_is_told_once():
    presence = Presence("/dev/ttyTEST")
    left = LeftPlace(machine_mm=(-1.0, -2.0, -3.0), map={"direction": 1}, mark=17.0)
    presence.remember(left)
    assert presence.recall() == left
    assert presence.recall() is None


@pytest.mark.parametrize("text", ['{"machine_mm": ["a"], "map": {}}', "[]", "\0"])
def test_a_note_that_was_spoiled_is_no_note(text):
    presence = Presence("/dev/ttySPOILT")
    presence._position_file.write_text(text, encoding="utf-8")
    assert presence.recall() is None


def test_ports_are_named_as_they_are_or_by_what_is_plugged_in():
    assert resolve_port("/dev/ttyACM0") == "/dev/ttyACM0"
    assert resolve_port("twin://x") == "twin://x"
    with pytest.raises(StageError, match="no port with serial:NOSUCH"):
        resolve_port("serial:NOSUCH")


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (
            "[Errno 13] could not open port /dev/ttyUSB0: [Errno 13] Permission "
            "denied: '/dev/ttyUSB0'",
            "may not be opened by this user.*group dialout",
        ),
        (
            "could not open port 'COM3': PermissionError(13, 'Access is denied.', "
            "None, 5)",
            "in use by another program",
        ),
        ("[Errno 16] Resource busy: '/dev/cu.usbserial'", "in use by another program"),
        (
            "[Errno 11] Could not exclusively lock port /dev/ttyUSB0: [Errno 11] "
            "Resource temporarily unavailable",
            "in use by another program",
        ),
        (
            "could not open port 'COM9': FileNotFoundError(2, 'The system cannot find "
            "the file specified.', None, 2)",
            "cannot be opened.*magbend rig ports",
        ),
    ],
    ids=["Linux group", "Windows busy", "macOS busy", "Linux busy", "missing"],
)
def test_why_a_port_does_not_open_is_said_with_the_way_out(
    error, sentence, monkeypatch
):
    import serial

    def refuse(*_, **__):
        raise serial.SerialException(error)

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(StageError, match=sentence):
        Link("/dev/ttyUSB0", baud=250_000, clock=SteppedClock()).open()


def test_a_baud_that_the_system_cannot_set_is_said(monkeypatch):
    import serial

    def refuse(*_, **__):
        raise ValueError("Failed to set custom baud rate (123456): [Errno 22]")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(StageError, match="custom baud rate"):
        Link("/dev/ttyUSB0", baud=123_456, clock=SteppedClock()).open()


@dataclass
class _UsbPort:
    device: str
    serial_number: str = "A50285BI"
    description: str = "USB serial"
    vid: int = 0x0403
    pid: int = 0x6001


def test_a_board_is_found_again_under_another_name_by_its_serial_number(monkeypatch):
    from serial.tools import list_ports

    seen: list[_UsbPort] = []
    monkeypatch.setattr(list_ports, "comports", lambda: seen)
    bench = make_bench(port="serial:A50285BI")
    first = register_board("ttyACM0", bench.board, bench.clock)
    seen[:] = [_UsbPort(first), _UsbPort("/dev/ttyS7", serial_number="other")]
    bench.stage.connect()
    bench.stage.home()
    bench.board.plugged = False
    with pytest.raises(LinkLostError):
        bench.stage.goto_gap(60.0)
    seen[:] = []
    with pytest.raises(StageError, match="no port with serial:A50285BI"):
        bench.stage.recover()
    bench.board.plugged = True
    seen[:] = [_UsbPort(register_board("ttyACM1", bench.board, bench.clock))]
    bench.stage.recover()
    assert bench.stage.identity.port == "twin://ttyACM1"
    assert bench.stage.position_state == "unverified"


def test_auto_takes_the_only_usb_port_and_names_them_if_there_are_more(monkeypatch):
    from serial.tools import list_ports

    ports = [_UsbPort("/dev/ttyACM0"), _UsbPort("/dev/ttyS0", vid=0)]
    monkeypatch.setattr(list_ports, "comports", lambda: ports)
    assert resolve_port("auto") == "/dev/ttyACM0"
    ports.append(_UsbPort("/dev/ttyACM1"))
    with pytest.raises(StageError, match=r"ttyACM0, /dev/ttyACM1.*name one"):
        resolve_port("auto")
    ports.clear()
    with pytest.raises(StageError, match="no USB serial port"):
        resolve_port("auto")
