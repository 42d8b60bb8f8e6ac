"""Write a measured gap into a rig file and leave every other byte as it is."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...core.errors import ConfigError
from ...core.files import write_text
from ...core.toml import read_text

_STAGE = re.compile(r"^[ \t]*\[[ \t]*stage[ \t]*\][^\n]*\n", re.MULTILINE)
_MEASURED = re.compile(
    r"^[ \t]*\[[ \t]*stage\.measured[^\n]*\n(?:(?![ \t]*\[)[^\n]*(?:\n|\Z))*",
    re.MULTILINE,
)


def write_measured_gap(
    path: Path, gap_at_zero_mm: float, direction: int, measured: Mapping[str, Any]
) -> None:
    """Write the map of a bench into its rig file.

    Parameters
    ----------
    path : Path
        The rig file.
    gap_at_zero_mm, direction : float and int
        The map.
    measured : mapping
        The table ``[stage.measured]``: where and on which board it was measured. It
        replaces the one that is there, at the end of the file.

    Raises
    ------
    ConfigError
        If the file has no table ``[stage]`` of its own, or a key twice.
    """
    text = read_text(path)
    text = _set(path, text, "gap_at_zero_mm", f"{gap_at_zero_mm:.3f}")
    if _numbers(text, "direction") or direction != 1:
        text = _set(path, text, "direction", f"{direction}")
    while _MEASURED.search(text):
        text = _MEASURED.sub("", text)
    write_text(path, f"{text.rstrip()}\n\n{_table(measured)}")


def _key(name: str) -> re.Pattern[str]:
    return re.compile(rf"^([ \t]*{name}[ \t]*=[ \t]*)[^#\s]+(.*)$", re.MULTILINE)


def _numbers(text: str, name: str) -> int:
    return len(_key(name).findall(text))


def _set(path: Path, text: str, name: str, value: str) -> str:
    """Replace the value of a key, or put it first in ``[stage]``."""
    count = _numbers(text, name)
    if count == 1:
        return _key(name).sub(rf"\g<1>{value}\g<2>", text)
    heads = _STAGE.findall(text)
    if count or len(heads) != 1:
        raise ConfigError(
            f"{path}: {name} must stand once, on a line of its own in [stage]; instead "
            f"found {count}; write {name} = {value} yourself"
        )
    return _STAGE.sub(lambda found: f"{found.group()}{name} = {value}\n", text)


def _table(measured: Mapping[str, Any]) -> str:
    rows = ["[stage.measured]  # by magbend rig set-gap: the board as it was then"]
    for name, value in measured.items():
        if not isinstance(value, Mapping):
            rows.append(f"{name} = {json.dumps(value, ensure_ascii=False)}")
    for name, value in measured.items():
        if isinstance(value, Mapping):
            rows.append(f"[stage.measured.{name}]")
            rows += [f'"{key}" = {json.dumps(item)}' for key, item in value.items()]
    return "\n".join(rows) + "\n"
