"""Stop a stage from another process than the one that drives it.

The process that drives it is asked through its control socket; where none does, a feed
hold is sent to the board.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from ...core.errors import StageError
from ..clock import Clock
from ..control.client import NobodyError, ask
from ..errors import StageTimeoutError
from ..link import Link
from ..ports import resolve_port
from .config import StageConfig
from .grbl.motion import stands
from .grbl.session import GrblSession
from .grbl.stopping import stop_motion
from .stopping import StopProof

_STOP_S = 15.0
_POLL_S = 0.02


class Stoppable(Protocol):
    """A stage that another thread may ask to stop."""

    def request_stop(self) -> None:
        """Ask the thread that moves the stage to hold."""
        ...

    def stop_requested(self) -> bool:
        """Return whether a stop is asked for and not met."""
        ...

    @property
    def last_stop(self) -> StopProof | None:
        """What the last stop has shown."""
        ...


def stopping(stage: Stoppable) -> Callable[[], str]:
    """Return what the owner of a stage does when a caller asks it to stop.

    The request is met by the thread that drives the stage, which looks ten times a
    second; the caller waits until it stands.
    """

    def stop() -> str:
        stage.request_stop()
        deadline_s = time.monotonic() + _STOP_S
        while stage.stop_requested():
            if time.monotonic() > deadline_s:
                raise StageTimeoutError(
                    f"process {os.getpid()} does not react: it is not moving the stage "
                    f"just now; the request stays until its next move"
                )
            time.sleep(_POLL_S)
        proof = stage.last_stop
        how = f": {proof.sentence()}" if proof else ""
        return f"process {os.getpid()} was told and has stopped the stage{how}"

    return stop


def stop_from_outside(rig_file: Path, config: StageConfig, clock: Clock) -> str:
    """Stop a stage from another process than the one that drives it.

    If a process holds the bench, it is asked to hold; else the port is opened and a
    feed hold is sent.

    Returns
    -------
    str
        What happened, in a sentence.

    Raises
    ------
    RigError
        If the owner does not react, or the stage does not answer.
    """
    try:
        answer = ask(rig_file, "stop", port=config.port)
    except NobodyError:
        return _hold_directly(config, resolve_port(config.address), clock)
    return str(answer["text"])


def _hold_directly(config: StageConfig, port: str, clock: Clock) -> str:
    if config.driver != "grbl":
        raise StageError("nobody drives the stage: there is nothing to stop")
    link = Link(port, baud=config.baud, clock=clock, dtr=config.dtr)
    link.open()
    try:
        session = GrblSession(link, clock, answer_timeout_s=config.answer_timeout_s)
        before = session.ask(config.answer_timeout_s)
        if before is not None and stands(before):
            return f"the stage already stands ({before.state}); nothing was sent"
        proof = stop_motion(session, clock, axis="XYZ".index(config.axis))
        if session.report is not None and session.report.state == "hold":
            session.reset()
        return f"the stage was moving and has been stopped: {proof.sentence()}"
    finally:
        link.close()
