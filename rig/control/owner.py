"""The owner's side: listen while a bench is held, answer whoever asks.

A caller sends one line, ``{"ask": "status"}``, and receives one line, with ``ok`` and
either the facts or an ``error``. To ``watch`` it receives a line at every change, and
at least one a second, until the owner is done.
"""

from __future__ import annotations

import contextlib
import getpass
import logging
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from ...core.errors import MagbendError, RigError
from .client import held_by, holder_sentence, remove_stale
from .names import BenchName, bench_name, control_folder
from .state import OVER, BenchState
from .wire import Line, Listener, Message

logger = logging.getLogger(__name__)

_MAX_CALLERS = 32
_HEARTBEAT_S = 1.0
_CLAIM_S = 5.0
_FAREWELL_S = 1.0

Command = Callable[[], str]
"""What a caller may ask for; returns what was done, in a sentence."""


class Owner:
    """A process that owns a bench; made by `owning`.

    Attributes
    ----------
    state : BenchState
        What ``status`` and ``watch`` tell.
    commands : dict
        What else may be asked, by name: ``stop``, ``pause``, ``resume``.
    """

    def __init__(self, state: BenchState, facts: dict[str, Any]) -> None:
        self.state = state
        self.commands: dict[str, Command] = {}
        self._facts = facts
        self._callers: set[threading.Thread] = set()

    def serve(self, listener: Listener) -> None:
        """Answer callers until the listener is closed."""
        while True:
            try:
                line = listener.accept()
            except OSError:
                return
            if len(self._callers) >= _MAX_CALLERS:
                line.close()
                continue
            caller = threading.Thread(
                target=self._answer, args=(listener, line), daemon=True, name="control"
            )
            self._callers.add(caller)
            caller.start()

    def end(self) -> None:
        """Tell those who watch that it is over, and let everybody have an answer."""
        self.state.tell(state=OVER)
        until_s = time.monotonic() + _FAREWELL_S
        for caller in tuple(self._callers):
            caller.join(max(until_s - time.monotonic(), 0.0))

    def _answer(self, listener: Listener, line: Line) -> None:
        try:
            message = line.receive()
            if message is not None:
                self._reply(listener, line, message)
        except ValueError as error:
            with contextlib.suppress(OSError):
                line.send({"ok": False, "error": str(error)})
        except OSError:
            pass  # hung up, or too slow
        finally:
            line.close()
            self._callers.discard(threading.current_thread())

    def _reply(self, listener: Listener, line: Line, message: Message) -> None:
        what = message.get("ask")
        if not listener.may_ask(message):
            line.send({"ok": False, "error": "the token is wrong"})
        elif what == "status":
            line.send(self._status())
        elif what == "watch":
            self._watch(line)
        elif isinstance(what, str) and what in self.commands:
            line.send(self._carry_out(what))
        else:
            known = ", ".join(["status", "watch", *sorted(self.commands)])
            doing = self._facts["command"]
            error = f"{doing} cannot be asked to {what!r}; it knows: {known}"
            line.send({"ok": False, "error": error})

    def _status(self) -> Message:
        return {"ok": True, **self._facts, **self.state.now()}

    def _carry_out(self, what: str) -> Message:
        try:
            return {"ok": True, "text": self.commands[what]()}
        except MagbendError as error:
            return {"ok": False, "error": str(error)}
        except Exception as error:  # a caller must never end the run
            logger.exception("%s failed", what)
            return {"ok": False, "error": f"internal error: {error}"}

    def _watch(self, line: Line) -> None:
        version = -1
        while True:
            version = self.state.wait(version, _HEARTBEAT_S)
            status = self._status()
            line.send(status)
            if status["state"] == OVER:
                return


@contextlib.contextmanager
def owning(
    rig_file: Path,
    port: str,
    state: BenchState,
    *,
    command: str,
    computed: bool = False,
) -> Iterator[Owner]:
    """Hold a bench while the block runs, and answer whoever asks about it.

    Parameters
    ----------
    rig_file : Path
        The rig file.
    port : str
        Port of the stage.
    state : BenchState
        What there is to tell.
    command : str
        What holds the bench: ``rig run``.
    computed : bool
        Whether the bench is computed: many may run beside each other.

    Raises
    ------
    RigError
        If another process holds this bench: the sentence says which and what it does.
    """
    name = bench_name(rig_file, port, computed=computed)
    facts = {
        "command": command, "pid": os.getpid(), "user": _user(),
        "rig": os.path.realpath(rig_file), "port": port, "twin": computed,
    }  # fmt: skip
    owner = Owner(state, facts)
    listener = _claim(name)
    thread = threading.Thread(
        target=owner.serve, args=(listener,), daemon=True, name="control socket"
    )
    thread.start()
    try:
        yield owner
    finally:
        owner.end()
        listener.close()
        thread.join()
        listener.free()


def _claim(name: BenchName) -> Listener:
    """Listen under `name`, unless another process does; one claim at a time."""
    from filelock import FileLock

    folder = control_folder()
    with FileLock(folder / "claims.lock", timeout=_CLAIM_S):
        holder = held_by(name)
        if holder is not None:
            raise RigError(holder_sentence(holder))
        remove_stale(name, folder)
        try:
            return Listener(folder / name.file)
        except OSError as error:
            raise RigError(
                f"{folder / name.file}: the bench's control socket cannot be made: "
                f"{error.strerror or error}"
            ) from None


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return ""
