"""JSON in and out: guarded on the way in, without NaN on the way out."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from .door import read_file
from .errors import ConfigError, MagbendError
from .files import write_text

MOST_MB = 64.0
_MOST_DEPTH = 60
_MOST_DIGITS = 40


def plain(value: Any) -> Any:
    """Return `value` as JSON can hold it: no NaN but null, no array but a list."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def dump_json(data: Any, *, indent: int | None = 2) -> str:
    """Return `data` as JSON; NaN becomes null, since JSON has no NaN."""
    return json.dumps(plain(data), indent=indent, ensure_ascii=False, allow_nan=False)


def write_json(path: Path, data: Any, *, indent: int | None = 2) -> None:
    """Write `data` as JSON, whole or not at all (see `files.write_bytes`)."""
    write_text(path, dump_json(data, indent=indent) + "\n")


def read_json(
    path: Path, *, most_MB: float = MOST_MB, kind: type[MagbendError] = ConfigError
) -> dict[str, Any]:
    """Read a JSON object from a file that anybody may have written.

    Raises
    ------
    MagbendError
        Of the given `kind`: it is missing, no regular file, too large, no JSON object,
        nested too deep, or holds a number that is none.
    """
    try:
        data = parse_json(read_file(path, most_MB, kind))
    except ValueError as error:
        if isinstance(error, MagbendError):
            raise
        raise kind(f"{path}: is damaged: {error}") from None
    if not isinstance(data, dict):
        raise kind(f"{path}: must hold one JSON object")
    return data


def parse_json(data: bytes) -> Any:
    """Return what a JSON text holds.

    Raises
    ------
    ValueError
        If it is no UTF-8, no JSON, nested deeper than 60 levels, names a key twice, or
        holds NaN, infinity or a number of more than 40 digits.
    """
    try:
        found = json.loads(
            data.decode("utf-8-sig"), parse_int=_whole, parse_float=_number,
            parse_constant=_refuse, object_pairs_hook=_once_each,
        )  # fmt: skip
    except UnicodeDecodeError:
        raise ValueError("it is not text in UTF-8") from None
    except RecursionError:
        raise ValueError("it is nested too deep") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"it is not valid JSON: {error}") from None
    _check_depth(found)
    return found


def _whole(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise ValueError(f"it holds a number of {len(text)} digits")
    return int(text)


def _number(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError("it holds a number that is too large")
    return number


def _refuse(text: str) -> None:
    raise ValueError(f"it holds {text}, which is no number")


def _once_each(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("it names a key twice")
    return found


def _check_depth(found: Any) -> None:
    level = [found]
    for _ in range(_MOST_DEPTH):
        inner: list[Any] = []
        for item in level:
            if isinstance(item, dict):
                inner.extend(item.values())
            elif isinstance(item, list):
                inner.extend(item)
        level = inner
        if not level:
            return
    raise ValueError("it is nested too deep")
