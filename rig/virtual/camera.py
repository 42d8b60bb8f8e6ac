"""The twin's camera: renders what it would see, and swings before it settles."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Literal

from ...core.errors import CameraError
from ..camera.protocol import Frame, Image
from ..clock import Check, Clock, go_on, utc_text, wait

CameraFault = Literal["stall", "dark"]
Render = Callable[[float, float], Image]
"""``render(gap_mm, time_s)`` returns the picture at that gap and time."""

_STILL_MM = 0.02


class VirtualCamera:
    """A camera that photographs a computed bench.

    Parameters
    ----------
    render : callable
        Called as ``render(gap_mm, time_s)``; returns a picture.
    gap : callable
        Returns the present gap in mm: the twin stage's own, true position.
    clock : Clock
        The twin's time.
    frame_s : float
        Time between two pictures.
    swing_mm, swing_Hz, damping_s : float
        After the stage arrived the rod swings as if the gap were off by
        ``swing_mm * exp(-t / damping_s) * cos(2 pi swing_Hz t)``.
    timeout_s : float
        How long a stalled camera is waited for.
    faults : mapping of int to str
        Picture number to what happens there: ``stall`` (no picture ever again until
        reopened), ``dark`` (half the light).

    Attributes
    ----------
    trouble : callable
        Returns what is wrong with it now, or None.
    """

    def __init__(
        self,
        render: Render,
        gap: Callable[[], float],
        clock: Clock,
        *,
        frame_s: float = 0.1,
        swing_mm: float = 0.0,
        swing_Hz: float = 1.0,
        damping_s: float = 0.5,
        timeout_s: float = 5.0,
        faults: Mapping[int, CameraFault] | None = None,
    ) -> None:
        self._render = render
        self._gap = gap
        self._clock = clock
        self._frame_s = frame_s
        self._swing = (swing_mm, swing_Hz, damping_s)
        self._timeout_s = timeout_s
        self._faults = dict(faults or {})
        self._arrived_s = -math.inf
        self._number = 0
        self._newest: Frame | None = None
        self._on_step: list[tuple[int, Callable[[], None]]] = []
        self.trouble: Callable[[], CameraFault | None] = lambda: None

    @property
    def identity(self) -> dict[str, Any]:
        """Return that it is the twin's."""
        return {"backend": "twin", "frame_s": self._frame_s}

    def at_step(self, index: int, gap_mm: float) -> None:
        """Let the rod begin to swing: the stage arrived."""
        del gap_mm
        self._arrived_s = self._clock.monotonic_s()
        for action in [action for step, action in self._on_step if step == index]:
            action()
        self._on_step = [item for item in self._on_step if item[0] != index]

    def on_step(self, index: int, action: Callable[[], None]) -> None:
        """Call `action` once, when the stage has arrived for a step of the plan."""
        self._on_step.append((index, action))

    def grab_after(self, time_s: float, *, check: Check = go_on) -> Frame:
        """Return the first picture that begins after `time_s`.

        Raises
        ------
        CameraError
            If a fault of the schedule keeps it from coming.
        """
        now_s = self._clock.monotonic_s()
        wait(self._clock, max(time_s - now_s, 0.0) + self._frame_s, check)
        self._number += 1
        fault = self._faults.get(self._number) or self.trouble()
        if fault == "stall":
            wait(self._clock, self._timeout_s, check)
            raise CameraError(
                f"the twin camera must give a picture every {self._frame_s:g} s; "
                f"instead none came for {self._timeout_s:g} s"
            )
        arrival_s = self._clock.monotonic_s()
        image = self._render(self._gap() + self._swing_mm(arrival_s), arrival_s)
        if fault == "dark":
            image = (image * 0.5).astype(image.dtype)
        self._newest = Frame(
            image=image, arrival_s=arrival_s, number=self._number,
            time_utc=utc_text(self._clock),
        )  # fmt: skip
        return self._newest

    def newest(self) -> Frame | None:
        """Return the last picture, or None before the first."""
        return self._newest

    def close(self) -> None:
        """Do nothing."""

    def _swing_mm(self, time_s: float) -> float:
        swing_mm, swing_Hz, damping_s = self._swing
        t_s = time_s - self._arrived_s
        if not math.isfinite(t_s):
            return 0.0
        amplitude_mm = swing_mm * math.exp(-t_s / damping_s)
        if abs(amplitude_mm) < _STILL_MM:
            return 0.0
        return amplitude_mm * math.cos(2.0 * math.pi * swing_Hz * t_s)
