"""One thread that always reads the camera, so that nobody ever gets an old picture.

Drivers and networks queue pictures. The thread empties that queue all the time and
keeps only the newest picture, with the time at which its transfer *began*. A picture is
handed out for a moment only if its transfer began after that moment.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from ...core.errors import CameraError
from ..clock import Check, Clock, go_on, utc_text
from .config import CameraConfig
from .protocol import Frame, Image, brightness

logger = logging.getLogger(__name__)

_BACKOFF_S = (0.1, 0.25, 0.5, 1.0, 2.0)
_SLICE_S = 0.1
_BAND_ROWS = 8
_SAME_BAND = 5


class Source(Protocol):
    """A device or stream that is read in one thread only."""

    @property
    def identity(self) -> dict[str, Any]:
        """What is known of the source once it is open."""
        ...

    def open(self) -> None:
        """Open it, or raise `CameraError`."""
        ...

    def read(self) -> tuple[Image, float]:
        """Return the next picture and the monotonic time at which it began to arrive.

        Blocks for no longer than the source's time-out.

        Raises
        ------
        CameraError
            If the source stalled, closed, or sent a broken picture.
        """
        ...

    def close(self) -> None:
        """Let it go."""
        ...


class BrokenPictureError(CameraError):
    """One picture is corrupt; the stream goes on."""


@dataclass(slots=True)
class _Counters:
    """What happened since the camera was opened."""

    frames: int = 0
    broken: int = 0
    reopened: int = 0


@dataclass(slots=True)
class _State:
    """What the two threads share, under one condition."""

    newest: Frame | None = None
    began_s: float = 0.0
    trouble: str = ""
    is_closing: bool = False
    counters: _Counters = field(default_factory=_Counters)


class CaptureCamera:
    """A camera behind a reader thread.

    Parameters
    ----------
    source : callable
        Makes the source; called in the reader thread, again after each failure.
    name : str
        What messages call the camera.
    config : CameraConfig
        Time-outs and latency.
    clock : Clock
        Time of arrival.

    Raises
    ------
    CameraError
        If no picture comes within the first time-out.
    """

    def __init__(
        self,
        source: Callable[[], Source],
        name: str,
        config: CameraConfig,
        clock: Clock,
    ) -> None:
        self._make_source = source
        self._name = name
        self._config = config
        self._clock = clock
        self._state = _State()
        self._changed = threading.Condition()
        self._torn = TornPictureTest()
        self._source_identity: dict[str, Any] = {}
        self._thread = threading.Thread(
            target=self._work, name=f"camera {name}", daemon=True
        )
        self._thread.start()
        try:
            self._warmup = self._warm_up()
        except BaseException:
            self.close()
            raise

    @property
    def identity(self) -> dict[str, Any]:
        """Return source, picture size, settings as read back, warm-up and counters."""
        with self._changed:
            counters, newest = self._state.counters, self._state.newest
            return {
                "source": self._name,
                **self._source_identity,
                "shape": list(newest.image.shape) if newest else None,
                "warmup": self._warmup,
                "frames": counters.frames,
                "broken": counters.broken,
                "reopened": counters.reopened,
            }

    def at_step(self, index: int, gap_mm: float) -> None:
        """Take no note: a camera sees what is there."""

    def newest(self) -> Frame | None:
        """Return the newest picture at once, or None before the first."""
        with self._changed:
            return self._state.newest

    def grab_after(self, time_s: float, *, check: Check = go_on) -> Frame:
        """Return the newest picture whose transfer began after `time_s` plus latency.

        `check` is called ten times a second while it waits, outside the lock.

        Raises
        ------
        CameraError
            If none comes within ``frame_timeout_s``: says what the source is doing.
        """
        fresh_s = time_s + self._config.latency_s
        timeout_s = self._config.frame_timeout_s
        deadline_s = max(self._clock.monotonic_s(), fresh_s) + timeout_s
        while True:
            check()
            with self._changed:
                state = self._state
                if state.newest is not None and state.began_s >= fresh_s:
                    return state.newest
                if self._clock.monotonic_s() >= deadline_s:
                    why = state.trouble or "the source sends nothing"
                    raise CameraError(
                        f"camera {self._name} must give a new picture within "
                        f"{timeout_s:g} s; instead none came: {why}"
                    )
                self._changed.wait(_SLICE_S)

    def close(self) -> None:
        """Stop the thread; a source that hangs is left to end by itself."""
        with self._changed:
            self._state.is_closing = True
            self._changed.notify_all()
        self._thread.join(timeout=0.5)

    def _warm_up(self) -> dict[str, Any]:
        """Throw the first pictures away until their brightness is steady."""
        start_s = self._clock.monotonic_s()
        frame = self.grab_after(start_s - self._config.latency_s)
        levels = [brightness(frame.image)]
        until_s = frame.arrival_s + self._config.warmup_s
        while self._clock.monotonic_s() < until_s:
            after_s = frame.arrival_s - self._config.latency_s
            frame = self.grab_after(after_s)
            levels.append(brightness(frame.image))
        last = levels[-3:]
        return {
            "time_s": self._clock.monotonic_s() - start_s,
            "frames": len(levels),
            "brightness": levels[-1],
            "is_steady": max(last) - min(last) <= 0.02,
        }

    def _work(self) -> None:
        failures = 0
        while not self._is_closing():
            source = self._make_source()
            try:
                source.open()
                while not self._is_closing():
                    if self._read_one(source):
                        failures = 0
            except CameraError as error:
                self._set_trouble(str(error))
            except Exception as error:  # the thread must never die silently
                logger.exception("camera %s", self._name)
                self._set_trouble(f"{type(error).__name__}: {error}")
            finally:
                source.close()
            with self._changed:
                self._state.counters.reopened += 1
                pause_s = _BACKOFF_S[min(failures, len(_BACKOFF_S) - 1)]
                if not self._state.is_closing:
                    self._changed.wait(pause_s)
            failures += 1

    def _read_one(self, source: Source) -> bool:
        """Read one picture; return whether it is a good one."""
        try:
            image, began_s = source.read()
            if self._torn.is_torn(image):
                raise BrokenPictureError("its lower rows are one flat grey")
            self._source_identity = source.identity
        except BrokenPictureError as error:
            with self._changed:
                self._state.counters.broken += 1
                self._state.trouble = f"the last picture was broken: {error}"
            return False
        with self._changed:
            state = self._state
            state.counters.frames += 1
            state.newest = Frame(
                image=image, arrival_s=self._clock.monotonic_s(),
                time_utc=utc_text(self._clock),
                number=state.counters.frames,
            )  # fmt: skip
            state.began_s = began_s
            state.trouble = ""
            self._changed.notify_all()
        return True

    def _is_closing(self) -> bool:
        with self._changed:
            return self._state.is_closing

    def _set_trouble(self, sentence: str) -> None:
        with self._changed:
            is_new = sentence != self._state.trouble
            self._state.trouble = sentence
        if is_new:  # a camera that stays away is tried again and again
            logger.warning("camera %s: %s", self._name, sentence)


class TornPictureTest:
    """Recognise pictures whose lower part was lost on the way.

    Decoders fill what is missing with one flat grey. A real photograph has noise in
    every row, so a band of exactly equal pixels at the bottom, neither black nor
    white, is suspicious, unless several pictures in a row have it: then it is the
    scene (a drawing, a rendered picture).
    """

    def __init__(self) -> None:
        self._in_a_row = 0

    def is_torn(self, image: Image) -> bool:
        """Return whether this picture must not be used."""
        band = image[-_BAND_ROWS:].reshape(-1, *image.shape[2:])
        first = band[0]
        is_flat = bool(np.all(band == first))
        full = 1.0 if image.dtype.kind == "f" else float(np.iinfo(image.dtype).max)
        is_clipped = bool(np.all(first == 0) or np.all(first >= full))
        if not is_flat or is_clipped:
            self._in_a_row = 0
            return False
        self._in_a_row += 1
        return self._in_a_row < _SAME_BAND
