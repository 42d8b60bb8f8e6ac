"""A film of a rod, followed from frame to frame."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.checks import positive
from ...core.errors import VisionError
from ...core.progress import Progress, silent
from ..extraction.follow import follow
from ..extraction.ring import Ringing, ring_down
from ..extraction.setting import Setting
from ..measurement import NAN2, Measurement
from ..picture.photo import Photo, as_photo, refuse_special
from ..picture.video import Video


def read_film(path: Path) -> tuple[float, int, Iterator[Photo]]:
    """Open a film.

    Returns
    -------
    fps : float
        Frames per second by the file; 0 where it does not say.
    count : int
        How many frames it promises.
    frames : iterator of Photo
        One after the other, until the film ends or cannot be decoded any more.

    Raises
    ------
    VisionError
        If there is no such film, or it cannot be opened.
    """
    if not path.exists():
        raise VisionError(f"{path}: there is no such file")
    refuse_special(path)
    film = Video(path)
    if not film.opened:
        raise VisionError(f"{path.name}: this video cannot be opened or has no frames")
    photos = (as_photo(pixels, source=path.name) for pixels in film.frames())
    return film.fps, film.count, photos


def ring_of_film(
    path: Path, setting: Setting, *, fps: float | None = None, settle_mm: float = 0.05,
    progress: Progress = silent,
) -> Ringing:  # fmt: skip
    """Return how the tip of a rod rings in a film that begins before it is let go.

    The tip is taken in the frame of the board: neither clamp nor camera moves in such a
    film, and in a picture the rod's own frame is known ten times less well than a tip.

    Parameters
    ----------
    path : Path
        The film.
    setting : Setting
        What is known; it needs a calibration.
    fps : float, optional
        Frames per second when it was taken, if the file says another rate (slow
        motion) or none.
    settle_mm : float
        Amplitude that counts as settled.
    progress : callable
        Called as ``progress(done, total)``.

    Raises
    ------
    VisionError
        If the film cannot be read, has no rate, or shows no vibration.
    """
    if setting.calibration is None:
        raise VisionError("a vibration is measured in mm: give a calibration")
    told, count, frames = read_film(path)
    rate = told if fps is None else positive(fps, "fps", "frames/s")
    if not rate > 0.0:
        raise VisionError(f"{path.name}: does not say its frames per second: give them")
    tips: list[NDArray[np.float64]] = []
    last: Measurement | None = None
    for number, photo in enumerate(frames, start=1):
        last = follow(photo, setting, last)
        at = NAN2 if last.pose is None else last.pose.to_board(np.array([last.tip_mm]))
        tips.append(np.ravel(at))
        progress(number, max(count, number))
    if last is None or not np.any(np.isfinite(tips)):
        why = "it has no frames" if last is None else last.reason
        raise VisionError(f"{path.name}: no frame could be measured: {why}")
    time_s = np.arange(len(tips)) / rate
    return ring_down(time_s, np.reshape(tips, (-1, 2)), settle_mm=settle_mm)
