"""What GRBL 1.1 says, line by line, as values: no port, no time, no state.

Tolerates grblHAL and FluidNC: unknown fields of a report are skipped, names and
decimals may differ. Sources: gnea/grbl 1.1h, ``doc/markdown/interface.md``; for alarms
above 9 also grblHAL's ``alarms.h`` and FluidNC's; the recorded dialogue of a real board
in ``fixtures/rig``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

SOFT_RESET = b"\x18"
STATUS = b"?"
FEED_HOLD = b"!"
JOG_CANCEL = b"\x85"

Triple = tuple[float, ...]

STOP_INPUTS = {
    "H": "feed hold input",
    "D": "safety door input",
    "R": "reset input",
    "E": "emergency stop input",
}
"""Letters of ``Pn:`` by which somebody at the board asks for a stop."""

ERRORS: dict[int, str] = {
    1: "a letter was expected",
    2: "a number is badly formed",
    3: "the '$' command is not known or not built in",
    4: "a value must not be negative",
    5: "homing is off ($22=0)",
    6: "the step pulse must be at least 3 us",
    7: "the settings memory could not be read; defaults were restored",
    8: "only allowed while the stage is idle",
    9: "locked by an alarm or a jog",
    10: "soft limits need homing ($22=1)",
    11: "the line is too long",
    12: "the step rate is too high",
    13: "the safety door is open",
    14: "the line does not fit the memory",
    15: "the jog leaves the travel",
    16: "a jog must have '=' and only motion words",
    17: "laser mode needs a variable spindle",
    20: "the command is not supported",
    21: "two commands of one modal group",
    22: "no feed rate",
    23: "the command needs a whole number",
    33: "the target is not valid",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmText:
    """Meaning and remedy of an alarm, and whether the position survives it."""

    meaning: str
    remedy: str
    position_kept: bool = False


_HOME = "find the cause, then home (magbend rig home)"
ALARMS: dict[int, AlarmText] = {
    1: AlarmText(
        meaning="a limit switch was hit while moving",
        remedy="clear the switch by hand, then home (magbend rig home)",
    ),
    2: AlarmText(
        meaning="the target lies outside the travel set in $130-$132",
        remedy="the stage did not go there; home (magbend rig home), or unlock",
        position_kept=True,
    ),
    3: AlarmText(meaning="reset while moving", remedy=_HOME),
    4: AlarmText(meaning="the probe was not as expected", remedy=_HOME),
    5: AlarmText(meaning="the probe touched nothing", remedy=_HOME),
    6: AlarmText(meaning="reset while homing", remedy=_HOME),
    7: AlarmText(meaning="the door opened while homing", remedy=_HOME),
    8: AlarmText(
        meaning="the limit switch stayed closed after the pull-off",
        remedy="free the switch, or raise $27, then home (magbend rig home)",
    ),
    9: AlarmText(
        meaning="no limit switch was found within 1.5 x the travel",
        remedy="check switch, cable and $23 (a stock build homes Z, then X and Y: "
        "each needs its switch), then home (magbend rig home)",
    ),
    # From here on each firmware has a meaning of its own: GRBL; grblHAL; FluidNC.
    10: AlarmText(
        meaning="a dual axis did not home; the emergency stop is pressed; the spindle",
        remedy="release the stop, " + _HOME,
    ),
    11: AlarmText(
        meaning="grblHAL wants homing first; FluidNC sees an active input at start",
        remedy="look at switches and buttons, then home (magbend rig home)",
    ),
    12: AlarmText(
        meaning="a limit switch is closed",
        remedy="free the switch by hand, then home (magbend rig home)",
    ),
    13: AlarmText(
        meaning="FluidNC's emergency stop is pressed; grblHAL protects its probe",
        remedy="release the stop, " + _HOME,
    ),
    14: AlarmText(
        meaning="FluidNC wants homing first; grblHAL's spindle", remedy=_HOME
    ),
    15: AlarmText(
        meaning="FluidNC has just started; grblHAL found no second switch of an axis",
        remedy="look at the switches, then home (magbend rig home)",
    ),
    17: AlarmText(
        meaning="grblHAL says that a motor's driver reports a fault",
        remedy="look at motor, driver and their supply, then home (magbend rig home)",
    ),
}


def alarm_text(code: int) -> AlarmText:
    """Return what an alarm number means; unknown numbers lose the position."""
    unknown = AlarmText(meaning="an alarm this version does not know", remedy=_HOME)
    return ALARMS.get(code, unknown)


def error_text(code: str) -> str:
    """Return what ``error:code`` means."""
    known = ERRORS.get(int(code)) if code.isdecimal() else None
    return known or "see the manual of the firmware"


@dataclass(frozen=True, slots=True)
class Ok:
    """The line was taken: for a motion it is *queued*, not done."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """``error:N``: the line was not carried out."""

    code: str


@dataclass(frozen=True, slots=True)
class Alarm:
    """``ALARM:N``, pushed at any time."""

    code: int


@dataclass(frozen=True, slots=True)
class Banner:
    """The firmware has started: power-up, reset by the port, or soft reset."""

    text: str


@dataclass(frozen=True, slots=True)
class Message:
    """``[KIND:text]``."""

    kind: str
    text: str


@dataclass(frozen=True, slots=True)
class Setting:
    """``$name=value``."""

    name: str
    value: str


@dataclass(frozen=True, slots=True)
class Other:
    """A line that means nothing here: a start-up echo, garbage, a torn line."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """Answer to ``?``.

    Attributes
    ----------
    state : str
        In lower case: idle, run, hold, jog, alarm, home, check, door, sleep.
    substate : int or None
        The number after the colon of ``Hold:0``.
    machine, work, offset : tuple of float or None
        MPos, WPos and WCO in the unit of the firmware (mm unless $13=1).
    feed : float
        Present feed.
    buffer : tuple of int or None
        Free planner blocks and free bytes of the receive buffer.
    pins : str
        Letters of active inputs.
    fields : mapping
        Everything else, as it came.
    """

    state: str
    substate: int | None = None
    machine: Triple | None = None
    work: Triple | None = None
    offset: Triple | None = None
    feed: float = 0.0
    buffer: tuple[int, int] | None = None
    pins: str = ""
    fields: Mapping[str, str] = field(default_factory=dict)
    raw: str = ""


Line = Ok | Refusal | Alarm | Banner | Message | Setting | Report | Other

_STATES = {
    "idle", "run", "hold", "jog", "alarm", "home", "check", "door", "sleep",
}  # fmt: skip
_BANNER = re.compile(r"^(Grbl\s+\S+\s.*\[|.*\['\$'.*help\]\s*$)", re.IGNORECASE)
_SETTING = re.compile(r"^\$([A-Za-z0-9/_\-]+)=(.*?)(?:\s+\(.*\))?$")  # comment
_MESSAGE = re.compile(r"^\[([A-Z0-9 +]+):(.*)\]$")


def parse_line(text: str) -> Line:
    """Return what one line of the board means; never raises.

    Parameters
    ----------
    text : str
        The line without its end.
    """
    line = text.strip()
    if line == "ok":
        return Ok()
    if line.startswith("error:"):
        return Refusal(line[6:].strip())
    if line.startswith("ALARM:"):
        digits = line[6:].strip()
        return Alarm(int(digits)) if digits.isdecimal() else Other(line)
    if line.startswith("<"):
        return parse_report(line) or Other(line)
    if _BANNER.match(line):
        return Banner(line)
    setting = _SETTING.match(line)
    if setting:
        return Setting(setting.group(1), setting.group(2).strip())
    message = _MESSAGE.match(line)
    if message:
        return Message(message.group(1), message.group(2))
    return Other(line)


def parse_report(line: str) -> Report | None:
    """Return the report, or None if the line is torn or is none."""
    if not (line.startswith("<") and line.endswith(">")) or "<" in line[1:]:
        return None
    head, *rest = line[1:-1].split("|")
    name, _, sub = head.partition(":")
    state = name.lower()
    if state not in _STATES or (sub and not sub.isdecimal()):
        return None
    fields: dict[str, str] = {}
    for part in rest:
        key, colon, value = part.partition(":")
        if colon:
            fields[key] = value
    machine, work = _triple(fields.get("MPos")), _triple(fields.get("WPos"))
    if machine is None and work is None:
        return None
    return Report(
        state=state,
        substate=int(sub) if sub else None,
        machine=machine,
        work=work,
        offset=_triple(fields.get("WCO")),
        feed=(_triple(fields.get("FS") or fields.get("F")) or (0.0,))[0],
        buffer=_pair(fields.get("Bf")),
        pins=fields.get("Pn", ""),
        fields=fields,
        raw=line,
    )


def _triple(text: str | None) -> Triple | None:
    if not text:
        return None
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        return None
    return numbers if all(math.isfinite(number) for number in numbers) else None


def _pair(text: str | None) -> tuple[int, int] | None:
    numbers = _triple(text)
    if numbers is None or len(numbers) != 2:
        return None
    return int(numbers[0]), int(numbers[1])


def machine_position(report: Report, offset: Triple | None) -> Triple | None:
    """Return MPos, from WPos and the last known offset if the board reports WPos.

    ``WPos = MPos - WCO``; None while the offset is not known.
    """
    if report.machine is not None:
        return report.machine
    known = report.offset or offset
    if report.work is None or known is None or len(known) != len(report.work):
        return None
    return tuple(w + o for w, o in zip(report.work, known, strict=True))


def jog_line(axis: str, machine_mm: float, feed_mm_min: float) -> str:
    """Return an absolute jog in machine coordinates.

    A jog is refused as a whole when it leaves the travel (``error:15``, no alarm),
    changes no modal state and is forgotten by a feed hold: the safest of the motions.
    """
    return f"$J=G21G90G53{axis}{machine_mm:.3f}F{feed_mm_min:.1f}"
