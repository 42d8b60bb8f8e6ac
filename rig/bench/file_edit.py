"""Change one number of a rig file and leave every other byte as it is."""

from __future__ import annotations

import re
from pathlib import Path

from ...core.errors import ConfigError
from ...core.files import write_text
from ...core.toml import read_text

_LINE = re.compile(r"^(\s*gap_at_zero_mm\s*=\s*)[^#\s]+(.*)$", re.MULTILINE)


def replace_gap_at_zero(path: Path, gap_at_zero_mm: float) -> None:
    """Write a new ``gap_at_zero_mm`` into a rig file.

    Raises
    ------
    ConfigError
        If the file does not have that key on a line of its own.
    """
    text = read_text(path)
    changed, count = _LINE.subn(rf"\g<1>{gap_at_zero_mm:.3f}\g<2>", text)
    if count != 1:
        raise ConfigError(
            f"{path}: gap_at_zero_mm must stand once, on a line of its own; instead "
            f"found {count}; write gap_at_zero_mm = {gap_at_zero_mm:.3f} yourself"
        )
    write_text(path, changed)
