from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from magbend.core.errors import ConfigError, MeterError
from magbend.rig.bench.open import open_meter
from magbend.rig.meter.config import MeterConfig
from magbend.rig.meter.description import (
    MeterDescription,
    read_description,
    ready_meters,
)
from magbend.rig.meter.parse import parse_reply
from magbend.rig.meter.protocol import Sample, combine
from magbend.rig.meter.serial import SerialMeter

FRAME = b"\x0241B30100003805\r"


@pytest.mark.parametrize(
    ("driver", "reply", "unit", "multiplier", "flux_mT"),
    [
        ("lakeshore_425", "+0.0380E+00", "T", 1.0, 38.0),
        ("lakeshore_425", "-380.00E+00", "G", 1.0, -38.0),
        ("lakeshore_475", "+38.000E-03", "T", 1.0, 38.0),
        ("lakeshore_421", "+38.05", "T", 1e-3, 38.05),
        ("lakeshore_421", "- 0.3805", "G", 1e3, -38.05),
        ("fwbell_5080", "38.05 mT;", None, 1.0, 38.05),
        ("fwbell_5080", "-0.0380 T;", None, 1.0, -38.0),
        ("fwbell_5080", "380.5 G", None, 1.0, 38.05),
        ("lutron_frame", "41B30200003805", None, 1.0, 38.05e-4),
        ("lutron_frame", "41B21100001234", None, 1.0, -0.1234),
    ],
)
def test_replies_become_mT(driver, reply, unit, multiplier, flux_mT) -> None:
    sample = parse_reply(
        read_description(driver), reply, unit=unit, multiplier=multiplier
    )
    assert sample.outcome == "ok"
    assert sample.flux_mT == pytest.approx(flux_mT, rel=1e-12)


@pytest.mark.parametrize(
    ("driver", "reply", "outcome"),
    [
        ("lakeshore_425", "OL", "overload"),
        ("lakeshore_425", "+9.9E37", "overload"),
        ("lakeshore_425", "9.91E+37", "overload"),
        ("fwbell_5080", "OVER RANGE", "overload"),
        ("lakeshore_425", "", "garbled"),
        ("lakeshore_425", "+0.0380E+00 T", "garbled"),
        ("lakeshore_425", "0.0380E+", "garbled"),
        ("fwbell_5080", "38.05", "garbled"),
        ("fwbell_5080", "38.05 furlong", "garbled"),
        ("lutron_frame", "41ZZ0200003805", "unit"),
        ("lutron_frame", "42B30200003805", "garbled"),
    ],
)
def test_what_is_no_reading_is_typed(driver, reply, outcome) -> None:
    sample = parse_reply(read_description(driver), reply, unit="T")
    assert (sample.outcome, sample.flux_mT) == (outcome, None)


def test_decimal_comma_and_status_words() -> None:
    description = MeterDescription.model_validate(
        {
            "name": "own",
            "read": {
                "mode": "stream",
                "pattern": r"(?P<status>\w) (?P<value>[-\d.,]+)",
                "decimal_comma": True,
                "overload_status": ["E"],
            },
            "unit": {"source": "fixed", "name": "mT"},
        }
    )
    assert parse_reply(description, "N -1.038,25").flux_mT == pytest.approx(-1038.25)
    assert parse_reply(description, "E 38,25").outcome == "overload"
    # A point that no comma proves to stand between thousands may be a decimal one.
    for reply in ("N 38.05", "N 38.050", "N 1.03,25", "N 1,038.25"):
        assert parse_reply(description, reply).outcome == "garbled"


def test_a_row_with_one_overload_is_overloaded() -> None:
    good = Sample(outcome="ok", flux_mT=38.0, raw="a")
    assert combine([good, good, Sample(outcome="overload")]).status == "overload"
    half = combine([good, Sample(outcome="silent")])
    assert (half.status, half.samples, half.flux_mT) == ("ok", 1, 38.0)
    assert combine([good, *[Sample(outcome="silent")] * 2]).status == "silent"


def test_zero_offset_and_sign_are_applied_once() -> None:
    samples = [Sample(outcome="ok", flux_mT=v) for v in (-38.1, -38.3)]
    flux = combine(samples, zero_mT=0.2, sign=-1)
    assert flux.flux_mT == pytest.approx(38.0)
    assert flux.sd_mT == pytest.approx(0.1414, abs=1e-4)


def test_line_parameters_of_the_ready_meters() -> None:
    lines = {name: read_description(name).line for name in ready_meters()}
    for name in ("lakeshore_421", "lakeshore_425", "lakeshore_475"):
        line = lines[name]
        assert (line.bits, line.parity, line.stop_bits) == (7, "O", 1)
    assert read_description("lakeshore_421").read.reply_end == "\r"
    assert read_description("lutron_frame").read.frame_end == "\r"
    assert lines["lakeshore_425"].baud == 57600
    assert lines["lakeshore_421"].baud == 9600
    assert lines["fwbell_5080"].baud == 2400
    assert lines["lutron_frame"].baud == 9600


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ('[unit]\nsource = "fixed"', "needs the key 'name'"),
        ('[unit]\nsource = "fixed"\nname = "furlong"', "unit of flux density"),
        ('[unit]\nsource = "reply"', "no group"),
        ("", "'unit' is missing"),
    ],
)
def test_a_description_without_a_unit_is_refused(tmp_path, change, sentence) -> None:
    path = tmp_path / "own.toml"
    path.write_text(
        'name = "own"\n[read]\nmode = "stream"\npattern = "(?P<value>.*)"\n' + change
    )
    with pytest.raises(ConfigError, match=sentence):
        read_description("own", path)


def test_unknown_drivers_and_missing_ports_are_named() -> None:
    with pytest.raises(ConfigError, match="lakeshore_425"):
        open_meter(MeterConfig(driver="lakeshore_999", port="x"), Path())
    with pytest.raises(MeterError, match="rig ports"):
        open_meter(MeterConfig(driver="lakeshore_425"), Path())
    with pytest.raises(MeterError, match="cannot be opened"):
        open_meter(MeterConfig(driver="lakeshore_425", port="/dev/no-such"), Path())


def test_manual_readings_belong_to_gaps() -> None:
    meter = open_meter(MeterConfig(), Path(), readings_mT={70.0: 38.0})
    assert meter.read_flux(5, gap_mm=70.0).flux_mT == 38.0
    assert meter.read_flux(5, gap_mm=70.0).status == "manual"
    assert meter.read_flux(5, gap_mm=60.0).status == "none"


@pytest.mark.parametrize("unit", ["1", "2", "3"])
def test_the_twin_meter_through_the_serial_driver(unit: str) -> None:
    config = MeterConfig(
        driver="lakeshore_425", port=f"twinmeter://?flux_mT=38.05&unit={unit}"
    )
    meter = open_meter(config, Path())
    flux = meter.read_flux(3, gap_mm=70.0)
    assert (flux.status, flux.samples) == ("ok", 3)
    assert flux.flux_mT == pytest.approx(38.05, rel=1e-4)
    assert "MODEL425" in str(meter.identity)
    meter.close()


def test_the_twin_meter_overloads_and_falls_silent() -> None:
    port = "twinmeter://?flux_mT=400"
    meter = open_meter(MeterConfig(driver="lakeshore_425", port=port), Path())
    assert meter.read_flux(3, gap_mm=70.0).status == "overload"
    quick = read_description("lakeshore_425")
    quick = quick.model_copy(
        update={"read": quick.read.model_copy(update={"timeout_s": 0.02})}
    )
    with pytest.raises(MeterError, match="must tell its unit"):
        SerialMeter(quick, "twinmeter://?silent=1")


# A meter on a pseudo-terminal: the operating system's own serial line.

pty_only = pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs POSIX")


@contextlib.contextmanager
def on_pty(answer: Callable[[bytes, Callable[[bytes], None]], None]) -> Iterator[str]:
    master, slave = os.openpty()
    is_over = threading.Event()

    def work() -> None:
        with contextlib.suppress(OSError):
            while not is_over.is_set():
                answer(os.read(master, 256), lambda data: os.write(master, data))

    import tty

    tty.setraw(slave)
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        is_over.set()
        os.close(slave)
        os.close(master)


def quick(driver: str, **line) -> MeterDescription:
    """The packaged description, with short waits and 8 bits, as a pty has no parity."""
    description = read_description(driver)
    read = description.read.model_copy(update={"timeout_s": 0.3, "pause_s": 0.0})
    plain = description.line.model_copy(update={"bits": 8, "parity": "N", **line})
    return description.model_copy(update={"read": read, "line": plain})


def in_questions(replies: dict[bytes, list[bytes]]):
    buffer = bytearray()

    def answer(data: bytes, send) -> None:
        buffer.extend(data)
        while b"\n" in buffer:
            line, _, rest = bytes(buffer).partition(b"\n")
            buffer[:] = rest
            row = replies.get(line.strip())
            if row:
                send(row.pop(0) if len(row) > 1 else row[0])

    return answer


@pty_only
def test_lake_shore_421_asks_three_questions() -> None:
    replies = {
        b"UNIT?": [b"T\r"], b"FIELDM?": [b"m\r"], b"FIELD?": [b"+38.05\r"],
        b"*IDN?": [b"LSCI,MODEL421\r"],
    }  # fmt: skip
    description = quick("lakeshore_421").model_copy(update={"identify": ("*IDN?",)})
    with on_pty(in_questions(replies)) as port:
        meter = SerialMeter(description, port)
        flux = meter.read_flux(2, gap_mm=70.0)
        meter.close()
    assert (flux.status, flux.samples) == ("ok", 2)
    assert flux.flux_mT == pytest.approx(38.05)


@pty_only
def test_a_range_that_changes_between_questions_is_no_reading() -> None:
    replies = {
        b"UNIT?": [b"T\r"], b"FIELD?": [b"+38.05\r"],
        b"FIELDM?": [b"m\r", b"\0\r", b"m\r", b"m\r"],
    }  # fmt: skip
    description = quick("lakeshore_421").model_copy(update={"identify": ()})
    with on_pty(in_questions(replies)) as port:
        meter = SerialMeter(description, port)
        flux = meter.read_flux(2, gap_mm=70.0)
        meter.close()
    assert flux.samples <= 1
    assert flux.flux_mT in (None, pytest.approx(38.05))


@pty_only
def test_a_late_reply_is_never_the_answer_to_the_next_question() -> None:
    state = {"asked": 0}
    buffer = bytearray()

    def answer(data: bytes, send) -> None:
        buffer.extend(data)
        while b"\n" in buffer:
            line, _, rest = bytes(buffer).partition(b"\n")
            buffer[:] = rest
            if line.strip() == b"UNIT?":
                send(b"2\r\n")
            elif line.strip() == b"RDGFIELD?":
                state["asked"] += 1
                # each reply is followed by a stray second one
                send(b"+%.4fE+00\r\n+9.9999E+00\r\n" % (0.038 + state["asked"] * 1e-4))

    description = quick("lakeshore_425").model_copy(update={"identify": ()})
    with on_pty(answer) as port:
        meter = SerialMeter(description, port)
        flux = meter.read_flux(4, gap_mm=70.0)
        meter.close()
    assert [raw[:7] for raw in flux.raw] == ["+0.0381", "+0.0382", "+0.0383", "+0.0384"]


@pty_only
def test_a_torn_reply_and_garbage_are_not_numbers() -> None:
    replies = {
        b"UNIT?": [b"2\r\n"],
        b"RDGFIELD?": [b"+0.03", b"\xff\xfe~\r\n", b"+0.0380E+00\r\n"],
    }
    description = quick("lakeshore_425").model_copy(update={"identify": ()})
    with on_pty(in_questions(replies)) as port:
        meter = SerialMeter(description, port)
        flux = meter.read_flux(4, gap_mm=70.0)
        meter.close()
    assert (flux.status, flux.samples) == ("ok", 2)
    assert flux.flux_mT == pytest.approx(38.0)


@pty_only
@pytest.mark.parametrize(
    ("stream", "status", "flux_mT"),
    [
        (b"00038\r" + FRAME + FRAME, "ok", 0.03805),
        (FRAME[:9] + FRAME + FRAME, "ok", 0.03805),
        (b"\x0242B30100009999\r" + FRAME, "ok", 0.03805),
        (b"\x0241ZZ0100003805\r", "unit", None),
        (b"", "silent", None),
    ],
)
def test_frames_are_joined_in_the_middle(stream, status, flux_mT) -> None:
    master, slave = os.openpty()
    import tty

    tty.setraw(slave)
    is_over = threading.Event()

    def send() -> None:
        with contextlib.suppress(OSError):
            while not is_over.wait(0.02):
                os.write(master, stream)

    threading.Thread(target=send, daemon=True).start()
    meter = SerialMeter(quick("lutron_frame"), os.ttyname(slave))
    flux = meter.read_flux(2, gap_mm=70.0)
    meter.close()
    is_over.set()
    os.close(master)
    os.close(slave)
    assert flux.status == status
    assert flux.flux_mT == (None if flux_mT is None else pytest.approx(flux_mT))


@pty_only
def test_a_port_that_vanishes_is_a_meter_error() -> None:
    replies = {b"UNIT?": [b"2\r\n"], b"RDGFIELD?": [b"+0.0380E+00\r\n"]}
    description = quick("lakeshore_425").model_copy(update={"identify": ()})
    master, slave = os.openpty()
    import tty

    tty.setraw(slave)
    answer = in_questions(replies)

    def work() -> None:
        with contextlib.suppress(OSError):
            while True:
                answer(os.read(master, 256), lambda data: os.write(master, data))

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    meter = SerialMeter(description, os.ttyname(slave))
    os.close(slave)
    meter._device.close()
    with pytest.raises(MeterError, match="was lost"):
        meter.read_flux(1, gap_mm=70.0)
    os.close(master)
