"""A record that carries its own digest: any changed byte is noticed.

The last key of a sealed JSON text is ``seal``: the SHA-256 of the text itself, with
zeros in the place of the seal. Lines of a file are chained: each also holds the seal of
the line before as ``after``, so that none can be taken out or moved.
"""

from __future__ import annotations

import hashlib
import json
import re
from typing import Any

_ZEROS = "0" * 64
_SEAL = re.compile(rb'"seal": "([0-9a-f]{64})"\s*\}\s*\Z')


def sealed(record: dict[str, Any], *, indent: int | None = None) -> str:
    """Return a record as JSON text with its seal; a text with lines ends its last.

    Parameters
    ----------
    record : dict
        Without a key ``seal``.
    indent : int, optional
        As in `json.dumps`; a text with one has an end of line.
    """
    end = "" if indent is None else "\n"
    text = json.dumps(
        {**record, "seal": _ZEROS}, ensure_ascii=False, allow_nan=False, indent=indent
    )
    head, name, tail = (text + end).rpartition(_ZEROS)
    digest = hashlib.sha256((head + name + tail).encode()).hexdigest()
    return head + digest + tail


def seal_of(data: bytes) -> str | None:
    """Return the seal that a text carries; None if it carries none."""
    found = _SEAL.search(data)
    return found.group(1).decode() if found else None


def is_whole(data: bytes) -> bool:
    """Return whether a text carries a seal and is as it was sealed, byte for byte."""
    found = _SEAL.search(data)
    if not found:
        return False
    start, end = found.span(1)
    blank = data[:start] + _ZEROS.encode() + data[end:]
    return hashlib.sha256(blank).hexdigest() == found.group(1).decode()
