"""Change values in a TOML file that a person wrote: its comments stay."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from ..core.errors import ConfigError
from ..core.files import write_text

Content = TypeVar("Content")
Values = Mapping[tuple[str, ...], Any]
"""The path of each key, such as ``("settle", "time_s")``, and its new value."""


def edited(text: str, values: Values) -> str:
    """Return a TOML text with new values; None takes a key out.

    Raises
    ------
    ConfigError
        If the text is no TOML.
    """
    import tomlkit
    from tomlkit.exceptions import ParseError

    try:
        document = tomlkit.parse(text)
    except ParseError as error:
        raise ConfigError(f"the file is not valid TOML: {error}") from None
    for path, value in values.items():
        *tables, key = path
        table: Any = document
        for name in tables:
            if name not in table:
                table[name] = tomlkit.table()
            table = table[name]
        if value is None:
            table.pop(key, None)
        else:
            table[key] = value
    return tomlkit.dumps(document)


def read_as(path: Path, text: str, read: Callable[[Path], Content]) -> Content:
    """Return what `read` makes of a text, as if it stood in the file `path`.

    Raises
    ------
    ConfigError
        What `read` says, about `path`.
    """
    with tempfile.NamedTemporaryFile(
        "w", dir=path.parent, prefix=".edited-", suffix=".toml", encoding="utf-8",
        delete=False,
    ) as file:  # fmt: skip
        file.write(text)
    beside = Path(file.name)
    try:
        return read(beside)
    except ConfigError as error:
        raise ConfigError(str(error).replace(str(beside), path.name)) from None
    finally:
        beside.unlink(missing_ok=True)


def change(path: Path, values: Values, read: Callable[[Path], Any]) -> None:
    """Write new values into a file, if `read` accepts the outcome.

    Raises
    ------
    ConfigError
        If it does not; the file stays as it was.
    """
    try:
        before = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    text = edited(before, values)
    read_as(path, text, read)
    write_text(path, text)
