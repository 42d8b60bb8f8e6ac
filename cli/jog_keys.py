"""Jogging by keys in a plain terminal."""

from __future__ import annotations

import contextlib
import queue
import sys
import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import typer

from ..core.errors import RigError

if TYPE_CHECKING:
    from ..rig.gap_stage import GapStage

STEPS_MM = {"1": 0.1, "2": 0.5, "3": 1.0, "4": 5.0, "5": 10.0}
FARTHER = {"up", "right", "+", "k"}
NEARER = {"down", "left", "-", "j"}
_HELP = (
    "up/right farther, down/left nearer, 1-5 step 0.1 0.5 1 5 10 mm, H home, "
    "space stop, q quit"
)
_ESCAPES = {"[A": "up", "[B": "down", "[C": "right", "[D": "left"}


def jog_loop(stage: GapStage) -> None:
    """Read keys and move until ``q``.

    Raises
    ------
    RigError
        If there is no terminal to read keys from.
    """
    if not sys.stdin.isatty():
        raise RigError(
            "jogging needs a terminal with keys; in a script use magbend rig goto GAP"
        )
    typer.echo(_HELP)
    with _keys() as keys:
        step_mm = 1.0
        while True:
            _show(stage, step_mm)
            try:
                key = keys.get(timeout=0.5)
            except queue.Empty:
                continue
            if key in ("q", "\x03"):
                typer.echo("")
                return
            step_mm = STEPS_MM.get(key, step_mm)
            _act(stage, key, step_mm, keys)


def _act(stage: GapStage, key: str, step_mm: float, keys: queue.Queue[str]) -> None:
    try:
        if key == "H":
            stage.home()
        elif key in FARTHER | NEARER:
            here_mm = stage.status().gap_mm
            if here_mm is None:
                raise RigError("the gap is not known; press H to home the stage")
            sign = 1.0 if key in FARTHER else -1.0
            with _space_stops(stage, keys):
                stage.goto_gap(here_mm + sign * step_mm, moved=_live(step_mm))
    except KeyboardInterrupt:
        typer.echo(f"\rstopped; the position is {stage.position_state}" + " " * 20)
    except RigError as error:
        typer.echo(f"\r{error}" + " " * 10)


@contextlib.contextmanager
def _space_stops(stage: GapStage, keys: queue.Queue[str]) -> Iterator[None]:
    """While the stage moves, a space bar (or q) asks it to stop."""
    done = threading.Event()

    def watch() -> None:
        while not done.is_set():
            with contextlib.suppress(queue.Empty):
                if keys.get(timeout=0.05) in (" ", "q", "\x03"):
                    stage.request_stop()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        watcher.join()


def _show(stage: GapStage, step_mm: float) -> None:
    status = stage.status()
    where = "unknown" if status.gap_mm is None else f"{status.gap_mm:8.3f} mm"
    typer.echo(
        f"\rgap {where}  {status.state} {status.position_state}  "
        f"step {step_mm:g} mm   ",
        nl=False,
    )


def _live(step_mm: float) -> Callable[[float], None]:
    def show(gap_mm: float) -> None:
        typer.echo(f"\rgap {gap_mm:8.3f} mm  moving  step {step_mm:g} mm   ", nl=False)

    return show


@contextlib.contextmanager
def _keys() -> Iterator[queue.Queue[str]]:
    """Yield a queue of key names, read by a thread from the terminal."""
    keys: queue.Queue[str] = queue.Queue()
    ended = threading.Event()
    if sys.platform == "win32":
        reader = threading.Thread(target=_read_windows, args=(keys, ended), daemon=True)
        reader.start()
        try:
            yield keys
        finally:
            ended.set()
            reader.join()
        return
    import termios
    import tty

    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    tty.setcbreak(descriptor)
    reader = threading.Thread(target=_read_posix, args=(keys, ended), daemon=True)
    reader.start()
    try:
        yield keys
    finally:
        ended.set()
        reader.join()
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def _read_posix(keys: queue.Queue[str], ended: threading.Event) -> None:
    import os
    import select

    descriptor = sys.stdin.fileno()
    while not ended.is_set():
        if not select.select([descriptor], [], [], 0.05)[0]:
            continue
        text = os.read(descriptor, 16).decode("utf-8", "replace")
        if not text:
            keys.put("q")
            return
        while text:
            if text[0] == "\x1b" and text[1:3] in _ESCAPES:
                keys.put(_ESCAPES[text[1:3]])
                text = text[3:]
            else:
                keys.put(text[0])
                text = text[1:]


def _read_windows(keys: queue.Queue[str], ended: threading.Event) -> None:
    import msvcrt  # type: ignore[import-not-found,unused-ignore]
    import time

    arrows = {"H": "up", "P": "down", "M": "right", "K": "left"}
    while not ended.is_set():
        if not msvcrt.kbhit():  # type: ignore[attr-defined,unused-ignore]
            time.sleep(0.02)
            continue
        key = msvcrt.getwch()  # type: ignore[attr-defined,unused-ignore]
        if key in ("\x00", "\xe0"):
            key = arrows.get(msvcrt.getwch(), "")  # type: ignore[attr-defined,unused-ignore]
        keys.put(key)
