"""The tutorial's commands work, one after another, and print what it shows."""

from __future__ import annotations

import doctest
import re
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted((ROOT / "docs").glob("tutorial*.md"))


def transcript(page: Path) -> list[tuple[str, str]]:
    """Return the (command, shown output) pairs of a page's console blocks."""
    pairs: list[tuple[str, str]] = []
    text = page.read_text(encoding="utf-8")
    for block in re.findall(r"```console\n(.*?)```", text, re.DOTALL):
        for chunk in re.split(r"(?m)^\$ ", block.replace("\\\n", " "))[1:]:
            command, _, shown = chunk.partition("\n")
            pairs.append((command.strip(), shown))
    return pairs


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_pages_commands_print_what_the_page_shows(
    page: Path, tmp_path: Path, magbend, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    pairs = transcript(page)
    assert pairs
    matches = doctest.OutputChecker().check_output
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    for command, shown in pairs:
        program, *words = shlex.split(command)
        if program == "make":
            continue
        assert program == "magbend"
        done = magbend(*words, cwd=tmp_path)
        assert done.returncode == 0, f"$ {command}\n{done.stdout}{done.stderr}"
        if shown.strip():
            # Only the first command of an installation compiles kernels.
            printed = re.sub(r"^kernels .*\n", "", done.stdout, flags=re.MULTILINE)
            assert matches(shown, printed, flags), (
                f"$ {command}\nshown:\n{shown}\nprinted:\n{printed}"
            )
