"""Work on finished runs, one command at a time: extract, fit, report, verify, package.

Each job is the command that a person would type, and the page shows it.
"""

from __future__ import annotations

import re
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from ...core.errors import InputError
from ..workspace import Workspace
from .process import spelt, start

_PROGRESS = re.compile(r"(\d+)/(\d+)")
_LINES = 60
_KEPT = 20


def _nothing() -> None:
    """Do nothing afterwards."""


@dataclass(slots=True, kw_only=True)
class Job:
    """One command, waiting, going on, or done.

    Parameters
    ----------
    number : int
        Counts jobs.
    what, run : str
        Such as ``extract``, and the name of the run or nothing.
    arguments : tuple of str
        What follows ``magbend``.
    after : callable
        Called when it is over, however it ended.
    """

    number: int
    what: str
    run: str
    arguments: tuple[str, ...]
    after: Callable[[], None] = _nothing
    status: str = "waiting"
    lines: deque[str] = field(default_factory=lambda: deque(maxlen=_LINES))
    done: int = 0
    total: int = 0
    begun_s: float = 0.0
    ended_s: float = 0.0

    def facts(self) -> dict[str, Any]:
        """Return what the page shows."""
        end_s = self.ended_s or time.monotonic()
        return {
            "number": self.number,
            "what": self.what,
            "run": self.run,
            "command": spelt(self.arguments),
            "status": self.status,
            "lines": list(self.lines),
            "done": self.done,
            "total": self.total,
            "time_s": end_s - self.begun_s if self.begun_s else 0.0,
        }


class Jobs:
    """A thread that carries jobs out, one after the other.

    Parameters
    ----------
    workspace : Workspace
        Whose folder they run in.
    changed : callable
        Called whenever there is something new to show.
    """

    def __init__(self, workspace: Workspace, changed: Callable[[], None]) -> None:
        self._workspace = workspace
        self._changed = changed
        self._jobs: deque[Job] = deque(maxlen=_KEPT)
        self._lock = threading.Lock()
        self._count = 0
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: threading.Thread | None = None
        self._is_ending = False

    def facts(self) -> list[dict[str, Any]]:
        """Return all jobs, newest first."""
        with self._lock:
            return [job.facts() for job in reversed(self._jobs)]

    def add(
        self,
        what: str,
        run: str,
        arguments: Sequence[str],
        *,
        after: Callable[[], None] = _nothing,
    ) -> Job:
        """Queue a command; `after` is called when it is over.

        Raises
        ------
        InputError
            If the same one is waiting or going on already.
        """
        with self._lock:
            arguments = tuple(arguments)
            for job in self._jobs:
                if job.arguments == arguments and job.status in ("waiting", "running"):
                    raise InputError(f"{what} of {run} is going on already")
            self._count += 1
            job = Job(
                number=self._count, what=what, run=run, arguments=arguments, after=after
            )
            self._jobs.append(job)
            if self._thread is None or not self._thread.is_alive():
                self._thread = threading.Thread(
                    target=self._work, name="jobs", daemon=True
                )
                self._thread.start()
        self._changed()
        return job

    def close(self) -> None:
        """End the job that goes on; what is waiting is forgotten."""
        self._is_ending = True
        process = self._process
        if process is not None and process.poll() is None:
            process.terminate()
        thread = self._thread
        if thread is not None and thread.is_alive():
            thread.join(timeout=5.0)

    def _next(self) -> Job | None:
        with self._lock:
            waiting = [job for job in self._jobs if job.status == "waiting"]
            if self._is_ending or not waiting:
                self._thread = None
                return None
            return waiting[0]

    def _work(self) -> None:
        while (job := self._next()) is not None:
            job.status, job.begun_s = "running", time.monotonic()
            self._changed()
            try:
                job.status = self._carry_out(job)
            except OSError as error:
                job.lines.append(f"cannot be started: {error.strerror}")
                job.status = "failed"
            job.ended_s = time.monotonic()
            job.after()
            self._changed()

    def _carry_out(self, job: Job) -> str:
        folder = self._workspace.folder
        with start(job.arguments, folder, subprocess.PIPE, detached=False) as process:
            self._process = process
            if process.stdout is None:
                return "failed"
            for raw in process.stdout:
                line = raw.decode("utf-8", "replace").rstrip()
                if not line:
                    continue
                job.lines.append(line[:500])
                found = _PROGRESS.search(line)
                if found:
                    job.done, job.total = int(found[1]), int(found[2])
                self._changed()
        self._process = None
        return "done" if process.returncode == 0 else "failed"
