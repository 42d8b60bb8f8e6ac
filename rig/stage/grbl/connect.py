"""Find out who answers on an open link, and in which state, without moving anything."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass

from ....core.errors import StageError
from ...clock import Clock
from ...errors import StageTimeoutError
from ..config import StageConfig
from .audit import is_fluidnc, number
from .mark import read_mark
from .protocol import Message, Report, Setting
from .ready import refuse_open_door
from .session import CommandRefusedError, GrblSession
from .stopping import stop_motion

_RESET_TRIES = 3
_MOVING_STATES = ("run", "jog")


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundBoard:
    """What a board said when it was connected.

    Attributes
    ----------
    banner : str
        The start-up line, or the version if none was seen.
    details : tuple of str
        Answers to ``$I``, ``$G`` and ``$#``, as ``KIND:text``.
    settings : mapping
        ``$$``: number without the dollar sign to value as text.
    undisturbed : bool
        The board had been standing idle and did not restart on opening: if it was
        homed before, it still is.
    mark : float or None
        What it was marked with when it was left (see `mark`); None if it was not.
    told_mm : tuple of float or None
        The travel of the axis, if the firmware tells it by itself.
    """

    banner: str
    details: tuple[str, ...]
    settings: Mapping[str, str]
    undisturbed: bool
    mark: float | None = None
    told_mm: tuple[float, float] | None = None


def connect_board(
    session: GrblSession, clock: Clock, config: StageConfig
) -> FoundBoard:
    """Wait for the board, bring it to a stand and in step, and question it.

    Raises
    ------
    StageError
        If nobody answers as GRBL does, or what answers cannot be questioned.
    """
    report = _first_report(session, clock, config)
    undisturbed = session.restarts == 0 and report is not None
    undisturbed = undisturbed and report is not None and report.state == "idle"
    if report is not None and _moving(report):
        axis = "XYZ".index(config.axis)
        stop_motion(session, clock, axis=axis)  # an earlier program left it moving
        report = session.report
    mark = read_mark(session) if undisturbed else None  # a reset clears it
    if config.reset_on_connect or report is None or report.state != "idle":
        _reset(session, config)
    refuse_open_door(session)
    restarts = session.restarts
    details = _ask_details(session)
    settings = _ask_settings(session, config)
    report = session.ask_place(config.answer_timeout_s)
    if session.restarts != restarts:
        raise StageError("the board restarts again and again; look at its power supply")
    if report is None:
        raise StageError(
            f"the board ({session.banner or 'no banner'}) answers, but sends no status "
            "report as GRBL 1.1 does; older versions cannot jog ($J=): update it"
        )
    told = config.homing == "switches" and config.homed_at_mm is None
    version = next((d for d in details if d.startswith("VER:")), "unknown firmware")
    return FoundBoard(
        banner=session.banner or version,
        details=details,
        settings=settings,
        undisturbed=undisturbed,
        mark=mark,
        told_mm=_told_mm(session, details, settings, config.axis) if told else None,
    )


def _told_mm(
    session: GrblSession,
    details: tuple[str, ...],
    settings: Mapping[str, str],
    axis: str,
) -> tuple[float, float] | None:
    """Return the travel that the firmware tells: FluidNC alone does, in two ways."""
    if axis in session.ranges or not is_fluidnc(details):
        return session.ranges.get(axis)
    travel = number(settings, f"{130 + 'XYZ'.index(axis)}")
    name = f"/axes/{axis.lower()}/homing/mpos_mm"
    try:
        lines = session.command(f"${name}")
    except CommandRefusedError:
        return None
    told = {s.name: s.value for s in lines if isinstance(s, Setting)}
    homed = number(told, name)
    if homed is None or travel is None:
        return None
    downward = int(number(settings, "23") or 0) >> "XYZ".index(axis) & 1
    return (homed, homed + travel) if downward else (homed - travel, homed)


def _first_report(
    session: GrblSession, clock: Clock, config: StageConfig
) -> Report | None:
    """Ask until the board answers: it may be booting, homing or deaf."""
    deadline_s = clock.monotonic_s() + config.boot_s
    while True:
        report = session.ask(0.5)
        if report is not None:
            return report
        if session.alarm is not None or clock.monotonic_s() >= deadline_s:
            return None


def _moving(report: Report) -> bool:
    # Home is not among them: a running cycle answers nothing, and a board that is
    # stuck in Home needs a reset; a feed hold would hide that its position is lost.
    return report.state in _MOVING_STATES or (
        report.state == "hold" and report.substate != 0
    )


def _reset(session: GrblSession, config: StageConfig) -> None:
    if not session.reset(tries=_RESET_TRIES):
        raise StageTimeoutError(
            "nobody answers as GRBL does: look at the cable, the power, the port and "
            f"stage.baud (now {config.baud})"
        )


def _ask_settings(session: GrblSession, config: StageConfig) -> dict[str, str]:
    """Return ``$$``, and ``$13``, which FluidNC keeps as a command of its own."""
    lines = session.command("$$", timeout_s=3.0 * config.answer_timeout_s)
    if not any(isinstance(line, Setting) for line in lines):
        raise StageError("the board answers, but reports no settings to $$")
    if not any(isinstance(line, Setting) and line.name == "13" for line in lines):
        with contextlib.suppress(CommandRefusedError):  # it reports in mm alone
            lines += session.command("$13")
    return {line.name: line.value for line in lines if isinstance(line, Setting)}


def _ask_details(session: GrblSession) -> tuple[str, ...]:
    found: list[str] = []
    for query in ("$I", "$G", "$#"):
        try:
            lines = session.command(query)
        except CommandRefusedError:
            continue  # a dialect that lacks it is still a stage
        found += [f"{m.kind}:{m.text}" for m in lines if isinstance(m, Message)]
    return tuple(found)
