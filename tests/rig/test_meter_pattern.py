"""A meter's description cannot keep the reader busy, nor a board's digits blind it."""

from __future__ import annotations

import time

import pytest

from magbend.core.errors import ConfigError
from magbend.rig.meter.description import read_description
from magbend.rig.meter.parse import parse_reply
from magbend.rig.stage.marlin.session import read_position

METER = """
name = "meter"
[line]
baud = 9600
[read]
mode = "query"
command = "?"
pattern = '{pattern}'
[unit]
source = "fixed"
name = "mT"
"""


@pytest.mark.parametrize(
    "pattern",
    [
        r"(?P<value>(\d+)+)x",
        r"(?P<value>\d+)(a*)*b",
        r"(?P<value>\d+)(a|a)+b",
        r"(?P<value>([0-9]+\.?)*)",
        r"((a+)b?)+(?P<value>\d)",
        r"(?P<value>\d)" + "a?" * 200,
    ],
)
def test_a_pattern_that_backtracks_without_end_is_refused(pattern, tmp_path):
    path = tmp_path / "meter.toml"
    path.write_text(METER.format(pattern=pattern))
    with pytest.raises(
        ConfigError, match=r"meter\.toml, line \d+: read\.pattern: must"
    ):
        read_description("meter", path)


def test_a_reply_of_endless_digits_is_garbled_at_once():
    description = read_description("lakeshore_425", None)
    start_s = time.process_time()
    for reply in ("9" * 100_000, "+1.0E" + "9" * 400, "9" * 400):
        assert parse_reply(description, reply, unit="T").outcome != "ok"
    assert time.process_time() - start_s < 1.0


def test_a_place_of_endless_digits_is_no_place():
    assert read_position(["X:" + "9" * 400 + " Y:0.00"], "X", 100.0) is None
    assert read_position(["X:0.0 Count X:" + "9" * 400], "X", 100.0) in (None, 0.0)
    assert read_position(["X:10.50 Y:0.00 Count X:1050 Y:0"], "X", 100.0) == 10.5
