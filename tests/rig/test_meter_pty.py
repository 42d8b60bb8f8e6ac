"""Each ready Tesla-meter on a pseudo-terminal, with the line settings of its maker.

A pseudo-terminal carries eight bits whatever is asked for; that 7-O-1 is asked for is
checked on the open port, and what its parity bits look like to a port without it too.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator

import pytest

from magbend.core.errors import MeterError
from magbend.rig.meter.description import read_description
from magbend.rig.meter.serial import SerialMeter

pytestmark = pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs POSIX")

TESLA = {"T": 1.0, "G": 1e-4, "mT": 1e-3, "kG": 0.1, "mG": 1e-7, "uT": 1e-6}
QUERIED = ("lakeshore_425", "lakeshore_475", "lakeshore_421", "fwbell_5080")
EVERY = (*QUERIED, "lutron_frame")


class SpeakingMeter:
    """A meter in a field of `flux_mT`; `unit` may be changed at its keys meanwhile.

    `spoil` gets every answer with the number of readings so far, and may change it.
    """

    def __init__(self, driver: str, flux_mT: float, unit: str) -> None:
        self.driver, self.flux_mT, self.unit = driver, flux_mT, unit
        self.asked = 0
        self.spoil = lambda number, answer: answer
        self.change_after: tuple[int, str] | None = None

    def answer(self, line: str) -> bytes:
        if line in ("RDGFIELD?", "FIELD?", ":MEAS:FLUX?"):
            self.asked += 1
            said = self.spoil(self.asked, self._end(self._reading()))
            if self.change_after and self.asked == self.change_after[0]:
                self.unit = self.change_after[1]
            return said
        if line == "UNIT?":
            letter = self.unit[-1]
            codes = {"T": "2", "G": "1"}
            return self._end(letter if self.driver.endswith("421") else codes[letter])
        if line == "FIELDM?":
            return self._end(self.unit[:-1])
        return self._end(f"{self.driver.upper()},SN1")

    def _reading(self) -> str:
        value = self.flux_mT * 1e-3 / TESLA[self.unit]
        if self.driver == "fwbell_5080":
            return f"{value:.4f} {self.unit};"
        return f"{value:+.4f}" if self.driver.endswith("421") else f"{value:+.5E}"

    def frame(self) -> bytes:
        self.asked += 1
        code = {"mG": "B3", "uT": "B2"}[self.unit]
        value = round(self.flux_mT * 1e-3 / TESLA[self.unit])
        sign = "1" if value < 0 else "0"
        frame = f"\x0241{code}{sign}0{abs(value):08d}\r".encode()
        said = self.spoil(self.asked, frame)
        if self.change_after and self.asked == self.change_after[0]:
            self.unit = self.change_after[1]
        return said

    def _end(self, text: str) -> bytes:
        return text.encode() + (b"\r" if self.driver.endswith("421") else b"\r\n")


@contextlib.contextmanager
def on_pty(meter: SpeakingMeter) -> Iterator[str]:
    import tty

    master, slave = os.openpty()
    tty.setraw(slave)
    is_over = threading.Event()

    def answer() -> None:
        buffer = b""
        while not is_over.is_set():
            buffer += os.read(master, 256)
            while b"\n" in buffer:
                line, _, buffer = buffer.partition(b"\n")
                os.write(master, meter.answer(line.decode().strip()))

    def stream() -> None:
        while not is_over.wait(0.01):
            os.write(master, meter.frame())

    def work() -> None:
        with contextlib.suppress(OSError):
            stream() if meter.driver == "lutron_frame" else answer()

    threading.Thread(target=work, daemon=True).start()
    try:
        yield os.ttyname(slave)
    finally:
        is_over.set()
        os.close(slave)
        os.close(master)


def _open(driver: str, port: str, **line) -> SerialMeter:
    """Open with the packaged description; only the waits are cut short."""
    ready = read_description(driver)
    read = ready.read.model_copy(update={"timeout_s": 0.3, "pause_s": 0.01})
    changed = {"read": read, "line": ready.line.model_copy(update=line)}
    return SerialMeter(ready.model_copy(update=changed), port)


def _meter(driver: str, flux_mT: float = 38.05) -> SpeakingMeter:
    units = {"lakeshore_421": "mT", "fwbell_5080": "mT", "lutron_frame": "uT"}
    return SpeakingMeter(driver, flux_mT, units.get(driver, "T"))


@pytest.mark.parametrize("flux_mT", [38.05, -66.0])
@pytest.mark.parametrize("driver", EVERY)
def test_every_ready_meter_is_read(driver, flux_mT):
    with on_pty(_meter(driver, flux_mT)) as port:
        meter = _open(driver, port)
        line = meter._device
        flux = meter.read_flux(3, gap_mm=70.0)
        asked = (line.baudrate, line.bytesize, line.parity)
        meter.close()
    assert (flux.status, flux.samples) == ("ok", 3)
    assert flux.flux_mT == pytest.approx(flux_mT, rel=1e-5)
    assert asked == {
        "lakeshore_425": (57600, 7, "O"), "lakeshore_475": (9600, 7, "O"),
        "lakeshore_421": (9600, 7, "O"), "fwbell_5080": (2400, 8, "N"),
        "lutron_frame": (9600, 8, "N"),
    }[driver]  # fmt: skip


@pytest.mark.parametrize("driver", EVERY)
def test_a_torn_reply_is_never_a_smaller_number(driver):
    speaking = _meter(driver)
    with on_pty(speaking) as port:
        meter = _open(driver, port)
        first = speaking.asked + 1
        speaking.spoil = lambda n, said: said[: len(said) // 2] if n == first else said
        flux = meter.read_flux(3, gap_mm=70.0)
        meter.close()
    assert flux.status == "ok"
    assert flux.samples >= 2
    assert flux.flux_mT == pytest.approx(38.05, rel=1e-5)


@pytest.mark.parametrize("driver", QUERIED)
@pytest.mark.parametrize("token", ["OL", "+9.9E37", "----"])
def test_one_overload_among_readings_is_an_overload(driver, token):
    speaking = _meter(driver)
    end = b"\r" if driver.endswith("421") else b"\r\n"
    with on_pty(speaking) as port:
        meter = _open(driver, port)
        speaking.spoil = lambda n, said: token.encode() + end if n == 2 else said
        flux = meter.read_flux(3, gap_mm=70.0)
        meter.close()
    assert (flux.status, flux.flux_mT) == ("overload", None)


@pytest.mark.parametrize("driver", EVERY)
def test_a_meter_that_falls_silent_is_silent_and_comes_back(driver):
    speaking = _meter(driver)
    with on_pty(speaking) as port:
        meter = _open(driver, port)
        speaking.spoil = lambda n, said: b""
        silent = meter.read_flux(5, gap_mm=70.0)
        speaking.spoil = lambda n, said: said
        back = meter.read_flux(2, gap_mm=70.0)
        meter.close()
    assert (silent.status, silent.flux_mT) == ("silent", None)
    assert back.flux_mT == pytest.approx(38.05, rel=1e-5)


@pytest.mark.parametrize(
    ("driver", "unit"),
    [
        ("lakeshore_425", "G"),
        ("lakeshore_475", "G"),
        ("lakeshore_421", "kG"),
        ("fwbell_5080", "G"),
        ("lutron_frame", "mG"),
    ],
)
def test_a_unit_changed_at_the_keys_never_gives_a_wrong_number(driver, unit):
    speaking = _meter(driver)
    with on_pty(speaking) as port:
        meter = _open(driver, port)
        speaking.change_after = (speaking.asked + 2, unit)
        meant = meter.read_flux(4, gap_mm=70.0)
        after = meter.read_flux(2, gap_mm=70.0)
        meter.close()
    for flux in (meant, after):
        assert flux.flux_mT is None or flux.flux_mT == pytest.approx(38.05, rel=1e-3)
    assert after.status == "ok"


def _with_parity(data: bytes) -> bytes:
    """Add the odd parity bit that a port of eight bits would see."""
    return bytes(b if bin(b).count("1") % 2 else b | 0x80 for b in data)


def test_seven_bits_read_as_eight_are_refused_with_the_way_out():
    speaking = _meter("lakeshore_425")
    speaking.answer = lambda line: _with_parity(b"2\r\n")
    with (
        on_pty(speaking) as port,
        pytest.raises(MeterError, match=r"unit.*line settings of its description"),
    ):
        _open("lakeshore_425", port, bits=8, parity="N")


def test_a_unit_that_is_none_is_refused():
    speaking = _meter("lakeshore_475")
    speaking.answer = lambda line: b"7\r\n"
    with (
        on_pty(speaking) as port,
        pytest.raises(MeterError, match="must be known; instead the meter answered"),
    ):
        _open("lakeshore_475", port)
