"""The conversation with a Marlin board: one line, one ``ok``, keep-alives between.

Read in MarlinFirmware's own sources, not run on hardware: ``ok`` ends every line, even
one that is refused; ``echo:busy: processing``: a long one still runs; ``start``: the
board restarted. Replies carry no number: after one that did not come, a line with a
text of its own (``M118``, echoed even by a board that does not know it) says where they
stand.
"""

from __future__ import annotations

import contextlib
import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ....core.errors import StageError
from ...clock import Clock
from ...errors import PositionLostError, StageTimeoutError
from ...link import Link

_SLICE_S = 0.1
_PATIENCE = 10.0
_NUMBER = r"(-?\d{1,12}(?:\.\d{1,12})?)(?!\d)"


def nothing() -> None:
    """Check nothing while waiting."""


class LineRefusedError(StageError):
    """The board does not know the line, or will not carry it out."""


class MarlinSession:
    """Talk to one board over an open link.

    Attributes
    ----------
    restarts : int
        How often the board said ``start``.
    halted : bool
        Whether it stopped itself (``kill()``); only a restart helps.
    place_mm : float or None
        The last reported place of the stage's axis, in mm.
    planned_mm : float or None
        Where the axis goes in the coordinates that lines are given in, in mm.
    """

    def __init__(self, link: Link, clock: Clock, *, answer_timeout_s: float) -> None:
        self._link = link
        self._clock = clock
        self._answer_timeout_s = answer_timeout_s
        self._in_step = True
        self._marks = itertools.count(1)
        self.restarts = 0
        self.halted = False
        self.place_mm: float | None = None
        self.planned_mm: float | None = None

    def machine(self) -> tuple[float, ...] | None:
        """Return the last reported place of the axis, in mm."""
        return None if self.place_mm is None else (self.place_mm,)

    def drain(self) -> None:
        """Read what is already here."""
        for line in self._link.waiting_lines():
            self._note(line)

    def listen(self, quiet_s: float, most_s: float) -> None:
        """Note lines until it is quiet for `quiet_s`; boards that never are: `most_s`.

        An idle Marlin may say ``wait`` every second, or report temperatures unasked.
        """
        end_s = self._clock.monotonic_s() + most_s
        while (left_s := end_s - self._clock.monotonic_s()) > 0.0:
            line = self._link.read_line(min(quiet_s, left_s))
            if line is None or line == "wait":
                return
            self._note(line)

    def command(
        self,
        line: str,
        *,
        timeout_s: float | None = None,
        check: Callable[[], None] = nothing,
    ) -> list[str]:
        """Send one line and return what came before its ``ok``.

        Parameters
        ----------
        timeout_s : float, optional
            How long a motion may take. Without it the line is a question, and a board
            that says ``busy`` is given time anew.

        Raises
        ------
        PositionLostError
            The board restarted or was halted.
        LineRefusedError
            It refused the line.
        StageTimeoutError
            It did not answer.
        """
        self.drain()
        if self.halted:
            raise PositionLostError(
                "the board was halted; restart it (reset button or power), then home "
                "it (magbend rig home)"
            )
        limit_s = self._answer_timeout_s if timeout_s is None else timeout_s
        patience = _PATIENCE if timeout_s is None else 1.0
        if not self._in_step:
            mark = f"magbend {next(self._marks)}"
            self._exchange(f"M118 {mark}", limit_s, patience, check, mark)
        lines = self._exchange(line, limit_s, patience, check)
        refused = [t for t in lines if t.startswith("Error:") or "Unknown command" in t]
        if refused:
            raise LineRefusedError(f"the stage refused {line!r}: {refused[0]}")
        return lines

    def interrupt(self, line: str) -> None:
        """Send a line while another runs, and wait for nothing."""
        self._in_step = False
        self._link.write_realtime(line.encode("ascii") + b"\n")

    def ask_place(self, axis: str, step_mm: float) -> float | None:
        """Ask where the axis is (``M114``), in mm."""
        self.place_mm = None
        lines = self.command("M114")
        self.place_mm = read_position(lines, axis, 1.0 / step_mm)
        self.planned_mm = read_planned(lines, axis)
        return self.place_mm

    def make_ready(self) -> None:
        """Let coordinates be absolute and in mm, and motors hold the stage at rest.

        An earlier program, or a restart, may have left them otherwise: by default a
        Marlin switches its motors off after two minutes, and keeps its count.

        Raises
        ------
        LineRefusedError
            If the board knows no absolute coordinates.
        """
        for line in ("G21", "M84 S0"):
            with contextlib.suppress(LineRefusedError):  # a build that knows no other
                self.command(line)
        self.command("G90")

    def _exchange(
        self,
        line: str,
        limit_s: float,
        patience: float,
        check: Callable[[], None],
        mark: str = "",
    ) -> list[str]:
        """Send a line; return what came before its ``ok``, known by `mark`."""
        restarts, lines = self.restarts, list[str]()
        self._in_step = False  # until the reply is here
        self._link.write(line.encode("ascii") + b"\n")
        late_s = self._clock.monotonic_s() + limit_s
        end_s = late_s + (patience - 1.0) * limit_s
        while self._clock.monotonic_s() < late_s:
            answer = self._link.read_line(_SLICE_S)
            if answer is None:
                check()
                continue
            self._note(answer)
            if self.restarts != restarts or self.halted:
                raise PositionLostError(
                    f"the board restarted or was halted ({answer}); home it "
                    "(magbend rig home)"
                )
            if "busy: processing" in answer:
                late_s = min(max(late_s, self._clock.monotonic_s() + limit_s), end_s)
            elif answer != "ok" and not answer.startswith("ok "):
                lines.append(answer)
            elif mark in " ".join(lines):
                self._in_step = True
                # Some put the reply behind the ``ok``, others free buffer places.
                return [*lines, answer[3:]] if answer[3:] else lines
        raise StageTimeoutError(
            f"the stage did not finish {line!r} within {limit_s:.0f} s"
        )

    def _note(self, line: str) -> None:
        if line.endswith("start"):  # a restart may cut a line short before it
            self.restarts += 1
            self.halted = False
        elif "kill() called" in line or "Printer halted" in line:
            self.halted = True


@dataclass(frozen=True, slots=True, kw_only=True)
class MarlinSetup:
    """Steps/mm, ceilings and travel of one axis, in mm and s."""

    steps_per_mm: float
    max_feed_mm_s: float
    acceleration_mm_s2: float
    travel_mm: tuple[float, float] | None


def read_setup(lines: Sequence[str], axis: str) -> MarlinSetup:
    """Read the answers to ``M503`` and ``M211``.

    Raises
    ------
    StageError
        If a value is missing or not above zero: the sentence names the code.
    """
    values = {}
    for code, meaning in (
        ("M92", "steps/mm"), ("M203", "max. feed in mm/s"),
        ("M201", "max. acceleration in mm/s2"),
    ):  # fmt: skip
        pattern = re.compile(rf"\b{code}\b.*?\b{axis}{_NUMBER}")
        found = next((m for line in lines if (m := pattern.search(line))), None)
        if found is None or float(found.group(1)) <= 0.0:
            raise StageError(
                f"the board does not report {code} {axis} ({meaning}) above zero; "
                f"set it with {code} {axis}... and save it with M500"
            )
        values[code] = float(found.group(1))
    return MarlinSetup(
        steps_per_mm=values["M92"],
        max_feed_mm_s=values["M203"],
        acceleration_mm_s2=values["M201"],
        travel_mm=_travel(lines, axis),
    )


def _travel(lines: Sequence[str], axis: str) -> tuple[float, float] | None:
    pattern = re.compile(
        rf"Min:.*?\b{axis}\s*{_NUMBER}.*?Max:.*?\b{axis}\s*{_NUMBER}", re.DOTALL
    )
    found = pattern.search("\n".join(lines))
    return (float(found.group(1)), float(found.group(2))) if found else None


def read_position(lines: Sequence[str], axis: str, steps_per_mm: float) -> float | None:
    """Read ``M114`` in mm: the counted steps where given, else the planned place."""
    text = " ".join(lines)
    counted = re.search(rf"Count.*?\b{axis}:\s*{_NUMBER}", text)
    if counted:
        return float(counted.group(1)) / steps_per_mm
    return read_planned(lines, axis)


def read_planned(lines: Sequence[str], axis: str) -> float | None:
    """Read the planned place of ``M114`` in mm: offsets of ``G92`` are in it."""
    planned = re.search(rf"\b{axis}:\s*{_NUMBER}", " ".join(lines))
    return float(planned.group(1)) if planned else None
