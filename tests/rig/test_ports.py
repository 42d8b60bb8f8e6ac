"""Which ports may be named in a file, and what happens to files that are none."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from magbend.cli.main import app
from magbend.core.errors import ConfigError, MagbendError, MeterError, StageError
from magbend.rig import read_rig
from magbend.rig.clock import SteppedClock
from magbend.rig.link import Link
from magbend.rig.meter.description import read_description
from magbend.rig.meter.serial import SerialMeter
from magbend.rig.ports import check_port, why_not_allowed

from .conftest import RIG

HARMFUL = [
    "spy:///dev/null?file=precious.txt",
    "SPY:///dev/null?file=precious.txt",
    "alt:///dev/null?class=PosixPollSerial",
    "hwgrep://.*",
    "loop://",
    "rfc2217://127.0.0.1:1",
    "cp2110://0",
    "file:///dev/null",
    "twin:///tmp/x.json",
    "twin://../x.json",
    "twin://a/../../x.json",
    "socket://127.0.0.1:1",
    "/dev/tty\\u0000",
]


@pytest.mark.parametrize("table", ["stage", "meter"])
@pytest.mark.parametrize("port", HARMFUL)
def test_a_rig_file_cannot_name_a_harmful_address(table, port, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("precious.txt").write_text("a year of work")
    text = RIG.replace('port = "none"', 'port = "auto"')
    text = text.replace('port = "auto"\n', "") if table == "stage" else text
    text = text.replace(f"[{table}]", f'[{table}]\nport = "{port}"')
    Path("rig.toml").write_text(text)
    with pytest.raises(ConfigError, match=rf"rig.toml, line \d+: {table}\.port: "):
        read_rig(Path("rig.toml"))
    result = CliRunner().invoke(app, ["rig", "status"])
    assert isinstance(result.exception, MagbendError)
    assert Path("precious.txt").read_text() == "a year of work"
    assert {p.name for p in tmp_path.iterdir()} == {"precious.txt", "rig.toml"}


def test_a_port_on_the_network_needs_its_word(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(RIG.replace('"none"', '"socket://10.0.0.7:23"'))
    with pytest.raises(ConfigError, match="add network = true"):
        read_rig(path)
    path.write_text(RIG.replace('"none"', '"socket://10.0.0.7:23"\nnetwork = true'))
    assert read_rig(path).stage.port == "socket://10.0.0.7:23"


def test_the_board_of_a_rig_file_lies_beside_it(tmp_path, monkeypatch):
    (tmp_path / "bench").mkdir()
    path = tmp_path / "bench" / "rig.toml"
    path.write_text(RIG.replace('"none"', '"twin://board.json?speed=9"'))
    stage = read_rig(path).stage
    assert stage.port == "twin://board.json?speed=9"
    assert stage.address == f"twin://{path.parent.resolve()}/board.json?speed=9"
    monkeypatch.chdir(tmp_path / "bench")
    assert read_rig(Path("rig.toml")).stage.address == stage.port


@pytest.mark.parametrize("port", [p for p in HARMFUL[:8] if "\\" not in p])
def test_the_ports_themselves_open_no_harmful_address(port, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("precious.txt").write_text("a year of work")
    with pytest.raises(StageError, match="address of another kind"):
        Link(port, baud=9600, clock=SteppedClock()).open()
    with pytest.raises(MeterError, match="address of another kind"):
        SerialMeter(read_description("lakeshore_425", None), port)
    assert Path("precious.txt").read_text() == "a year of work"


@pytest.mark.skipif(os.name != "posix", reason="pipes are POSIX")
@pytest.mark.parametrize("kind", ["file", "pipe", "folder"])
def test_a_file_that_is_no_device_is_left_alone(kind, tmp_path):
    path = tmp_path / "thing"
    {"file": path.touch, "folder": path.mkdir, "pipe": lambda: os.mkfifo(path)}[kind]()
    with pytest.raises(StageError, match="no device, and is left alone"):
        Link(str(path), baud=9600, clock=SteppedClock()).open()


@given(st.text(max_size=30), st.text(max_size=30))
def test_no_scheme_but_the_known_ones_is_ever_allowed(scheme, rest):
    port = f"{scheme}://{rest}"
    is_known = scheme.lower() in ("twin", "twinmeter")
    allowed = why_not_allowed(port, network=False) == ""
    assert not allowed or is_known
    if not is_known and scheme.lower() != "socket":
        with pytest.raises(ValueError):
            check_port(port)
