"""Lock what a camera would change by itself, and find out what it made of it.

A camera may refuse a setting, take another value, say that it took it and not do so, or
forget it when the pictures begin to flow. So each setting is asked for, read back at
once and again after the first picture; the brightness of the photographs has the last
word (`camera.photo_flags`).
"""

from __future__ import annotations

import math
import sys
from typing import Any, Protocol

import cv2

from .config import CameraConfig

PROPERTIES = {
    "width_px": cv2.CAP_PROP_FRAME_WIDTH,
    "height_px": cv2.CAP_PROP_FRAME_HEIGHT,
    "auto_exposure": cv2.CAP_PROP_AUTO_EXPOSURE,
    "exposure": cv2.CAP_PROP_EXPOSURE,
    "gain": cv2.CAP_PROP_GAIN,
    "auto_white_balance": cv2.CAP_PROP_AUTO_WB,
    "white_balance_K": cv2.CAP_PROP_WB_TEMPERATURE,
    "auto_focus": cv2.CAP_PROP_AUTOFOCUS,
    "focus": cv2.CAP_PROP_FOCUS,
}
"""In the order in which they are set: the manual mode before its value."""

# V4L2: 3 is automatic, 1 manual; often only the change from one to the other works.
# DirectShow: 0.75 is automatic, 0.25 manual.
AUTOMATIC, MANUAL = (3.0, 1.0) if sys.platform.startswith("linux") else (0.75, 0.25)

Settings = dict[str, dict[str, Any]]
"""Name to ``asked``, ``accepted`` (by `set`) and ``read_back``."""


class Adjustable(Protocol):
    """What OpenCV's ``VideoCapture`` offers for settings."""

    def set(self, prop: int, value: float, /) -> bool:
        """Ask for a value; return whether the driver took it."""
        ...

    def get(self, prop: int, /) -> float:
        """Return the present value, or 0 or -1 for what it does not have."""
        ...


def lock(capture: Adjustable, config: CameraConfig) -> Settings:
    """Ask for every setting of the rig file; return what became of each."""
    settings: Settings = {}
    for name, prop in PROPERTIES.items():
        asked = _asked(name, config)
        if asked is None:
            continue
        if name == "auto_exposure":
            capture.set(prop, AUTOMATIC)
        settings[name] = {"asked": asked, "accepted": capture.set(prop, asked)}
    read_back(capture, settings)
    return settings


def read_back(capture: Adjustable, settings: Settings) -> None:
    """Note what the camera says of its settings now."""
    for name, setting in settings.items():
        setting["read_back"] = capture.get(PROPERTIES[name])


def not_kept(settings: Settings) -> list[str]:
    """Return a sentence for each setting that the camera did not keep."""
    notes = []
    for name, setting in settings.items():
        asked, now = setting["asked"], setting["read_back"]
        # Cameras round to their own steps; a step of an exposure may be a few percent.
        if not setting["accepted"]:
            notes.append(f"the camera refused {name} = {asked:g} (it says {now:g})")
        elif not math.isclose(asked, now, rel_tol=0.05, abs_tol=1e-9):
            notes.append(f"the camera made {now:g} of {name} = {asked:g}")
    return notes


def _asked(name: str, config: CameraConfig) -> float | None:
    if name == "auto_exposure":
        return None if config.exposure is None else MANUAL
    if name == "auto_white_balance":
        return None if config.white_balance_K is None else 0.0
    if name == "auto_focus":
        return None if config.focus is None else 0.0
    value = getattr(config, name)
    return None if value is None else float(value)
