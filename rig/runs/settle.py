"""When is the rod still? A fixed time, and pictures that no longer change.

Two pictures are compared after a two-by-two binning: what counts is the share of
pixels that changed by more than the noise of the difference itself (its median
absolute deviation, six times over) and by more than 4 % of full scale. A thin rod
that moves by a tenth of a pixel changes that share; camera noise and a lamp that
breathes do not.

Each picture is compared with the first of its window, not with the one just before it:
a slow swing moves little between neighbours, most of all at its turning points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.errors import CameraError
from ..bench.config import SettleConfig
from ..camera.protocol import Camera, Frame, Image
from ..clock import Check, Clock, go_on, wait

_FLOOR = 0.04
_NOISES = 6.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Settled:
    """How the settling of one step ended.

    Parameters
    ----------
    status : str
        ``settled``, ``timeout``, or ``waited`` (by time alone, no picture looked at).
    time_s : float
        From arrival of the stage until then.
    change_percent : float
        Share of pixels by which the last picture differed from the first of its window.
    frames : int
        Pictures looked at.
    """

    status: str
    time_s: float
    change_percent: float
    frames: int


def change_percent(first: Image, second: Image) -> float:
    """Return the share of pixels that changed between two pictures, in percent.

    Parameters
    ----------
    first, second : ndarray, shape (h, w) or (h, w, c)
        Pictures of one camera, 8 or 16 bit, or floats from 0 to 1.

    Raises
    ------
    CameraError
        If they differ in shape.
    """
    if first.shape != second.shape:
        raise CameraError(
            f"the camera must keep its picture size; instead received {second.shape} "
            f"after {first.shape}"
        )
    difference = _binned(second) - _binned(first)
    difference -= np.median(difference)
    magnitude = np.abs(difference)
    noise = 1.4826 * float(np.median(magnitude))
    changed = magnitude > max(_NOISES * noise, _FLOOR)
    return 100.0 * float(np.count_nonzero(changed)) / float(changed.size)


def _binned(image: Image) -> NDArray[np.float32]:
    """Return grey values from 0 to 1, each the mean of two by two pixels."""
    full = 1.0 if image.dtype.kind == "f" else float(np.iinfo(image.dtype).max)
    grey = _grey(image)
    h, w = (max(n // 2 * 2, 2) if n > 1 else 1 for n in grey.shape)
    grey = grey[:h, :w]
    if min(h, w) > 1:
        grey = 0.25 * (
            grey[0::2, 0::2] + grey[1::2, 0::2] + grey[0::2, 1::2] + grey[1::2, 1::2]
        )
    return grey / np.float32(full)


def _grey(image: Image) -> NDArray[np.float32]:
    """Return the mean of the channels, which numpy's own mean takes 7 times as long."""
    if image.ndim == 2:
        return image.astype(np.float32)
    grey = image[..., 0].astype(np.float32)
    for channel in range(1, image.shape[2]):
        grey += image[..., channel]
    return grey / np.float32(image.shape[2])


class StillnessJudge:
    """Count pictures that are all like the first of their window."""

    def __init__(self, config: SettleConfig) -> None:
        self._config = config
        self._anchor: Frame | None = None
        self._still = 0
        self.change_percent = 100.0

    def is_still(self, frame: Frame) -> bool:
        """Take the next picture; return whether enough of them were alike.

        Raises
        ------
        CameraError
            If the camera changed its picture size.
        """
        config = self._config
        if self._anchor is None:
            self._anchor = frame
            return False
        self.change_percent = change_percent(self._anchor.image, frame.image)
        if self.change_percent > config.image_change_percent:
            self._anchor, self._still = frame, 0
            return False
        self._still += 1
        window_s = frame.arrival_s - self._anchor.arrival_s
        return self._still >= config.frames - 1 and window_s >= config.window_s


def settle(
    camera: Camera,
    clock: Clock,
    config: SettleConfig,
    *,
    check: Check = go_on,
) -> Settled:
    """Wait until the rod is still, or until the time is up.

    Parameters
    ----------
    camera : Camera
        Where the pictures come from.
    clock : Clock
        What waits; called right after the stage arrived.
    config : SettleConfig
        Fixed time, threshold, number of pictures, time-out.
    check : callable
        Called ten times a second; it may raise, to end the wait.

    Returns
    -------
    Settled
        Status ``timeout`` is a result: the caller flags the step.

    Raises
    ------
    CameraError
        If no picture comes.
    """
    start_s = clock.monotonic_s()
    wait(clock, config.time_s, check)
    if config.by == "time":
        return Settled(
            status="waited", time_s=config.time_s, change_percent=0.0, frames=0
        )
    judge = StillnessJudge(config)
    after_s = clock.monotonic_s()
    frames = 0
    while True:
        frame = camera.grab_after(after_s, check=check)
        frames += 1
        is_still = judge.is_still(frame)
        elapsed_s = clock.monotonic_s() - start_s
        if is_still or elapsed_s > config.timeout_s:
            return Settled(
                status="settled" if is_still else "timeout", time_s=elapsed_s,
                change_percent=judge.change_percent, frames=frames,
            )  # fmt: skip
        after_s = frame.arrival_s
