"""Cameras and streams that OpenCV opens: device index, device file, network URL.

OpenCV reports neither a stalled stream nor a refused setting by itself: the time-outs
are set on opening, every setting is read back, and after any failure the device is
opened anew, since the old object never recovers.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from ...core.errors import CameraError
from ...core.urls import without_secrets
from ..clock import Clock
from .config import CameraConfig
from .lock import Settings, lock, not_kept, read_back
from .mjpeg import decode_jpeg
from .protocol import Image


class OpenCvSource:
    """A device or network stream read through OpenCV.

    Parameters
    ----------
    source : int or str
        Device index, device file or URL.
    config : CameraConfig
        Settings to lock, time-outs.
    clock : Clock
        Time.
    """

    def __init__(self, source: int | str, config: CameraConfig, clock: Clock) -> None:
        self._source = source
        self._name = without_secrets(str(source))
        self._config = config
        self._clock = clock
        self._capture: cv2.VideoCapture | None = None
        self._settings: Settings = {}
        self._is_raw = False
        self._is_first = True

    @property
    def identity(self) -> dict[str, Any]:
        """Return OpenCV's backend and every setting as asked, accepted, read back."""
        name = self._capture.getBackendName() if self._capture else None
        return {
            "backend": "opencv",
            "api": name,
            "settings": self._settings,
            "notes": not_kept(self._settings),
        }

    def open(self) -> None:
        """Open the device and lock its settings.

        Raises
        ------
        CameraError
            If OpenCV cannot open it.
        """
        timeout_ms = int(self._config.frame_timeout_s * 1000)
        if isinstance(self._source, str) and "://" in self._source:
            options = [
                cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, timeout_ms,
                cv2.CAP_PROP_READ_TIMEOUT_MSEC, timeout_ms,
                cv2.CAP_PROP_N_THREADS, 1,
            ]  # fmt: skip
            self._capture = cv2.VideoCapture(self._source, cv2.CAP_FFMPEG, options)
        else:
            self._capture = cv2.VideoCapture(self._source)
        if not self._capture.isOpened():
            raise CameraError(
                f"camera {self._name!r} cannot be opened; magbend doctor lists the "
                f"cameras that answer"
            )
        self._settings = lock(self._capture, self._config)
        self._is_first = True
        # Undecoded parts of a motion JPEG show what the decoder hides: a missing end.
        code = int(self._capture.get(cv2.CAP_PROP_FOURCC))
        is_network = isinstance(self._source, str) and "://" in self._source
        self._is_raw = (
            is_network
            and code == cv2.VideoWriter.fourcc(*"MJPG")
            and self._capture.set(cv2.CAP_PROP_FORMAT, -1)
        )

    def read(self) -> tuple[Image, float]:
        """Return the next picture and when its reading began.

        Raises
        ------
        BrokenPictureError
            If a motion JPEG part is no whole JPEG.
        CameraError
            If the device gives none: it is dead then, and must be opened anew.
        """
        began_s = self._clock.monotonic_s()
        if self._capture is None:
            raise CameraError(f"camera {self._name!r} is not open")
        is_read, image = self._capture.read()
        if not is_read or image is None:
            raise CameraError(f"camera {self._name!r} stalled or was closed")
        if self._is_first:  # some forget their settings when the pictures begin
            read_back(self._capture, self._settings)
            self._is_first = False
        if self._is_raw:
            return decode_jpeg(image.tobytes()), began_s
        return np.asarray(image), began_s

    def close(self) -> None:
        """Release the device."""
        if self._capture is not None:
            self._capture.release()
            self._capture = None
