"""A Tesla-meter described in TOML: line, question, answer, unit, overload.

Ready descriptions are packaged in ``rig/meters``; a rig file may name one of its own.
"""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path
from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PositiveInt,
)

from ...core.errors import ConfigError
from ...core.toml import FileModel, read_toml
from ...core.units import tesla_per_unit

OVERLOAD_TOKENS = ("OL", "OVER", "----", "9.9E37", "9.90E+37")
_LONGEST_PATTERN = 300
_PREFIXES = {"": 1.0, "k": 1e3, "m": 1e-3, "u": 1e-6, "µ": 1e-6, "n": 1e-9}


def _is_unit(unit: str) -> str:
    tesla_per_unit(unit)
    return unit


def _repeats_repeats(pattern: str) -> bool:
    """Return whether a group that holds a repetition or a choice is itself repeated."""
    outer = [re.escape(sign) for sign in "*+"] + [r"\{\d+(?:,\d*)?\}"]
    inside = r"\((?:[^()\\]|\\.|\[[^\]]*\])*(?<!\\)[*+{|](?:[^()\\]|\\.)*\)"
    flat = re.sub(r"\[(?:\\.|[^\]\\])*\]", "x", pattern)
    while True:
        if re.search(rf"{inside}(?:{'|'.join(outer)})", flat):
            return True
        less = re.sub(r"\(((?:[^()\\]|\\.)*)\)\??(?![*+{])", r"\1", flat, count=1)
        if less == flat:
            return False
        flat = less


def _is_pattern(pattern: str) -> str:
    if len(pattern) > _LONGEST_PATTERN:
        raise ValueError(f"must not be longer than {_LONGEST_PATTERN} characters")
    try:
        groups = set(re.compile(pattern).groupindex)
    except re.error as error:
        raise ValueError(f"must be a regular expression ({error})") from None
    if _repeats_repeats(pattern):
        raise ValueError(
            "must not repeat a part that holds a repetition or a choice itself, such "
            "as (a+)+ or (a|b)+, of which [ab]+ is the safe form: a reply that does "
            "not fit would be looked at for ever"
        )
    if "value" not in groups:
        raise ValueError("must have a named group (?P<value>...)")
    unknown = groups - {"value", "sign", "unit", "multiplier", "decimals", "status"}
    if unknown:
        raise ValueError(f"has the unknown named group {sorted(unknown)[0]!r}")
    return pattern


UnitName = Annotated[str, AfterValidator(_is_unit)]
Pattern = Annotated[str, AfterValidator(_is_pattern)]


class LineModel(FileModel):
    """The ``[line]`` table: parameters of the serial line (7-O-1 matters)."""

    baud: PositiveInt = 9600
    bits: Literal[5, 6, 7, 8] = 8
    parity: Literal["N", "E", "O"] = "N"
    stop_bits: Literal[1, 2] = 1
    dtr: bool | None = None


class ReadModel(FileModel):
    r"""The ``[read]`` table: how one reading is asked for and recognised.

    In mode ``query`` the `command` is sent for each reading; in mode ``stream`` the
    meter sends lines by itself; in mode ``frame`` it sends blocks of `frame_bytes` from
    `frame_start` to `frame_end`. The `pattern` must match a whole reply.
    """

    # Line ends are white space: they must not be stripped off the keys that hold them.
    model_config = ConfigDict(str_strip_whitespace=False)

    mode: Literal["query", "stream", "frame"]
    command: str = ""
    command_end: str = "\n"
    reply_end: str = Field(default="\n", min_length=1)
    pattern: Pattern
    frame_start: str = Field(default="\x02", min_length=1)
    frame_end: str = Field(default="\r", min_length=1)
    frame_bytes: PositiveInt | None = None
    decimal_comma: bool = False
    negative: tuple[str, ...] = ("-",)
    overload: tuple[str, ...] = OVERLOAD_TOKENS
    overload_status: tuple[str, ...] = ()
    timeout_s: PositiveFloat = 1.0
    pause_s: NonNegativeFloat = 0.05

    def model_post_init(self, _context: object) -> None:
        """Check that the mode has what it needs."""
        if self.mode == "query" and not self.command:
            raise ValueError("mode query needs the key 'command'")
        if self.mode == "frame" and self.frame_bytes is None:
            raise ValueError("mode frame needs the key 'frame_bytes'")


class UnitModel(FileModel):
    """The ``[unit]`` table; without a known unit no reading is taken.

    ``source = "fixed"``: always `name`. ``"query"``: `command` is asked, and `codes`
    turns its answer into a unit. ``"reply"``: the group ``unit`` of the pattern,
    through `codes` if there are any.
    """

    source: Literal["fixed", "query", "reply"]
    name: UnitName | None = None
    command: str = ""
    codes: dict[str, UnitName] = Field(default_factory=dict)

    def model_post_init(self, _context: object) -> None:
        """Check that the source has what it needs."""
        if self.source == "fixed" and self.name is None:
            raise ValueError("source fixed needs the key 'name', such as \"mT\"")
        if self.source == "query" and not self.command:
            raise ValueError("source query needs the key 'command'")


class MultiplierModel(FileModel):
    """The ``[multiplier]`` table: prefix of the value, asked for or in the reply."""

    command: str = ""
    codes: dict[str, PositiveFloat] = Field(default_factory=lambda: dict(_PREFIXES))


class MeterDescription(FileModel):
    """A description of a Tesla-meter."""

    name: str
    notes: str = ""
    line: LineModel = LineModel()
    setup: tuple[str, ...] = ()
    identify: tuple[str, ...] = ()
    read: ReadModel
    unit: UnitModel
    multiplier: MultiplierModel = MultiplierModel()

    def model_post_init(self, _context: object) -> None:
        """Check that the unit can be known."""
        groups = re.compile(self.read.pattern).groupindex
        if self.unit.source == "reply" and "unit" not in groups:
            raise ValueError(
                "unit.source is reply, but read.pattern has no group (?P<unit>...)"
            )


def ready_meters() -> tuple[str, ...]:
    """Return the names of the packaged descriptions."""
    folder = resources.files(__package__) / "descriptions"
    return tuple(
        sorted(
            entry.name.removesuffix(".toml")
            for entry in folder.iterdir()
            if entry.name.endswith(".toml")
        )
    )


def read_description(driver: str, path: Path | None = None) -> MeterDescription:
    """Return the description of a meter.

    Parameters
    ----------
    driver : str
        Name of a packaged description, such as ``lakeshore_425``.
    path : Path, optional
        A description of your own; `driver` is then only its name.

    Raises
    ------
    ConfigError
        If there is no such description, or it is wrong: names file, line and key.
    """
    if path is not None:
        return read_toml(path, MeterDescription)
    if driver not in ready_meters():
        raise ConfigError(
            f"meter.driver must be manual, none, twin, or one of "
            f"{', '.join(ready_meters())}; instead received {driver!r} (a meter of "
            f"your own: write a description and name it in meter.description)"
        )
    entry = resources.files(__package__) / "descriptions" / f"{driver}.toml"
    with resources.as_file(entry) as file:
        return read_toml(file, MeterDescription)
