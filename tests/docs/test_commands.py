"""What the pages tell people to type is there: commands, and options of each."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from typer.main import get_command

from magbend.cli.main import app

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    path
    for folder in (".", "docs", "examples", "changes")
    for path in sorted((ROOT / folder).glob("*.md" if folder == "." else "**/*.md"))
    if not {"site", "made"} & set(path.parts)
]
MAGBEND = get_command(app)
ALWAYS = {"--help", "--version", "--debug"}


def typed(text: str) -> Iterator[list[str]]:
    """Yield the words after each ``magbend``, of console blocks and within lines."""
    lines = text.replace("\\\n", " ")
    for found in re.finditer(r"(?m)(?:^(?:\$ )?|`)magbend +([a-z][^`\n]*)", lines):
        yield [word.strip(".,;()\"'") for word in found[1].split(" #")[0].split()]


def named(words: list[str]) -> tuple[click.Command, list[str]]:
    """Return the command that words begin with, and the words after it."""
    command = MAGBEND
    while words and words[0] in getattr(command, "commands", ()):
        command, words = command.commands[words[0]], words[1:]
    return command, words


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_of_the_pages_are_there_with_their_options(page: Path) -> None:
    for words in typed(page.read_text(encoding="utf-8")):
        command, rest = named(words)
        if rest == words:
            continue  # a sentence that begins with the program's name
        is_group = hasattr(command, "commands")
        assert not (is_group and rest and rest[0].isidentifier()), words
        known = {name for one in command.params for name in one.opts}
        known |= {name for one in command.params for name in one.secondary_opts}
        asked = {word.split("=")[0] for word in rest if word.startswith("--")}
        assert asked <= known | ALWAYS, words
