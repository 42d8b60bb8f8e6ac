"""Text of strangers does not steer a terminal, nor a spreadsheet."""

from __future__ import annotations

import csv
import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from magbend.cli import main
from magbend.core.errors import StoreError
from magbend.core.text import defused, printable
from magbend.rig.runs.step_table import step_table


@given(st.text())
def test_no_control_character_reaches_the_terminal(text):
    shown = printable(text)
    assert all(
        sign in "\n\t" or sign.isprintable() or ord(sign) > 0x9F for sign in shown
    )
    assert printable(shown) == shown


def test_an_error_about_a_hostile_name_is_shown_as_it_is(monkeypatch, capsys):
    def fail():
        raise StoreError("\x1b]0;pwned\x07run\x9b2J: is damaged")

    monkeypatch.setattr(main, "app", fail)
    monkeypatch.delenv("MAGBEND_DEBUG", raising=False)
    with pytest.raises(SystemExit):
        main.main()
    said = capsys.readouterr().err
    assert "\x1b" not in said
    assert r"\x1b]0;pwned" in said


@pytest.mark.parametrize("cell", ["=1+1", "+cmd", "-cmd|x", "@SUM(1)", "\t=1", "\r=1"])
def test_a_formula_is_defused_and_numbers_stay_numbers(cell):
    assert defused(cell) == f"'{cell}"
    assert defused(-1.5) == -1.5
    assert defused("-1.5") == "-1.5"
    assert defused("step_000.png") == "step_000.png"
    step = {"index": 0, "gap_mm": -3.0, "flags": [cell], "files": []}
    row = next(csv.DictReader(io.StringIO(step_table([step]), newline="")))
    assert row["gap_mm"] == "-3.0"
    assert row["flags"].startswith("'")
