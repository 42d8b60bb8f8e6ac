"""The run that has the bench: found, watched and asked through its control socket.

The run belongs to its own process. The panel finds it again after a restart, shows what
it tells, and passes on stop, pause and resume; its end, or ours, changes nothing else.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import threading
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...core.errors import CameraError, MagbendError, RigError
from ...core.picture import decode_picture
from ..bench.sight import Picture
from ..workspace import Workspace
from .process import start

LOOK_S = 1.0
RUN = "rig run"
_START_S = 20.0
_PICTURE_S = 3.0
_BLIND_S = 5.0
"""How long the run's live view may be silent before it is called a trouble."""


class Supervisor:
    """The thread that watches the run.

    Parameters
    ----------
    workspace : Workspace
        Whose rig file names the bench.
    changed : callable
        Called whenever there is something new to show.
    """

    def __init__(self, workspace: Workspace, changed: Callable[[], None]) -> None:
        self._workspace = workspace
        self._changed = changed
        self._ending = threading.Event()
        self._look_now = threading.Event()
        self._thread = threading.Thread(target=self._work, name="run", daemon=True)
        self._facts: dict[str, Any] | None = None
        self._starting_s = 0.0
        # A run may still answer while its process ends and the next one begins.
        self._followed: int | None = 0
        self._before: int | None = 0
        self._process: subprocess.Popen[bytes] | None = None
        self._number = 0
        self._seen_s = 0.0
        self.last_run = ""
        self.log: Path | None = None
        self.over: Callable[[], None] = lambda: None

    def begin(self) -> None:
        """See whether a run has the bench, and start the thread."""
        if self._workspace.files().rig is not None:
            with contextlib.suppress(MagbendError):
                self._facts = self._status()
        self._thread.start()

    def close(self) -> None:
        """End the thread; the run goes on."""
        self._ending.set()
        self._look_now.set()
        if self._thread.is_alive():
            self._thread.join(timeout=3.0)

    @property
    def facts(self) -> dict[str, Any] | None:
        """What the process that has the bench tells; None if there is none but us."""
        return self._facts

    @property
    def is_running(self) -> bool:
        """Whether another process has the bench, or is about to."""
        return self._facts is not None or self.is_starting

    @property
    def is_starting(self) -> bool:
        """Whether a run was started that has not said a word yet."""
        return time.monotonic() - self._starting_s < _START_S

    def start(self, arguments: list[str], folder: Path) -> None:
        """Start a run in its own process; the bench must be free.

        Raises
        ------
        RigError
            If a run has the bench already.
        """
        if self.is_running:
            raise RigError("a run has the bench already; wait for its end, or abort it")
        folder.parent.mkdir(parents=True, exist_ok=True)
        self.log = folder.with_name(f"{folder.name}.log")
        self.last_run = folder.name
        with self.log.open("ab") as output:
            process = start(arguments, self._workspace.folder, output, detached=True)
        self._before = self._followed
        self._starting_s, self._process = time.monotonic(), process
        threading.Thread(
            target=self._reap, args=(process,), name="run end", daemon=True
        ).start()
        self._look_now.set()
        self._changed()

    def ask(self, what: str) -> str:
        """Pass stop, pause or resume on to the run; return what it answers.

        Raises
        ------
        RigError
            If there is no run, or it refuses.
        """
        from ...rig import ask

        answer = ask(self._workspace.rig_path, what, port=self._port())
        self._look_now.set()
        return str(answer.get("text", ""))

    def stop(self) -> str:
        """Stop the run, also one that has not said a word yet, or answers no more.

        Raises
        ------
        RigError
            If there is no run, or it cannot be reached in any way.
        """
        process, facts = self._process, self._facts
        if facts is None and process is not None and process.poll() is None:
            process.terminate()
            return "the run was told to end before it began"
        try:
            return self.ask("stop")
        except RigError:
            if process is None or process.poll() is not None:
                raise
            process.terminate()  # it holds the stage at this signal too
            return "the run did not answer and was sent SIGTERM"

    def picture(self) -> Picture | None:
        """Return what the run's camera sees, from its live view.

        Raises
        ------
        CameraError
            If the live view does not answer while the run goes on.
        """
        facts = self._facts
        address = facts.get("live_view") if facts else None
        if not address or facts is None:
            return None
        try:
            with urllib.request.urlopen(
                f"{address}frame.jpg", timeout=_PICTURE_S
            ) as answer:
                data = answer.read(50_000_000)
        except OSError as error:
            if time.monotonic() - self._seen_s < _BLIND_S or self._facts is None:
                return None  # it ends just now, or is busy
            raise CameraError(f"the run's live view does not answer: {error}") from None
        self._seen_s = time.monotonic()
        return self._decoded(data, facts)

    def _decoded(self, data: bytes, facts: dict[str, Any]) -> Picture:
        image = decode_picture(data, "the run's live view", CameraError)
        self._number -= 1  # below zero: never one of the panel's own camera
        still = facts.get("state") in ("settling", "measuring", "photographing")
        return Picture(
            image=image, number=self._number, arrival_s=time.monotonic(),
            gap_mm=facts.get("gap_mm") if still else None,
        )  # fmt: skip

    def _port(self) -> str:
        rig = self._workspace.files().rig
        return rig.stage.port if rig is not None else "auto"

    def _work(self) -> None:
        while not self._ending.is_set():
            if self._workspace.files().rig is not None:
                with contextlib.suppress(MagbendError):
                    self._follow()
            if self._facts is not None:
                self._facts = None
                self._changed()
                self.over()
            self._look_now.wait(LOOK_S)
            self._look_now.clear()

    def _status(self) -> dict[str, Any] | None:
        """Return what the owner of the bench tells; None if that is ourselves.

        Raises
        ------
        NobodyError
            If nobody owns it.
        """
        from ...rig import ask

        facts = ask(self._workspace.rig_path, "status", port=self._port())
        return None if facts.get("pid") == os.getpid() else facts

    def _follow(self) -> None:
        """Take in what the owner of the bench tells, until it is over."""
        from ...rig import watch

        path, port = self._workspace.rig_path, self._port()
        if self._status() is None:
            return
        for facts in watch(path, port=port):
            pid = facts.get("pid")
            if pid in (os.getpid(), self._before) or self._ending.is_set():
                return
            self._starting_s, self._followed = 0.0, pid
            folder = facts.get("folder")
            if folder and Path(folder).parent == self._workspace.runs_path:
                self.last_run = Path(folder).name
            if self._facts is None:
                self._seen_s = time.monotonic()
            if facts != self._facts:
                self._facts = facts
                self._changed()

    def _reap(self, process: Any) -> None:
        process.wait()
        if process is not self._process:
            return  # the next run has begun
        self._starting_s, self._before = 0.0, 0
        self._look_now.set()
        self._changed()
        if self._facts is None:
            self.over()
