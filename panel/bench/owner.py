"""One thread owns the stage while no run has it: it looks, moves, and lets go.

A serial port that two threads read mixes replies, so every question and every move goes
through this thread's list of jobs. A stop does not wait in that list: it is a flag that
the driver looks at ten times a second.
"""

from __future__ import annotations

import contextlib
import logging
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from ...core.errors import InputError, MagbendError, RigError, StageError
from ...rig import InterlockError
from .parts import Parts

logger = logging.getLogger(__name__)

WATCHED_S = 0.25
ALONE_S = 2.0
"""How often the stage is asked where it is: while somebody watches, and while not."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StageView:
    """What the page shows of the stage.

    Parameters
    ----------
    facts : dict
        State, position state, gap, alarm, allowed range; empty while it is not open.
    doing : str
        The command in progress, or nothing.
    target_mm : float or None
        Where it is going.
    trouble : str
        What went wrong last, until something goes right.
    """

    facts: dict[str, Any]
    doing: str = ""
    target_mm: float | None = None
    trouble: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Job:
    name: str
    action: Callable[[Parts], Any]
    target_mm: float | None
    future: Future[Any]


class BenchOwner:
    """The thread that owns the bench.

    Parameters
    ----------
    open_parts : callable
        Opens the devices, in this thread.
    changed : callable
        Called, in this thread, whenever there is something new to show.
    is_watched : callable
        Whether anybody looks.
    """

    def __init__(
        self,
        open_parts: Callable[[], Parts],
        changed: Callable[[], None],
        is_watched: Callable[[], bool],
    ) -> None:
        self._open_parts = open_parts
        self._changed = changed
        self._is_watched = is_watched
        self._jobs: queue.Queue[_Job | None] = queue.Queue()
        self._thread = threading.Thread(target=self._work, name="bench", daemon=True)
        self._doing: _Job | None = None
        self._gap_mm: float | None = None
        self._trouble = ""
        self._facts: dict[str, Any] = {}
        self.parts: Parts | None = None

    def begin(self) -> None:
        """Start the thread; nothing is opened yet."""
        self._thread.start()

    def view(self) -> StageView:
        """Return what is known of the stage, from any thread."""
        job, facts = self._doing, dict(self._facts)
        if job is not None and self._gap_mm is not None and facts:
            facts["gap_mm"] = self._gap_mm
        return StageView(
            facts=facts, doing=job.name if job else "", trouble=self._trouble,
            target_mm=job.target_mm if job else None,
        )  # fmt: skip

    @property
    def gap_mm(self) -> float | None:
        """The gap as last known, also on the way."""
        gap = self.view().facts.get("gap_mm")
        return None if gap is None else float(gap)

    def submit(
        self,
        name: str,
        action: Callable[[Parts], Any],
        *,
        target_mm: float | None = None,
    ) -> Future[Any]:
        """Queue something for the thread to do with the open devices.

        Parameters
        ----------
        name : str
            What the page says meanwhile, such as ``going to 60 mm``.
        action : callable
            Called with the devices.
        target_mm : float, optional
            Where the stage will stand.
        """
        future: Future[Any] = Future()
        self._jobs.put(
            _Job(name=name, action=action, target_mm=target_mm, future=future)
        )
        return future

    def open(self) -> Future[Any]:
        """Open the devices, unless they are."""
        return self.submit("connecting", lambda _parts: None)

    def release(self) -> None:
        """Close the devices, so that another process may have them, and wait for it."""
        self.submit("letting the bench go", self._let_go).result(timeout=30.0)

    def request_stop(self) -> None:
        """Stop the stage now, and forget what was queued."""
        with contextlib.suppress(queue.Empty):
            while True:
                job = self._jobs.get_nowait()
                if job is None:
                    self._jobs.put(None)
                    break
                job.future.set_exception(StageError(f"{job.name}: stopped before it"))
        parts = self.parts
        if parts is not None and parts.stage is not None:
            parts.stage.request_stop()
            self.submit("stopping", _hold)

    def moved(self, gap_mm: float) -> None:
        """Take in where the stage is on its way."""
        self._gap_mm = gap_mm
        self._changed()

    def close(self) -> None:
        """End the thread; the stage is held first."""
        self.request_stop()
        self._jobs.put(None)
        if self._thread.is_alive():
            self._thread.join(timeout=10.0)

    def _work(self) -> None:
        while True:
            interval_s = WATCHED_S if self._is_watched() else ALONE_S
            try:
                job = self._jobs.get(timeout=interval_s)
            except queue.Empty:
                self._look()
                continue
            if job is None:
                break
            self._do(job)
        self._let_go(self.parts)

    def _do(self, job: _Job) -> None:
        self._doing, self._gap_mm = job, None
        self._changed()
        outcome, failure = self._tried(job)
        self._doing, self._gap_mm = None, None
        self._look()  # whoever waits for the job sees what it has changed
        if failure is None:
            job.future.set_result(outcome)
        else:
            if not isinstance(failure, (InterlockError, InputError)):
                self._trouble = str(failure)  # a refusal is told to whoever asked
            job.future.set_exception(failure)
        self._changed()

    def _tried(self, job: _Job) -> tuple[Any, MagbendError | None]:
        try:
            if self.parts is None and job.action != self._let_go:
                self.parts = self._open_parts()
            outcome = job.action(self.parts)  # type: ignore[arg-type]
        except MagbendError as error:
            return None, error
        except Exception as error:
            logger.exception("%s failed", job.name)
            return None, RigError(f"internal error: {type(error).__name__}: {error}")
        self._trouble = ""
        return outcome, None

    def _look(self) -> None:
        parts = self.parts
        before = self._facts
        if parts is None or parts.stage is None:
            self._facts = {}
        else:
            try:
                if parts.stage.stop_requested():
                    parts.stage.hold()
                parts.stage.listen()
                self._facts = stage_facts(parts.stage)
            except MagbendError as error:
                self._trouble = str(error)
                with contextlib.suppress(MagbendError):
                    self._facts = stage_facts(parts.stage)
        if self._facts != before or self._trouble:
            self._changed()

    def _let_go(self, _parts: Parts | None) -> None:
        parts, self.parts = self.parts, None
        if parts is not None:
            parts.close()


def _hold(parts: Parts) -> None:
    if parts.stage is not None:
        parts.stage.hold()


def stage_facts(stage: Any) -> dict[str, Any]:
    """Return the state of a stage as the page shows it."""
    status = stage.status()
    low_mm, high_mm = stage.range_mm()
    identity = stage.identity
    return {
        "state": status.state,
        "position_state": status.position_state,
        "gap_mm": status.gap_mm,
        "stage_mm": status.stage_mm,
        "feed_mm_min": status.feed_mm_min,
        "alarm": status.alarm,
        "pins": status.pins,
        "doubt": status.doubt,
        "allowed_mm": [low_mm, high_mm],
        "port": identity.port,
        "firmware": identity.firmware,
        "notes": list(identity.notes),
        "settings": dict(identity.settings),
    }
