"""Live pictures: one thread grabs and packs them, one measures the newest.

Both rest while nobody looks. Only the newest picture and the newest measurement are
kept: whoever is slow misses pictures, and never gets an old one.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import MagbendError

logger = logging.getLogger(__name__)

JPEG_QUALITY = 82
WIDEST_PX = 1920
RETRY_S = 2.0
REST_S = 0.25
REST_AFTER = 3.0
"""Rest after a search in vain, in times of how long it took."""

STATISTICS_S = 0.5
"""How often focus, histogram and saturation are looked at."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """One live picture.

    Parameters
    ----------
    image : ndarray, shape (h, w) or (h, w, 3)
        As the camera gave it.
    number : int
        Of the camera, or of the panel where the camera does not count.
    arrival_s : float
        Monotonic time of this process.
    gap_mm : float or None
        Where the stage was.
    """

    image: NDArray[Any]
    number: int
    arrival_s: float
    gap_mm: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Packed:
    """A picture as it is sent: JPEG, and what is to be known of it."""

    jpeg: bytes
    number: int
    arrival_s: float
    size_px: tuple[int, int]


class Sight:
    """The two threads of the live picture.

    Parameters
    ----------
    grab : callable
        Returns the next picture; raises `MagbendError` if none comes, and returns None
        while there is no camera.
    measure : callable
        Called with a picture, returns what is drawn over it.
    pace_s : callable
        Least time between two pictures, in s; infinite while nobody looks.
    show, draw : callable
        Given a packed picture, and an overlay.
    """

    def __init__(
        self,
        grab: Callable[[], Picture | None],
        measure: Callable[[Picture], dict[str, Any]],
        pace_s: Callable[[], float],
        show: Callable[[Packed], None],
        draw: Callable[[dict[str, Any]], None],
    ) -> None:
        self._grab = grab
        self._measure = measure
        self._pace_s = pace_s
        self._show = show
        self._draw = draw
        self._fresh = threading.Condition()
        self._newest: Picture | None = None
        self._ending = threading.Event()
        self._times_s: deque[float] = deque(maxlen=30)
        self._overlays_s: deque[float] = deque(maxlen=30)
        self._statistics: dict[str, Any] = {}
        self._statistics_s = 0.0
        self.trouble = ""
        self._threads = [
            threading.Thread(target=self._grab_on, name="picture", daemon=True),
            threading.Thread(target=self._measure_on, name="theory", daemon=True),
        ]

    def begin(self) -> None:
        """Start both threads."""
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """End both threads."""
        self._ending.set()
        with self._fresh:
            self._fresh.notify_all()
        for thread in self._threads:
            if thread.is_alive():
                thread.join(timeout=8.0)

    def newest(self) -> Picture | None:
        """Return the newest picture."""
        return self._newest

    def facts(self) -> dict[str, Any]:
        """Return rates, age and statistics, from any thread."""
        newest = self._newest
        now_s = time.monotonic()
        return {
            "frames_per_s": _rate(self._times_s, now_s),
            "overlays_per_s": _rate(self._overlays_s, now_s),
            "age_s": now_s - newest.arrival_s if newest else None,
            "size_px": list(newest.image.shape[1::-1]) if newest else None,
            "trouble": self.trouble,
            **self._statistics,
        }

    def forget(self) -> None:
        """Drop the newest picture: it shows another bench than the one to come."""
        self._newest, self._statistics, self.trouble = None, {}, ""

    def _grab_on(self) -> None:
        while not self._ending.is_set():
            pace_s = self._pace_s()
            if pace_s == float("inf"):
                self.trouble = ""
                self._ending.wait(REST_S)
                continue
            begun_s = time.monotonic()
            try:
                picture = self._grab()
                self.trouble = ""
            except MagbendError as error:
                self.trouble, picture = str(error), None
            except Exception as error:
                logger.exception("the live picture failed")
                self.trouble, picture = f"internal error: {error}", None
            if picture is None:
                self._ending.wait(RETRY_S if self.trouble else REST_S)
                continue
            self._take(picture)
            self._ending.wait(max(0.0, begun_s + pace_s - time.monotonic()))

    def _take(self, picture: Picture) -> None:
        self._times_s.append(picture.arrival_s)
        with self._fresh:
            self._newest = picture
            self._fresh.notify_all()
        self._show(pack(picture))
        if picture.arrival_s - self._statistics_s > STATISTICS_S:
            self._statistics = statistics(picture.image)
            self._statistics_s = picture.arrival_s

    def _measure_on(self) -> None:
        done: Picture | None = None
        while not self._ending.is_set():
            with self._fresh:
                if self._newest is None or self._newest is done:
                    self._fresh.wait(1.0)
                    continue
                done = self._newest
            begun_s = time.monotonic()
            try:
                drawn = self._measure(done)
            except MagbendError as error:
                drawn = {"status": "failed", "reason": str(error)}
            except Exception as error:
                logger.exception("measuring the live picture failed")
                drawn = {"status": "failed", "reason": f"internal error: {error}"}
            now_s = time.monotonic()
            self._overlays_s.append(now_s)
            late_ms = 1e3 * (now_s - done.arrival_s)
            self._draw({**drawn, "number": done.number, "late_ms": late_ms})
            if drawn["status"] != "ok":
                # A search in vain is long: leave the picture its share of the machine.
                self._ending.wait(min(REST_AFTER * (now_s - begun_s), RETRY_S))


def pack(picture: Picture) -> Packed:
    """Return a picture as JPEG, at most `WIDEST_PX` wide."""
    import cv2

    image: NDArray[Any] = as_bytes(picture.image)
    height, width = image.shape[:2]
    if width > WIDEST_PX:
        size = (WIDEST_PX, round(height * WIDEST_PX / width))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    jpeg = cv2.imencode(".jpg", image, quality)[1].tobytes()
    return Packed(
        jpeg=jpeg, number=picture.number, arrival_s=picture.arrival_s,
        size_px=(width, height),
    )  # fmt: skip


def as_bytes(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Return a picture of any depth with eight bits a channel, for the eye."""
    if image.dtype == np.uint8:
        return np.asarray(image, dtype=np.uint8)
    full = 1.0 if image.dtype.kind == "f" else float(np.iinfo(image.dtype).max)
    scaled = np.clip(image.astype(np.float32) * (255.0 / full), 0.0, 255.0)
    return np.asarray(scaled, dtype=np.uint8)


def statistics(image: NDArray[Any]) -> dict[str, Any]:
    """Return focus score, histogram, brightness and saturation of a picture.

    Notes
    -----
    The focus score is the standard deviation of the Laplacian over the mean brightness,
    in percent: it rises as edges grow sharp and does not follow the light.
    """
    import cv2

    bytes_ = as_bytes(image)
    grey = bytes_ if bytes_.ndim == 2 else cv2.cvtColor(bytes_, cv2.COLOR_BGR2GRAY)
    counts = cv2.calcHist([grey], [0], None, [64], [0, 256]).ravel()
    most = bytes_ if bytes_.ndim == 2 else bytes_.max(axis=2)
    mean = float(grey.mean())
    focus = float(cv2.Laplacian(grey, cv2.CV_32F).std()) / max(mean, 1.0) * 100.0
    return {
        "focus": focus,
        "histogram": (counts / counts.sum()).round(5).tolist(),
        "brightness": float(np.percentile(grey, 90)) / 255.0,
        "saturated_percent": 100.0 * float(np.mean(most >= 254)),
    }


def _rate(times_s: deque[float], now_s: float) -> float:
    recent = [time_s for time_s in list(times_s) if now_s - time_s < 3.0]
    if len(recent) < 2:
        return 0.0
    return (len(recent) - 1) / max(recent[-1] - recent[0], 1e-6)
