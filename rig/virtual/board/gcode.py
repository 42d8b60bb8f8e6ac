"""The G-code of the twin board: one line in, what it asks for out, GRBL's errors.

Arcs, probing and tool offsets are refused as unsupported; the rest of GRBL 1.1's words
are checked in its order. Lengths in mm, feeds in mm/min.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace

Triple = tuple[float, float, float]

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)")
_MAX_LINE_NUMBER = 10_000_000
_MM_PER_INCH = 25.4
_AXES = "XYZ"


class GcodeError(Exception):
    """``error:N`` of the firmware."""

    def __init__(self, code: int) -> None:
        super().__init__(f"error:{code}")
        self.code = code


@dataclass(frozen=True, slots=True, kw_only=True)
class Modal:
    """The modes that stay from line to line."""

    motion: str = "G0"
    system: int = 54
    plane: str = "G17"
    units: str = "G21"
    distance: str = "G90"
    feed_mode: str = "G94"
    spindle: str = "M5"
    coolant: str = "M9"
    tool: int = 0
    feed_mm_min: float = 0.0
    spindle_rpm: float = 0.0

    def text(self) -> str:
        """Return the modes as ``$G`` prints them."""
        return (
            f"{self.motion} G{self.system} {self.plane} {self.units} {self.distance} "
            f"{self.feed_mode} {self.spindle} {self.coolant} T{self.tool} "
            f"F{self.feed_mm_min:.0f} S{self.spindle_rpm:.0f}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """What one line asks for, once it was found to be right.

    Attributes
    ----------
    modal : Modal
        Modes after the line (a jog leaves them).
    kind : str
        ``none``, ``move``, ``dwell``, ``G92``, ``G92.1``, ``G10``, ``G28``, ``G30``,
        ``G28.1``, ``G30.1``, ``end``.
    axes : mapping
        Values in mm of the axis words present, by axis number.
    machine, rapid : bool
        G53; G0.
    seconds, offset_row, offset_mode : float and int
        P of G4; P and L of G10.
    """

    modal: Modal
    kind: str = "none"
    axes: dict[int, float] = field(default_factory=dict)
    incremental: bool = False
    machine: bool = False
    rapid: bool = False
    feed_mm_min: float = 0.0
    seconds: float = 0.0
    offset_row: int = 0
    offset_mode: int = 0


_GROUPS = {
    "G0": "motion", "G1": "motion", "G80": "motion",
    "G17": "plane", "G18": "plane", "G19": "plane",
    "G90": "distance", "G91": "distance", "G91.1": "arc",
    "G93": "feed_mode", "G94": "feed_mode", "G20": "units", "G21": "units",
    "G40": "cutter", "G49": "tool_length", "G61": "path",
    "G4": "once", "G53": "once", "G10": "once", "G28": "once", "G30": "once",
    "G28.1": "once", "G30.1": "once", "G92": "once", "G92.1": "once",
    "M0": "stop", "M1": "stop", "M2": "stop", "M30": "stop",
    "M3": "spindle", "M4": "spindle", "M5": "spindle", "M8": "coolant", "M9": "coolant",
} | {f"G{number}": "system" for number in range(54, 60)}  # fmt: skip
_AXIS_COMMANDS = {"G0", "G1", "G10", "G28", "G30", "G28.1", "G30.1", "G92"}
_JOG_GROUPS = {"distance", "units", "once"}


def read_words(line: str) -> tuple[dict[str, str], dict[str, float]]:
    """Split a line into commands by modal group and values by letter.

    Raises
    ------
    GcodeError
        With the code GRBL gives for the first thing that is wrong.
    """
    commands: dict[str, str] = {}
    values: dict[str, float] = {}
    axis_command, place = "", 0
    while place < len(line):
        letter = line[place]
        if not "A" <= letter <= "Z":
            raise GcodeError(1)
        number = _NUMBER.match(line, place + 1)
        if not number:
            raise GcodeError(2)
        place = number.end()
        value = float(number.group())
        if letter not in "GM":
            _take_value(values, letter, value)
            continue
        name = _command(letter, value)
        if name in _AXIS_COMMANDS:
            if axis_command:
                raise GcodeError(24)
            axis_command = name
        if _GROUPS[name] in commands:
            raise GcodeError(21)
        commands[_GROUPS[name]] = name
    return commands, values


def _command(letter: str, value: float) -> str:
    whole = int(value)
    hundredths = round(100.0 * (value - (whole & 255)))
    if letter == "M":
        if hundredths > 0:
            raise GcodeError(23)
        name = f"M{whole & 255}"
    else:
        tenths = round(10.0 * (value - whole))
        name = f"G{whole}.{tenths}" if tenths else f"G{whole}"
    if name not in _GROUPS:
        raise GcodeError(20)
    return name


def _take_value(values: dict[str, float], letter: str, value: float) -> None:
    if letter not in "FIJKLNPRSTXYZ":
        raise GcodeError(20)
    if letter in values:
        raise GcodeError(25)
    if letter in "FNPTS" and value < 0.0:
        raise GcodeError(4)
    if letter == "N" and value > _MAX_LINE_NUMBER:
        raise GcodeError(27)
    values[letter] = value


def read_line(line: str, modal: Modal, *, jog: bool) -> Order:
    """Return what a line (capitals, no spaces, without ``$J=``) asks for.

    Raises
    ------
    GcodeError
        With the code GRBL gives.
    """
    commands, values = read_words(line)
    after = _modes_after(commands, values, modal)
    scale = _MM_PER_INCH if after.units == "G20" else 1.0
    axes = {
        index: values.pop(name) * scale
        for index, name in enumerate(_AXES)
        if name in values
    }
    feed = values.pop("F", 0.0) * scale if "F" in values else modal.feed_mm_min
    if jog:
        return _jog(commands, values, axes, after, modal, line, feed)
    after = replace(after, feed_mm_min=feed)
    order = _order(commands, values, axes, after)
    values.pop("N", None)
    values.pop("S", None)
    values.pop("T", None)
    if values:
        raise GcodeError(36)
    return order


def _modes_after(
    commands: dict[str, str], values: dict[str, float], modal: Modal
) -> Modal:
    known = ("motion", "plane", "units", "distance", "feed_mode", "spindle", "coolant")
    changes: dict[str, object] = {k: commands[k] for k in known if k in commands}
    if "system" in commands:
        changes["system"] = int(commands["system"][1:])
    if "T" in values:
        changes["tool"] = int(values["T"])
    if "S" in values:
        changes["spindle_rpm"] = values["S"]
    return replace(modal, **changes)  # type: ignore[arg-type]


def _jog(
    commands: dict[str, str],
    values: dict[str, float],
    axes: dict[int, float],
    after: Modal,
    modal: Modal,
    line: str,
    feed_mm_min: float,
) -> Order:
    if "F" not in line:
        raise GcodeError(22)
    values.pop("N", None)
    wrong = set(commands) - _JOG_GROUPS or commands.get("once", "G53") != "G53"
    if wrong or values:
        raise GcodeError(16)
    if not axes:
        raise GcodeError(26)
    if feed_mm_min <= 0.0:
        raise GcodeError(22)
    return Order(
        modal=modal,
        kind="move",
        axes=axes,
        incremental=after.distance == "G91",
        machine=commands.get("once") == "G53",
        feed_mm_min=feed_mm_min,
    )


def _order(
    commands: dict[str, str],
    values: dict[str, float],
    axes: dict[int, float],
    after: Modal,
) -> Order:
    once = commands.get("once", "")
    end = commands.get("stop") in ("M2", "M30")
    idle = Order(modal=after, kind="end" if end else "none")
    if once == "G4":
        if "P" not in values:
            raise GcodeError(28)
        return replace(idle, kind="dwell", seconds=values.pop("P"))
    if once == "G10":
        if not axes:
            raise GcodeError(26)
        if "P" not in values or "L" not in values:
            raise GcodeError(28)
        row, mode = int(values.pop("P")), int(values.pop("L"))
        if mode not in (2, 20) or not 0 <= row <= 6:
            raise GcodeError(20)
        return replace(idle, kind="G10", axes=axes, offset_row=row, offset_mode=mode)
    if once == "G92" and not axes:
        raise GcodeError(26)
    if once.startswith(("G92", "G28", "G30")):
        return replace(idle, kind=once, axes=axes)
    if once == "G53" and after.motion not in ("G0", "G1"):
        raise GcodeError(30)
    if after.motion == "G80":
        if axes:
            raise GcodeError(31)
        return idle
    asked = "motion" in commands or axes
    if after.motion == "G1" and asked and after.feed_mm_min <= 0.0:
        raise GcodeError(22)
    if not axes:
        return idle
    return Order(
        modal=after,
        kind="move",
        axes=axes,
        incremental=after.distance == "G91" and once != "G53",
        machine=once == "G53",
        rapid=after.motion == "G0",
        feed_mm_min=after.feed_mm_min,
    )
