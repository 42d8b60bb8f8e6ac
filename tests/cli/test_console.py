"""What commands print steers no terminal."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from magbend.cli.console import print_json, say

CLI = Path(__file__).parents[2] / "cli"
HOSTILE = "\x1b]0;pwned\x07run\x9b2J\u202e"


def test_a_hostile_name_shows_itself(capsys: pytest.CaptureFixture[str]) -> None:
    say(f"{HOSTILE}: good\n\tyes")
    said = capsys.readouterr().out
    assert said == r"\x1b]0;pwned\x07run\x9b2J\u202e: good" + "\n\tyes\n"


def test_json_stays_json(capsys: pytest.CaptureFixture[str]) -> None:
    print_json({HOSTILE: [HOSTILE, 1.5]})
    said = capsys.readouterr().out
    assert not set(said) & set("\x1b\x07\x9b\u202e")
    assert json.loads(said) == {HOSTILE: [HOSTILE, 1.5]}


def test_every_command_speaks_through_the_one_door() -> None:
    """Only lines that are drawn again and again (``nl=False``) hold a raw sign."""
    for path in CLI.glob("*.py"):
        if path.name != "console.py":
            calls = re.findall(r"typer\.echo.*|^\s*print\(.*", path.read_text(), re.M)
            assert all("nl=False" in call for call in calls), (path, calls)
