"""Jogging by keys in a plain terminal."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING

import typer

from ..core.errors import RigError
from .keyboard import END, Keyboard, has_keys

if TYPE_CHECKING:
    from ..rig.stage.gap import GapStage

STEPS_MM = {"1": 0.1, "2": 0.5, "3": 1.0, "4": 5.0, "5": 10.0}
FARTHER = {"up", "right", "+", "k"}
NEARER = {"down", "left", "-", "j"}
QUIT = {"q", "\x03", END}
_HELP = """\
up, right: farther   down, left: nearer   1 to 5: steps of 0.1, 0.5, 1, 5, 10 mm
H: home   space: stop   q: quit"""
_WIDTH = 60


def jog_loop(stage: GapStage) -> None:
    """Read keys and move until ``q``.

    Raises
    ------
    RigError
        If there is no terminal to read keys from, or the link to the stage is lost.
    """
    if not has_keys():
        raise RigError(
            "jogging needs a terminal with keys; in a script use magbend rig goto GAP"
        )
    typer.echo(_HELP)
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
        typer.echo("")


def _act(stage: GapStage, key: str, step_mm: float, keyboard: Keyboard) -> None:
    try:
        if key == "H":
            _show("homing; space stops it")
            with _space_stops(stage, keyboard):
                stage.home()
        elif key in FARTHER | NEARER:
            here_mm = stage.status().gap_mm
            if here_mm is None:
                raise RigError("the gap is not known; press H to home the stage")
            sign = 1.0 if key in FARTHER else -1.0
            with _space_stops(stage, keyboard):
                stage.goto_gap(
                    here_mm + sign * step_mm,
                    moved=lambda gap_mm: _show(
                        f"gap {gap_mm:8.3f} mm  moving  step {step_mm:g} mm"
                    ),
                )
    except KeyboardInterrupt:
        _show(f"stopped; the position is {stage.position_state}\n")
    except RigError as error:
        _show(f"{error}\n")


@contextlib.contextmanager
def _space_stops(stage: GapStage, keyboard: Keyboard) -> Iterator[None]:
    """While the stage moves, a space bar (or q, or Ctrl-C) asks it to stop."""
    from ..rig.interrupts import interrupts

    done = threading.Event()

    def watch() -> None:
        while not done.is_set():
            if keyboard.key(0.05) in QUIT | {" "}:
                stage.request_stop()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        with interrupts(stage.request_stop) as received, received.striking():
            yield
    finally:
        done.set()
        watcher.join()


def _show_status(stage: GapStage, step_mm: float) -> None:
    status = stage.status()
    where = "unknown" if status.gap_mm is None else f"{status.gap_mm:8.3f} mm"
    _show(f"gap {where}  {status.state} {status.position_state}  step {step_mm:g} mm")


def _show(text: str) -> None:
    """Write over the present line."""
    line, end, _ = text.partition("\n")
    typer.echo(f"\r{line:<{_WIDTH}}{end}", nl=False)
