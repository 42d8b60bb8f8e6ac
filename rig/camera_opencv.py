"""Cameras and streams that OpenCV opens: device index, device file, network URL.

OpenCV reports neither a stalled stream nor a refused setting by itself: the time-outs
are set on opening, every setting is read back, and after any failure the device is
opened anew, since the old object never recovers.
"""

from __future__ import annotations

import sys
from typing import Any

import cv2
import numpy as np

from ..core.errors import CameraError
from .camera import Image
from .camera_mjpeg import decode_jpeg
from .clock import Clock
from .config import CameraConfig

_SETTINGS = {
    "width_px": cv2.CAP_PROP_FRAME_WIDTH,
    "height_px": cv2.CAP_PROP_FRAME_HEIGHT,
    "exposure": cv2.CAP_PROP_EXPOSURE,
    "gain": cv2.CAP_PROP_GAIN,
    "white_balance_K": cv2.CAP_PROP_WB_TEMPERATURE,
}
# V4L2: 3 is automatic, 1 manual; often only the change from one to the other works.
# DirectShow: 0.75 is automatic, 0.25 manual.
_MANUAL = (3.0, 1.0) if sys.platform.startswith("linux") else (0.75, 0.25)


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
        self._config = config
        self._clock = clock
        self._capture: cv2.VideoCapture | None = None
        self._settings: dict[str, Any] = {}
        self._is_raw = False

    @property
    def identity(self) -> dict[str, Any]:
        """Return OpenCV's backend and every setting as asked, accepted, read back."""
        name = self._capture.getBackendName() if self._capture else None
        return {"backend": "opencv", "api": name, "settings": self._settings}

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
                f"camera {self._source!r} cannot be opened; magbend doctor lists the "
                f"cameras that answer"
            )
        self._settings = self._lock(self._capture)
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
            raise CameraError(f"camera {self._source!r} is not open")
        is_read, image = self._capture.read()
        if not is_read or image is None:
            raise CameraError(f"camera {self._source!r} stalled or was closed")
        if self._is_raw:
            return decode_jpeg(image.tobytes()), began_s
        return np.asarray(image), began_s

    def close(self) -> None:
        """Release the device."""
        if self._capture is not None:
            self._capture.release()
            self._capture = None

    def _lock(self, capture: cv2.VideoCapture) -> dict[str, Any]:
        settings: dict[str, Any] = {}
        if self._config.exposure is not None:
            accepted = [
                capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, value) for value in _MANUAL
            ]
            settings["auto_exposure"] = {
                "asked": _MANUAL[-1],
                "accepted": accepted[-1],
                "read_back": capture.get(cv2.CAP_PROP_AUTO_EXPOSURE),
            }
        if self._config.white_balance_K is not None:
            capture.set(cv2.CAP_PROP_AUTO_WB, 0)
        for name, prop in _SETTINGS.items():
            asked = getattr(self._config, name)
            if asked is not None:
                settings[name] = {
                    "asked": asked,
                    "accepted": capture.set(prop, float(asked)),
                    "read_back": capture.get(prop),
                }
        return settings
