"""``magbend rig set-gap``: measure the map from the board's count to the gap."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from ..core.checks import finite
from ..core.errors import InputError
from .console import say
from .keys import answering
from .rig_ask import RIG, PortOption, RigOption, stage_table
from .rig_stage import LogOption, connected, facts, line

if TYPE_CHECKING:
    from ..rig import GapStage

EXAMPLE = "Example: magbend rig set-gap 70.2 --rig rig.toml"
_TEST_MM = 1.0
_TAKE_UP_MM = 0.5


def register(app: typer.Typer) -> None:
    """Add the command of this module to the group ``rig``."""
    app.command("set-gap", epilog=EXAMPLE)(set_gap)


def set_gap(
    gap_mm: Annotated[float, typer.Argument(help="The measured gap, in mm.")],
    rig: RigOption = RIG,
    port: PortOption = None,
    direction: Annotated[
        int | None,
        typer.Option(
            help="1: you saw the gap grow with the machine's count; -1: shrink. "
            "Leaves the test out."
        ),
    ] = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="Do not ask if it changes the map by > 5 mm.")
    ] = False,
    log: LogOption = None,
) -> None:
    """Tell the measured gap at which the stage stands.

    The first time the stage moves by 1 mm and back, and you say which way it went.
    Zero, direction and the settings of the board are written to the rig file; from then
    on they are compared at every connection. A gap more than 5 mm from what the map
    says is taken only if you confirm it, or with --yes.
    """
    from ..rig import keep_measured_gap, read_rig

    if direction not in (None, 1, -1):
        raise InputError(f"--direction must be 1 or -1; instead received {direction}")
    before = stage_table(rig, port)
    never = before.gap_at_zero_mm is None
    may_ask = sys.stdin.isatty()
    if direction is None and never and not may_ask:
        raise InputError(
            "the direction was never tested on this bench: run set-gap in a terminal, "
            "where it moves the stage by 1 mm and asks, or say --direction 1 (the gap "
            "grows with the machine's count) or --direction -1 (it shrinks)"
        )
    with connected("set-gap", rig, port, log) as stage:
        is_tested = direction is not None
        sign = _sign(before.direction if direction is None else direction)
        if direction is None and may_ask and not _was_tested(before):
            _require_room(gap_mm, read_rig(rig).limits.min_gap_mm)
            sign, gap_mm = _test_direction(stage, gap_mm)
            is_tested = True
        _confirm(stage, gap_mm, yes)
        zero_mm = stage.assume_gap(gap_mm, direction=sign)
        tested = is_tested or _was_tested(before)
        keep_measured_gap(rig, stage, gap_mm, direction_tested=tested)
        say(f"{rig}: gap_at_zero_mm = {zero_mm:.3f}, direction = {sign}")
        if not tested:
            say("note: the direction was never tested; run it in a terminal")
        say(line(facts(stage)))


def _confirm(stage: GapStage, gap_mm: float, yes: bool) -> None:
    """Refuse a gap far from the map's, unless somebody means it."""
    from ..rig import InterlockError, why_doubt_gap

    finite(gap_mm, "gap_mm", "mm")
    doubt = why_doubt_gap(stage, gap_mm)
    if not doubt:
        return
    if yes:
        say(f"note: {doubt}", err=True)
        return
    if sys.stdin.isatty():
        with answering():
            if typer.confirm(f"{doubt}. Is {gap_mm:g} mm right?", err=True):
                return
    raise InterlockError(
        f"{doubt}: gauge it again, or confirm it with --yes; nothing was changed"
    )


def _was_tested(table: Any) -> bool:
    return table.measured is not None and table.measured.direction_tested


def _sign(number: float) -> Literal[1, -1]:
    return 1 if number > 0 else -1


def _require_room(gap_mm: float, min_gap_mm: float) -> None:
    if gap_mm - _TEST_MM < min_gap_mm:
        raise InputError(
            f"the direction is tested by moving 1 mm, and {gap_mm:g} mm leaves no room "
            f"before min_gap_mm = {min_gap_mm:g} mm: jog farther away first"
        )


def _test_direction(stage: GapStage, gap_mm: float) -> tuple[Literal[1, -1], float]:
    """Move by 1 mm and back; return which way it went, and the gap gauged after."""
    from ..rig import InterlockError

    with answering():
        say(
            "The stage now moves by 1 mm, slowly, and back: see which way it goes.",
            err=True,
        )
        typer.prompt("Enter: go on", default="", show_default=False, err=True)
        way_mm = _test_way_mm(stage)
        stage.nudge(way_mm)
        answer = ""
        while answer not in ("f", "n"):
            answer = typer.prompt(
                "Is the rod now farther from the magnet (f) or nearer (n)?", err=True
            ).strip()[:1].lower()  # fmt: skip
        stage.nudge(-way_mm)
        play = "with the play taken up"
        if answer == "n":  # end with a motion toward the magnet, as every approach does
            try:
                stage.nudge(-_TAKE_UP_MM * way_mm)
                stage.nudge(_TAKE_UP_MM * way_mm)
            except InterlockError:
                play = "at the end of its travel, so that the play was not taken up"
        again = typer.prompt(
            f"It is back, {play}. Gauge the gap again, in mm",
            default=gap_mm, type=float, err=True,
        )  # fmt: skip
    return _sign(way_mm if answer == "f" else -way_mm), float(again)


def _test_way_mm(stage: GapStage) -> float:
    """Return which way there is room for the test: up, unless the travel ends there."""
    travel, here_mm = stage.limits.travel_mm, stage.status().stage_mm
    if travel is None or here_mm is None or here_mm + _TEST_MM <= travel[1]:
        return _TEST_MM
    return -_TEST_MM
