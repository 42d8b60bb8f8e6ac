"""Lines of GRBL, grblHAL and FluidNC, and lines of nobody."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from magbend.rig.stage.grbl.protocol import (
    ALARMS,
    Alarm,
    Banner,
    Message,
    Ok,
    Other,
    Refusal,
    Report,
    Setting,
    alarm_text,
    error_text,
    jog_line,
    machine_position,
    parse_line,
    parse_report,
)


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("ok", Ok()),
        ("error:9", Refusal("9")),
        ("ALARM:3", Alarm(3)),
        ("Grbl 1.1h ['$' for help]", Banner("Grbl 1.1h ['$' for help]")),
        ("$100=250.000", Setting("100", "250.000")),
        ("$22=1", Setting("22", "1")),
        ("$Homing/Enable=1", Setting("Homing/Enable", "1")),
        ("[MSG:Reset to continue]", Message("MSG", "Reset to continue")),
        ("[NVS STORAGE:*EEPROM]", Message("NVS STORAGE", "*EEPROM")),
        (">G20G54:ok", Other(">G20G54:ok")),
        ("ok\0\r", Other("ok\0")),
        ("okok", Other("okok")),
        ("ALARM:", Other("ALARM:")),
        ("ALARM:\xb2", Other("ALARM:\xb2")),  # a digit, but none of a number
        ("<Hold:\xb2|MPos:0,0,0>", Other("<Hold:\xb2|MPos:0,0,0>")),
        ("<Idle|MPos:1.0", Other("<Idle|MPos:1.0")),
    ],
)
def test_each_line_means_one_thing(text, meaning):
    assert parse_line(text) == meaning


@pytest.mark.parametrize(
    "banner",
    [
        "Grbl 1.1h ['$' for help]",
        "GrblHAL 1.1f ['$' or '$HELP' for help]",
        "Grbl 3.7 [FluidNC v3.7.16 (wifi) '$' for help]",
    ],
)
def test_the_banners_of_the_dialects_are_banners(banner):
    assert isinstance(parse_line(banner), Banner)


def test_unknown_fields_of_a_report_are_kept_and_harm_nothing():
    line = "<Idle|MPos:-2.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>"
    report = parse_line(line)
    assert isinstance(report, Report)
    assert report.machine == (-2.0, 0.0, 0.0)
    assert report.buffer == (100, 1023)
    assert report.fields["TLR"] == "0"


def test_hold_has_its_substate_and_pins_their_letters():
    report = parse_report("<Hold:1|MPos:0,0,0|FS:12,0|Pn:XP>")
    assert report is not None
    assert (report.state, report.substate, report.feed) == ("hold", 1, 12.0)
    assert report.pins == "XP"


@pytest.mark.parametrize(
    "torn",
    [
        "<Idle|MPos:1.0,2.0,3.0|FS:0,0",
        "<Idle|MPos:1.0,<Idle|MPos:1.0,2.0,3.0|FS:0,0>",
        "<Idle|FS:0,0>",
        "<Idle|MPos:nan,0,0|FS:0,0>",
        "<Idle|MPos:inf,0,0|FS:0,0>",
        "<Idle|MPos:1.0.0,0,0|FS:0,0>",
        "<Flying|MPos:0,0,0|FS:0,0>",
        "<>",
    ],
)
def test_a_torn_report_is_no_report(torn):
    assert parse_report(torn) is None


def test_work_position_needs_the_offset():
    report = parse_report("<Idle|WPos:5.000,0.000,0.000|FS:0,0>")
    assert report is not None
    assert machine_position(report, None) is None
    assert machine_position(report, (-16.0, 0.0, 0.0)) == (-11.0, 0.0, 0.0)


@given(st.text(max_size=120))
def test_nothing_a_line_can_say_raises(text):
    parse_line(text)


@given(
    st.floats(-999, 999), st.floats(1, 5000), st.sampled_from("XYZ")
)  # the firmware's line buffer holds 80 characters
def test_a_jog_is_absolute_metric_and_short(place, feed, axis):
    line = jog_line(axis, place, feed)
    assert line.startswith("$J=G21G90G53")
    assert len(line) < 80


def test_only_the_soft_limit_alarm_keeps_the_position():
    assert [code for code, text in ALARMS.items() if text.position_kept] == [2]
    assert not alarm_text(99).position_kept


@pytest.mark.parametrize(
    ("code", "words"),
    [(13, "emergency stop"), (14, "homing first"), (17, "motor's driver")],
)
def test_alarms_of_the_relatives_are_named(code, words):
    assert words in alarm_text(code).meaning


def test_unknown_errors_still_have_words():
    assert "manual" in error_text("79")
    assert "manual" in error_text("Bad")
