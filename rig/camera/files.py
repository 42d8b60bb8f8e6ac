"""Pictures that are files: a folder replayed, a folder watched, a video."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ...core.door import read_file
from ...core.errors import CameraError
from ...core.picture import decode_picture
from ..clock import Check, Clock, go_on, utc_text, wait
from .protocol import Frame, Image

_SUFFIXES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".ppm"}
_POLL_S = 0.05


def list_images(folder: Path) -> list[Path]:
    """Return the pictures of a folder in natural order: 2 comes before 10.

    Raises
    ------
    CameraError
        If there is no such folder.
    """
    if not folder.is_dir():
        raise CameraError(f"{folder}: there is no such folder of pictures")
    found = [
        path
        for path in folder.iterdir()
        if path.suffix.lower() in _SUFFIXES and not path.name.startswith(".")
    ]
    return sorted(found, key=_natural)


def _natural(path: Path) -> list[tuple[int, str]]:
    parts = re.split(r"(\d+)", path.name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]


def read_image(path: Path) -> Image:
    """Return a picture as it is stored.

    Raises
    ------
    CameraError
        If it cannot be decoded.
    """
    data = read_file(path, 256.0, CameraError)
    return np.asarray(decode_picture(data, str(path), CameraError))


class FolderCamera:
    """Replay a folder: the first picture for step 0, the second for step 1, and so on.

    Raises
    ------
    CameraError
        If the folder is missing or empty.
    """

    def __init__(self, folder: Path, clock: Clock) -> None:
        self._paths = list_images(folder)
        if not self._paths:
            raise CameraError(f"{folder}: holds no picture")
        self._folder = folder
        self._clock = clock
        self._index = 0
        self._number = 0

    @property
    def identity(self) -> dict[str, Any]:
        """Return folder and number of pictures."""
        return {
            "backend": "folder", "source": str(self._folder),
            "pictures": len(self._paths),
        }  # fmt: skip

    def at_step(self, index: int, gap_mm: float) -> None:
        """Turn to the picture of this step."""
        del gap_mm
        self._index = index

    def grab_after(self, time_s: float, *, check: Check = go_on) -> Frame:
        """Return the picture of the present step, as if it were taken now.

        Raises
        ------
        CameraError
            If the folder has no picture for this step.
        """
        if self._index >= len(self._paths):
            raise CameraError(
                f"{self._folder}: must hold a picture for every step; instead it holds "
                f"{len(self._paths)} and step {self._index + 1} was asked for"
            )
        image = read_image(self._paths[self._index])
        wait_s = max(time_s - self._clock.monotonic_s(), 0.0) + _POLL_S
        wait(self._clock, wait_s, check)
        self._number += 1
        return _frame(image, self._clock, self._number)

    def close(self) -> None:
        """Do nothing."""


class WatchedFolderCamera:
    """Take pictures that another program saves into a folder (tethered cameras)."""

    def __init__(self, folder: Path, clock: Clock, *, timeout_s: float) -> None:
        self._folder = folder
        self._clock = clock
        self._timeout_s = timeout_s
        self._seen = set(list_images(folder))
        self._number = 0

    @property
    def identity(self) -> dict[str, Any]:
        """Return the folder."""
        return {"backend": "folder", "source": str(self._folder), "watch": True}

    def at_step(self, index: int, gap_mm: float) -> None:
        """Forget what was saved before: it shows an earlier step."""
        del index, gap_mm
        self._seen = set(list_images(self._folder))

    def grab_after(self, time_s: float, *, check: Check = go_on) -> Frame:
        """Return a picture that was saved after this call, once it is whole.

        Raises
        ------
        CameraError
            If none is saved in time.
        """
        deadline_s = max(time_s, self._clock.monotonic_s()) + self._timeout_s
        while self._clock.monotonic_s() < deadline_s:
            check()
            for path in list_images(self._folder):
                if path not in self._seen and (image := self._whole(path)) is not None:
                    self._seen.add(path)
                    self._number += 1
                    return _frame(image, self._clock, self._number)
            self._clock.sleep(_POLL_S)
        raise CameraError(
            f"{self._folder}: a new picture must be saved within "
            f"{self._timeout_s:g} s; instead none came"
        )

    def close(self) -> None:
        """Do nothing."""

    def _whole(self, path: Path) -> Image | None:
        """Return the picture if the file has stopped growing and can be decoded."""
        try:
            size = path.stat().st_size
            self._clock.sleep(_POLL_S)
            return read_image(path) if path.stat().st_size == size else None
        except (OSError, CameraError):
            return None


class VideoCamera:
    """Replay a video frame by frame, at the pace of its own frame rate.

    Raises
    ------
    CameraError
        If it cannot be opened.
    """

    def __init__(self, path: Path, clock: Clock) -> None:
        self._path = path
        self._clock = clock
        self._capture = cv2.VideoCapture(str(path))
        if not self._capture.isOpened():
            raise CameraError(f"{path}: is not a video that can be read")
        rate = self._capture.get(cv2.CAP_PROP_FPS)
        self._frame_s = 1.0 / rate if rate > 0.0 else 0.04
        self._number = 0

    @property
    def identity(self) -> dict[str, Any]:
        """Return file and frame time."""
        return {
            "backend": "video", "source": str(self._path), "frame_s": self._frame_s,
        }  # fmt: skip

    def at_step(self, index: int, gap_mm: float) -> None:
        """Take no note: the video goes on."""

    def grab_after(self, time_s: float, *, check: Check = go_on) -> Frame:
        """Return the next frame of the video.

        Raises
        ------
        CameraError
            If the video is over.
        """
        is_read, image = self._capture.read()
        if not is_read:
            raise CameraError(f"{self._path}: the video is over")
        wait_s = max(time_s - self._clock.monotonic_s(), 0.0) + self._frame_s
        wait(self._clock, wait_s, check)
        self._number += 1
        return _frame(np.asarray(image), self._clock, self._number)

    def close(self) -> None:
        """Release the file."""
        self._capture.release()


def _frame(image: Image, clock: Clock, number: int) -> Frame:
    return Frame(
        image=image, arrival_s=clock.monotonic_s(), number=number,
        time_utc=utc_text(clock),
    )  # fmt: skip
