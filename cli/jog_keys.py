"""Jogging by keys in a plain terminal."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING

import typer

from ..core.errors import RigError
from .console import say
from .keyboard import END, Keyboard, has_keys

if TYPE_CHECKING:
    from ..rig import GapStage

STEPS_MM = {"1": 0.1, "2": 0.5, "3": 1.0, "4": 5.0, "5": 10.0}
FARTHER = {"up", "right", "+", "k"}
NEARER = {"down", "left", "-", "j"}
QUIT = {"q", "\x03", END}
_HELP = """\
up, right: farther   down, left: nearer   1 to 5: steps of 0.1, 0.5, 1, 5, 10 mm
H: home   space: stop   q: quit"""
_WIDTH = 66
NUDGE_MM = 1.0


def jog_loop(stage: GapStage) -> None:
    """Read keys and move until ``q``.

    A stage that does not know where it is, or whose gap was never measured, goes by
    1 mm at most, slowly.

    Raises
    ------
    RigError
        If there is no terminal to read keys from, or the link to the stage is lost.
    """
    if not has_keys():
        raise RigError(
            "jogging needs a terminal with keys; in a script use magbend rig goto GAP"
        )
    say(_HELP)
    step_mm = 1.0
    try:
        with Keyboard() as keyboard:
            while True:
                _show_status(stage, step_mm)
                if stage.stop_requested():
                    stage.hold()  # another terminal asked, and nothing moves
                key = keyboard.key(0.5)
                if key in QUIT:
                    return
                step_mm = STEPS_MM.get(key, step_mm)
                _act(stage, key, step_mm, keyboard)
    except KeyboardInterrupt:
        return  # nothing moves while the loop waits for a key
    finally:
        say("")


def _act(stage: GapStage, key: str, step_mm: float, keyboard: Keyboard) -> None:
    try:
        if key == "H":
            _show("homing; space stops it")
            with _space_stops(stage, keyboard):
                stage.home()
        elif key in FARTHER | NEARER:
            way_mm = step_mm if key in FARTHER else -step_mm
            with _space_stops(stage, keyboard):
                _go(stage, way_mm)
    except KeyboardInterrupt:
        _show(f"stopped; the position is {stage.position_state}\n")
    except RigError as error:
        _show(f"{error}\n")


def _go(stage: GapStage, way_mm: float) -> None:
    """Go farther (positive) or nearer, as the rig file understands that."""
    status = stage.status()
    if status.gap_mm is not None and not status.doubt:
        stage.goto_gap(
            status.gap_mm + way_mm,
            moved=lambda gap_mm: _show(
                f"gap {gap_mm:8.3f} mm  moving  step {abs(way_mm):g} mm"
            ),
        )
        return
    if status.state == "alarm":
        raise RigError("the stage is locked: press H to home it (or: rig unlock)")
    limited_mm = max(-NUDGE_MM, min(NUDGE_MM, way_mm))
    _show(f"slowly, {abs(limited_mm):g} mm: the place is not known, watch the rod")
    stage.nudge(stage.place_map.direction * limited_mm)


@contextlib.contextmanager
def _space_stops(stage: GapStage, keyboard: Keyboard) -> Iterator[None]:
    """While the stage moves, a space bar (or q, or Ctrl-C) asks it to stop."""
    from ..rig import heed_interrupts

    done = threading.Event()

    def watch() -> None:
        while not done.is_set():
            if keyboard.key(0.05) in QUIT | {" "}:
                stage.request_stop()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        with heed_interrupts(stage.request_stop) as received, received.striking():
            yield
    finally:
        done.set()
        watcher.join()


def _show_status(stage: GapStage, step_mm: float) -> None:
    status = stage.status()
    where = "unknown" if status.gap_mm is None else f"{status.gap_mm:8.3f} mm"
    if status.gap_mm is None and status.stage_mm is not None:
        where = f"unknown (machine {status.stage_mm:.3f} mm)"
    _show(f"gap {where}  {status.state} {status.position_state}  step {step_mm:g} mm")


def _show(text: str) -> None:
    """Write over the present line."""
    line, end, _ = text.partition("\n")
    typer.echo(f"\r{line:<{_WIDTH}}{end}", nl=False)
