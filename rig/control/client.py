"""The caller's side: ask the process that owns a bench, from any terminal."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ...core.errors import RigError
from .names import BenchName, bench_name, sockets_of
from .state import OVER
from .wire import TIMEOUT_S, Line, Message, call

_ANSWER_S = 20.0


class NobodyError(RigError):
    """No process owns the bench just now."""


def ask(
    rig_file: Path, what: str, *, port: str = "auto", timeout_s: float = _ANSWER_S
) -> Message:
    """Ask the owner of a bench and return its answer.

    Parameters
    ----------
    rig_file : Path
        The rig file.
    what : str
        ``status``, ``stop``, ``pause`` or ``resume``.
    port : str
        Port of the stage, as the rig file or ``--port`` says it: the owner is found by
        its port too, whatever rig file it was started with.
    timeout_s : float
        How long the answer may take.

    Returns
    -------
    dict
        For ``status`` the facts (see `BenchState`); else ``text``, a sentence.

    Raises
    ------
    NobodyError
        If no process owns the bench.
    RigError
        If the owner refuses or does not answer.
    """
    line = _reach(bench_name(rig_file, port), what, timeout_s)
    with contextlib.closing(line):
        answer = _next(line)
    if answer is None:
        raise NobodyError(f"the process that held the bench of {rig_file} is gone")
    if not answer.get("ok"):
        raise RigError(str(answer.get("error", "the owner of the bench refuses")))
    return answer


def watch(rig_file: Path, *, port: str = "auto") -> Iterator[Message]:
    """Yield the facts at every change, at least one a second, until all is over.

    Raises
    ------
    NobodyError
        If no process owns the bench, or its owner dies.
    """
    line = _reach(bench_name(rig_file, port), "watch", TIMEOUT_S)
    with contextlib.closing(line):
        while True:
            facts = _next(line)
            if facts is None:
                raise NobodyError("the process that held the bench died")
            yield facts
            if facts.get("state") == OVER:
                return


def held_by(name: BenchName) -> Message | None:
    """Return what the holder of this very bench says; None if nobody holds it."""
    for path in sockets_of(name):
        _, _, port = path.stem.partition("-")
        if port != name.port:
            continue  # the same rig file at another port: another bench
        line = _call(path, "status", TIMEOUT_S)
        if line is None:
            continue
        with contextlib.closing(line):
            return _next(line) or {}
    return None


def remove_stale(name: BenchName, folder: Path) -> None:
    """Take away the sockets of dead owners; only with the lock on claims."""
    for path in sockets_of(name):
        if path.parent != folder:
            continue
        line = _call(path, "status", TIMEOUT_S)
        if line is None:
            path.unlink(missing_ok=True)
        else:
            line.close()


def holder_sentence(holder: Message) -> str:
    """Return who holds a bench and what can be asked of it."""
    where = holder.get("folder") or holder.get("name") or ""
    doing = f" ({where})" if where else ""
    return (
        f"the bench is held by magbend {holder.get('command', '')}{doing}, process "
        f"{holder.get('pid', 'unknown')}: magbend rig status tells what it does, "
        f"magbend rig stop stops it"
    )


def _reach(name: BenchName, what: str, timeout_s: float) -> Line:
    for path in sockets_of(name):
        line = _call(path, what, timeout_s)
        if line is not None:
            return line
    raise NobodyError("no magbend command holds this bench just now")


def _call(path: Path, what: str, timeout_s: float) -> Line | None:
    """Reach one owner; None if it died and left its socket behind."""
    try:
        return call(path, {"ask": what}, timeout_s)
    except PermissionError:
        raise RigError(f"{path}: this bench is held by another user") from None
    except OSError as error:
        raise RigError(
            f"{path}: the owner of the bench does not answer: {error.strerror or error}"
        ) from None


def _next(line: Line) -> dict[str, Any] | None:
    try:
        return line.receive()
    except TimeoutError:
        raise RigError(
            "the owner of the bench does not answer in time; it is busy, or hangs"
        ) from None
    except (OSError, ValueError) as error:
        raise RigError(f"the owner of the bench answers nonsense: {error}") from None
