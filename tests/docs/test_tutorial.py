"""The tutorial's commands work, one after another, and print what it shows."""

from __future__ import annotations

import doctest
import os
import re
import subprocess
import sys
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


def run(command: str, folder: Path) -> str:
    binaries = Path(sys.executable).parent
    environment = {**os.environ, "PATH": f"{binaries}{os.pathsep}{os.environ['PATH']}"}
    environment["COLUMNS"] = "100"
    done = subprocess.run(
        command,
        shell=True,
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"$ {command}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.mark.skipif(os.name != "posix", reason="console blocks are for a POSIX shell")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_pages_commands_print_what_the_page_shows(
    page: Path, tmp_path: Path
) -> None:
    pairs = transcript(page)
    assert pairs
    matches = doctest.OutputChecker().check_output
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    for command, shown in pairs:
        if command.startswith("make "):
            continue
        printed = run(command, tmp_path)
        if shown.strip():
            assert matches(shown, printed, flags), (
                f"$ {command}\nshown:\n{shown}\nprinted:\n{printed}"
            )
