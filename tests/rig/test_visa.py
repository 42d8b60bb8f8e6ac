"""A Tesla-meter behind PyVISA says what it says on a serial line."""

from __future__ import annotations

import pytest

from magbend.core.errors import MeterError
from magbend.rig.meter.description import read_description
from magbend.rig.meter.serial import SerialMeter
from magbend.rig.ports import why_not_allowed

BENCH = """
spec: "1.1"
devices:
  gaussmeter:
    eom:
      GPIB INSTR: {q: "\\n", r: "\\n"}
    error: ERROR
    dialogues:
      - {q: "*IDN?", r: "LSCI,MODEL475,0,1"}
      - {q: "TYPE?", r: "40"}
      - {q: "UNIT?", r: "2"}
      - {q: "RANGE?", r: "1"}
      - {q: "AUTO?", r: "1"}
      - {q: "RDGMODE?", r: "1,3,1,1,1"}
      - {q: "RDGFIELD?", r: "+038.010E-03"}
resources:
  GPIB0::12::INSTR: {device: gaussmeter}
"""


def test_a_meter_on_gpib_is_read_by_its_description(tmp_path):
    pytest.importorskip("pyvisa_sim")
    (tmp_path / "bench.yaml").write_text(BENCH)
    port = f"visa:GPIB0::12::INSTR@{tmp_path / 'bench.yaml'}@sim"
    told: list[bytes] = []
    meter = SerialMeter(
        read_description("lakeshore_475"), port,
        tap=lambda direction, data: told.append(data) if direction == "<<" else None,
    )  # fmt: skip
    flux = meter.read_flux(3, gap_mm=70.0)
    meter.close()
    assert (flux.status, flux.samples) == ("ok", 3)
    assert flux.flux_mT == pytest.approx(38.01)
    assert b"+038.010E-03\n" in b"".join(told)


def test_a_resource_that_is_not_there_is_a_sentence():
    pytest.importorskip("pyvisa")
    with pytest.raises(MeterError, match=r"visa:GPIB0::1::INSTR.*cannot be opened"):
        SerialMeter(read_description("lakeshore_475"), "visa:GPIB0::1::INSTR")


def test_a_meter_on_the_network_must_be_meant():
    assert "network = true" in why_not_allowed("visa:TCPIP::h::INSTR", network=False)
    assert why_not_allowed("visa:TCPIP::h::INSTR", network=True) == ""
    assert why_not_allowed("visa:GPIB0::12::INSTR", network=False) == ""
