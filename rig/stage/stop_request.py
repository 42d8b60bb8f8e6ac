"""Stop a stage from another process than the one that drives it."""

from __future__ import annotations

from ...core.errors import StageError
from ..clock import Clock
from ..errors import StageTimeoutError
from ..link import Link
from ..ports import resolve_port
from .config import StageConfig
from .grbl.motion import await_stand, stands
from .grbl.protocol import FEED_HOLD
from .grbl.session import GrblSession
from .presence import Presence

_STOP_S = 15.0


def stop_from_outside(config: StageConfig, clock: Clock) -> str:
    """Stop a stage from another process than the one that drives it.

    If a process holds the port, it is asked to hold (it looks ten times a second);
    else the port is opened and a feed hold is sent.

    Returns
    -------
    str
        What happened, in a sentence.

    Raises
    ------
    StageError
        If the owner does not react, or the stage does not answer.
    """
    port = resolve_port(config.port)
    presence = Presence(port)
    owner = presence.owner()
    if owner is None:
        return _hold_directly(config, port, clock)
    presence.ask_to_stop()
    deadline_s = clock.monotonic_s() + _STOP_S
    while presence.stop_asked():
        if presence.owner() is None:
            presence.clear_stop()
            return _hold_directly(config, port, clock)
        if clock.monotonic_s() > deadline_s:
            raise StageTimeoutError(
                f"process {owner} holds {port} and does not react: it is not moving "
                "the stage just now; the request stays until its next move"
            )
        clock.sleep(0.05)
    return f"process {owner} was told and has stopped the stage"


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
        session.realtime(FEED_HOLD)
        report = await_stand(session, clock, _STOP_S)
        if report is None:
            session.reset()
            return "the stage did not answer a feed hold and was reset; home it"
        if report.state == "hold":
            session.reset()
        return "the stage was moving and has been stopped; its position is kept"
    finally:
        link.close()
