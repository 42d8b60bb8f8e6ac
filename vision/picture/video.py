"""The frames of a video, in colour only where it has any.

Machine vision films are grey. To turn their light into three equal colours, and these
into light again, takes as long as a third of the decoding.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from cv2.utils import logging
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]

_CODES = np.arange(256.0)
_RANGES = tuple(
    np.clip(np.rint(levels), 0.0, 255.0).astype(np.uint8)
    for levels in (_CODES, (_CODES - 16.0) * 255.0 / 219.0)
)
"""Grey of a code of the luma Y, which has the full range, or that of ITU-R BT.601."""


class Video:
    """An open video that reads on without seeking where it can.

    Parameters
    ----------
    path : Path
        The file.
    """

    def __init__(self, path: Path) -> None:
        self._film: Any = cv2.VideoCapture(str(path))
        self._levels: Bytes | None = None
        self._next = 0
        if self.opened and (levels := _levels_of_grey(path)) is not None:
            self._film.release()
            self._film, self._levels = _open_codes(path), levels

    @property
    def opened(self) -> bool:
        """Whether the decoder took the file."""
        return bool(self._film.isOpened())

    @property
    def fps(self) -> float:
        """Frames per second by the file; 0 where it does not say."""
        fps = self._film.get(cv2.CAP_PROP_FPS)
        return float(fps) if fps and np.isfinite(fps) else 0.0

    @property
    def count(self) -> int:
        """How many frames it promises."""
        return int(self._film.get(cv2.CAP_PROP_FRAME_COUNT))

    def read(self, frame: int) -> Bytes | None:
        """Return one frame, grey or blue green red; None where it cannot be decoded."""
        if frame != self._next:
            self._film.set(cv2.CAP_PROP_POS_FRAMES, frame)
        self._next = frame + 1
        with _quiet():
            found, pixels = self._film.read()
        if not found or self._levels is None:
            return np.asarray(pixels) if found else None
        return np.asarray(cv2.LUT(pixels, self._levels), np.uint8)

    def frames(self) -> Iterator[Bytes]:
        """Yield all frames until one cannot be decoded; then close the file."""
        try:
            while (pixels := self.read(self._next)) is not None:
                yield pixels
        finally:
            self._film.release()


def count_frames(path: Path) -> int:
    """Return how many frames a video promises; 0 where it is none."""
    film = cv2.VideoCapture(str(path))
    try:
        return int(film.get(cv2.CAP_PROP_FRAME_COUNT)) if film.isOpened() else 0
    finally:
        film.release()


def _levels_of_grey(path: Path) -> Bytes | None:
    """Return the grey of each code of luma that the decoder gives as it is.

    None where the first frame has colour, or where what the decoder gives is no luma.
    """
    seen, whole = cv2.VideoCapture(str(path)).read()
    with _quiet():
        found, codes = _open_codes(path).read()
    if not (seen and found) or whole.ndim != 3 or codes.shape != whole.shape[:2]:
        return None
    grey = whole[..., 0]
    if codes.dtype != np.uint8 or any((whole[..., k] != grey).any() for k in (1, 2)):
        return None
    close = (x for x in _RANGES if cv2.absdiff(cv2.LUT(codes, x), grey).max() <= 1)
    return next(close, None)


def _open_codes(path: Path) -> Any:
    with _quiet():
        options = [cv2.CAP_PROP_CONVERT_RGB, 0]
        return cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, options)


@contextmanager
def _quiet() -> Iterator[None]:
    """Let OpenCV not warn that what it hands out may be no luma, which is checked."""
    level = logging.setLogLevel(logging.LOG_LEVEL_ERROR)
    try:
        yield
    finally:
        logging.setLogLevel(level)
