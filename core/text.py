"""Text of strangers, made fit for a terminal and for a spreadsheet."""

from __future__ import annotations

import re
from typing import Any

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def printable(text: str) -> str:
    """Return a text without what would steer a terminal; each such sign shows itself.

    Escape sequences can rename windows, hide lines and paste commands.
    """
    return _CONTROL.sub(lambda found: repr(found.group())[1:-1], text)


def printable_json(text: str) -> str:
    """Return a text of JSON without such signs: it still says the same."""
    return _CONTROL.sub(lambda found: f"\\u{ord(found.group()):04x}", text)


def defused(cell: Any) -> Any:
    """Return a cell of a table that no spreadsheet takes for a formula.

    A text that begins like one gets an apostrophe before it; numbers stay numbers.
    """
    if not isinstance(cell, str) or not cell.startswith(_FORMULA):
        return cell
    try:
        float(cell)
    except ValueError:
        return f"'{cell}"
    return cell
