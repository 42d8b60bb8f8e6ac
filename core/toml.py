"""TOML in, checked by a pydantic model; every mistake is one sentence with its line."""

from __future__ import annotations

import difflib
import re
import tomllib
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from pydantic import (
    BaseModel,
    ConfigDict,
    ValidationError,
    ValidationInfo,
    field_validator,
)

from .checks import shown
from .door import read_file
from .errors import ConfigError
from .json import parse_json
from .slips import slip_of
from .text import printable

_MOST_MB = 2.0
_NAMES = ("name", "operator")
"""What is printed as it stands, also on terminals."""

Location = tuple[int | str, ...]
Model = TypeVar("Model", bound="FileModel")


class FileModel(BaseModel):
    """Base of all file models: unknown keys, NaN and infinity are refused.

    So are texts and truth values where a number belongs: 1.0, not "1.0" or true.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, str_strip_whitespace=True
    )

    @field_validator("*", mode="before")
    @classmethod
    def _only_numbers_are_numbers(cls, value: Any, info: ValidationInfo) -> Any:
        field = cls.model_fields[info.field_name or ""]
        kinds = _plain_types(field.annotation)
        number = bool(kinds & {int, float}) and type(value) not in kinds
        if number and isinstance(value, (str, bool)):
            raise ValueError("must be a number, without quotes")
        shown_as_is = info.field_name in _NAMES and isinstance(value, str)
        if shown_as_is and printable(value) != value:
            raise ValueError("must not hold control characters")
        return value

    @field_validator("*", mode="after")
    @classmethod
    def _no_slip_of_the_unit(cls, value: Any, info: ValidationInfo) -> Any:
        name, of_magnet = info.field_name or "", "remanence_T" in cls.model_fields
        for one in value if isinstance(value, (list, tuple)) else (value,):
            if isinstance(one, (int, float)) and not isinstance(one, bool):
                question = slip_of(name, float(one), of_magnet=of_magnet)
                if question:
                    raise ValueError(question)
        return value


def read_toml(path: Path, model: type[Model], *, is_json: bool = False) -> Model:
    """Read `path` as TOML (or as JSON, if it starts with a brace) into `model`.

    `is_json` says that the file is JSON, whatever it starts with.

    Raises
    ------
    ConfigError
        If the file is missing, is no TOML, has an unknown key, lacks a key or holds a
        value that cannot be: one sentence with file, line, key and what is expected.
    """
    text = read_text(path)
    may_be_json = is_json or path.suffix.lower() == ".json"
    is_list = may_be_json and text.lstrip().startswith("[")
    is_json = is_json or is_list or text.lstrip().startswith("{")
    try:
        data = parse_json(text.encode()) if is_json else _parse_toml(text)
    except (ValueError, RecursionError) as error:
        what = "" if is_json else "it is not valid TOML: "
        raise ConfigError(f"{path}: {what}{_short(error)}") from None
    if is_list:
        raise ConfigError(f"{path}: must hold one JSON object, in braces, not a list")
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise ConfigError(_sentence(path, text, error, model)) from None


def _parse_toml(text: str) -> dict[str, Any]:
    """Return what a TOML text holds; names of a thousand dots would take all memory."""
    if re.search(r"(?:[\w\"'-]{1,99}\s*\.\s*){60}", text):
        raise ValueError("it is nested too deep")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deep") from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError as error:
        if "integer string" in str(error):  # Python's own limit, and its advice
            raise ValueError("it holds a number of too many digits") from None
        raise


def _short(error: Exception) -> str:
    text = str(error)
    return text if len(text) < 300 else f"{text[:200]} ..."


def read_text(path: Path) -> str:
    """Return the text of a file the user named.

    Raises
    ------
    ConfigError
        If it is missing, a folder, unreadable, or not UTF-8.
    """
    try:
        return read_file(path, _MOST_MB).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: is not a text file (UTF-8)") from None


def line_of(text: str, location: Location) -> int | None:
    """Return the line (from 1) of a TOML text where the key at `location` stands.

    Parameters
    ----------
    text : str
        The TOML text.
    location : tuple of str and int
        Path of keys and indices, such as ``("section", 1, "E_MPa")``.

    Returns
    -------
    int or None
        The line of the key, else of the table that should hold it, else None.
    """
    keys = [part for part in location if isinstance(part, str)]
    index = next((part for part in location if isinstance(part, int)), 0)
    table: list[str] = []
    seen: dict[tuple[str, ...], int] = {}
    table_line: int | None = None
    for number, line in enumerate(text.splitlines(), start=1):
        header = re.match(r"\s*\[(\[)?\s*([\w.\-\"' ]+?)\s*\]", line)
        if header:
            table = [part.strip("\"' ") for part in header.group(2).split(".")]
            if header.group(1):
                seen[tuple(table)] = seen.get(tuple(table), -1) + 1
            in_table = seen.get(tuple(table), 0) == index or not header.group(1)
            if table == keys[: len(table)] and in_table:
                table_line = number
            continue
        key = re.match(r"\s*([\w\-.\"']+)\s*=", line)
        if not key:
            continue
        path = table + [part.strip("\"'") for part in key.group(1).split(".")]
        in_table = seen.get(tuple(table), index) == index
        if path == keys[: len(path)] and in_table:
            return number
    return table_line


def _plain_types(annotation: Any) -> set[Any]:
    """Types that a value may have itself: int and float in ``float | int | None``."""
    origin = get_origin(annotation)
    if origin is Annotated:
        return _plain_types(get_args(annotation)[0])
    if origin in (Union, UnionType):
        return set().union(*(_plain_types(part) for part in get_args(annotation)))
    if origin is Literal:
        return {type(choice) for choice in get_args(annotation)}
    return {annotation} if origin is None else set()


def _sentence(
    path: Path, text: str, error: ValidationError, model: type[BaseModel]
) -> str:
    line = line_of(text, _first(error)["loc"])
    where = f"{path}, line {line}" if line else f"{path}"
    return f"{where}: {wrong_key(error, model)}"


def _first(error: ValidationError) -> Any:
    # A mistyped key is both unknown and missing: name the one the user can see.
    errors = error.errors()
    return next((e for e in errors if e["type"] == "extra_forbidden"), errors[0])


def wrong_key(error: ValidationError, model: type[BaseModel]) -> str:
    """Return what is wrong with a table, in half a sentence: the key, and why."""
    first = _first(error)
    location = first["loc"]
    key = ".".join(str(part) for part in location)
    if first["type"] == "extra_forbidden":
        return f"unknown key {key!r}{_suggestion(location, model)}"
    if first["type"] == "missing":
        return f"the key {key!r} is missing"
    if first["type"] == "too_short":
        return f"{key}: must hold at least {first['ctx']['min_length']} of them"
    message: str = first["msg"].removeprefix("Value error, ")
    message = message[0].lower() + message[1:]
    if not location:  # of the keys together: each of them is right by itself
        return message
    return f"{key}: {message}; instead received {shown(first['input'])}"


def _suggestion(location: Location, model: type[BaseModel]) -> str:
    known = sorted(_keys_at(location[:-1], model))
    name = str(location[-1])
    with_unit = [key for key in known if key.startswith(f"{name}_")]
    if with_unit:
        return f"; the unit is missing: write {with_unit[0]!r}"
    close = difflib.get_close_matches(name, known, n=1)
    if close:
        return f"; did you mean {close[0]!r}?"
    return f"; known keys are {', '.join(known)}" if known else ""


def _keys_at(location: Location, model: type[BaseModel]) -> list[str]:
    """Names and aliases of the keys that the model takes at `location`."""
    current: Any = model
    for part in location:
        if isinstance(part, int):
            continue
        fields = getattr(current, "model_fields", {})
        field = next((f for name, f in fields.items() if part in (name, f.alias)), None)
        if field is None:
            return []
        current = _model_inside(field.annotation)
    fields = getattr(current, "model_fields", {})
    return [field.alias or name for name, field in fields.items()]


def _model_inside(annotation: Any) -> Any:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for inner in getattr(annotation, "__args__", ()):
        found = _model_inside(inner)
        if found is not None:
            return found
    return None
