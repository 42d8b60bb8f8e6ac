"""What a camera is to the runner: pictures that are provably newer than a moment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...core.errors import CameraError
from ..clock import Check, Clock, go_on

Image = NDArray[Any]
"""A picture, shape (h, w) or (h, w, 3) in OpenCV's blue-green-red order, as given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One picture and when it reached this computer.

    Parameters
    ----------
    image : ndarray, shape (h, w) or (h, w, 3)
        The picture as the camera gave it.
    arrival_s : float
        Monotonic time at which it had arrived whole.
    time_utc : str
        The same moment in UTC.
    number : int
        Counts every picture of the camera since it was opened.
    """

    image: Image
    arrival_s: float
    time_utc: str
    number: int


class Camera(Protocol):
    """A camera that is open.

    The runner calls `at_step` before the pictures of a step; backends that replay
    files use it to choose theirs, all others ignore it.
    """

    @property
    def identity(self) -> dict[str, Any]:
        """What the manifest keeps: source, backend, size, settings as read back."""
        ...

    def at_step(self, index: int, gap_mm: float) -> None:
        """Take note of the step that the next pictures belong to."""
        ...

    def grab_after(self, time_s: float, *, check: Check = go_on) -> Frame:
        """Return a picture that began to arrive after the monotonic time `time_s`.

        `check` is called while it waits.

        Raises
        ------
        CameraError
            If none comes within the camera's time-out.
        """
        ...

    def close(self) -> None:
        """Let the device go; harmless when done twice."""
        ...


class NoCamera:
    """No camera: for work in which no picture is taken."""

    @property
    def identity(self) -> dict[str, Any]:
        """Return that there is none."""
        return {"backend": "none"}

    def at_step(self, index: int, gap_mm: float) -> None:
        """Do nothing."""

    def grab_after(self, time_s: float, *, check: Check = go_on) -> Frame:
        """Refuse.

        Raises
        ------
        CameraError
            Always.
        """
        raise CameraError("there is no camera here, and a picture was asked for")

    def close(self) -> None:
        """Do nothing."""


def grab_median(
    camera: Camera, clock: Clock, frames: int, *, check: Check = go_on
) -> Frame:
    """Return the pixel-wise median of `frames` successive new pictures.

    `check` is called while it waits for them.

    Raises
    ------
    CameraError
        If a picture does not come, or they differ in size.
    """
    grabbed: list[Frame] = []
    after_s = clock.monotonic_s()
    for _ in range(frames):
        frame = camera.grab_after(after_s, check=check)
        grabbed.append(frame)
        after_s = frame.arrival_s
    last = grabbed[-1]
    return Frame(
        image=median([frame.image for frame in grabbed]), arrival_s=last.arrival_s,
        time_utc=last.time_utc, number=last.number,
    )  # fmt: skip


def median(images: Sequence[Image]) -> Image:
    """Return the pixel-wise median of pictures of one shape, in their own type.

    Raises
    ------
    CameraError
        If they differ in shape.
    """
    if len({image.shape for image in images}) != 1:
        raise CameraError("the camera must keep its picture size during a step")
    if len(images) == 1:
        return images[0]
    middle = np.median(np.stack(images), axis=0)
    if images[0].dtype.kind != "f":
        middle = np.rint(middle)
    return np.asarray(middle.astype(images[0].dtype))


def brightness(image: Image) -> float:
    """Return the brightness of the background: the 90th percentile, from 0 to 1."""
    full = 1.0 if image.dtype.kind == "f" else float(np.iinfo(image.dtype).max)
    return float(np.percentile(image, 90)) / full


def sharpness(image: Image) -> float:
    """Return the root mean square step between neighbours, in parts of full scale.

    It peaks where the picture is in focus; compare pictures of one scene only.
    """
    full = 1.0 if image.dtype.kind == "f" else float(np.iinfo(image.dtype).max)
    grey = image.astype(np.float32) if image.ndim == 2 else image.mean(2, np.float32)
    across = np.mean(np.square(np.diff(grey, axis=1)))
    down = np.mean(np.square(np.diff(grey, axis=0)))
    return float(np.sqrt(across + down)) / full


def encode_png(image: Image) -> bytes:
    """Return the picture as PNG, pixel for pixel.

    Raises
    ------
    CameraError
        If OpenCV cannot encode it.
    """
    import cv2

    is_written, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 3])
    if not is_written:
        raise CameraError(f"a picture of shape {image.shape} cannot be stored as PNG")
    return bytes(data.tobytes())
