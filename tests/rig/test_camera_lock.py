"""Settings of a camera that obeys, and of all those that do not."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from magbend.core.errors import CameraError
from magbend.rig.camera import opencv as camera_opencv
from magbend.rig.camera.capture import CaptureCamera
from magbend.rig.camera.config import CameraConfig
from magbend.rig.camera.lock import AUTOMATIC, MANUAL, lock, not_kept
from magbend.rig.clock import SystemClock

EXPOSURE, AUTO = cv2.CAP_PROP_EXPOSURE, cv2.CAP_PROP_AUTO_EXPOSURE
CONFIG = CameraConfig(exposure=100.0, warmup_s=0.0, latency_s=0.0, frame_timeout_s=0.5)


class FakeCapture:
    """A camera in its shop state: automatic, and as stubborn as a test wants.

    As with the real ones, the exposure can be set in manual mode only.
    """

    def __init__(
        self,
        *,
        takes: Callable[[int, float], float] = lambda prop, value: value,
        accepts: Callable[[int], bool] = lambda prop: True,
        forgets: bool = False,
        needs_change: bool = False,
        frames: int = 10_000,
    ) -> None:
        self.values = {AUTO: MANUAL if needs_change else AUTOMATIC, EXPOSURE: 312.0}
        self.is_manual = False
        self.asked: list[tuple[int, float]] = []
        self._takes, self._accepts = takes, accepts
        self._forgets, self._needs_change = forgets, needs_change
        self._left = frames
        self.released = False

    def set(self, prop: int, value: float) -> bool:
        self.asked.append((prop, value))
        if not self._accepts(prop):
            return False
        if prop == AUTO:
            changes = self.values[AUTO] != value
            if changes or not self._needs_change:
                self.is_manual = value == MANUAL
        elif prop == EXPOSURE and not self.is_manual:
            return False
        self.values[prop] = self._takes(prop, value)
        return True

    def get(self, prop: int) -> float:
        return self.values.get(prop, 0.0)

    def read(self) -> tuple[bool, np.ndarray | None]:
        self._left -= 1
        if self._left < 0:
            return False, None
        if self._forgets:
            self.values |= {AUTO: AUTOMATIC, EXPOSURE: 312.0}
        noise = np.random.default_rng(self._left).integers(90, 110, (24, 32))
        return True, noise.astype(np.uint8)

    def isOpened(self) -> bool:
        return True

    def getBackendName(self) -> str:
        return "V4L2"

    def release(self) -> None:
        self.released = True


def _notes(**behaviour) -> list[str]:
    return not_kept(lock(FakeCapture(**behaviour), CONFIG))


def test_a_camera_that_obeys_is_manual_before_its_exposure_is_set():
    camera = FakeCapture()
    settings = lock(camera, CONFIG)
    assert not_kept(settings) == []
    assert camera.asked == [(AUTO, AUTOMATIC), (AUTO, MANUAL), (EXPOSURE, 100.0)]
    assert settings["exposure"] == {
        "asked": 100.0, "accepted": True, "read_back": 100.0,
    }  # fmt: skip


def test_a_camera_that_only_heeds_a_change_of_mode_is_locked_too():
    camera = FakeCapture(needs_change=True)
    assert not_kept(lock(camera, CONFIG)) == []
    assert camera.is_manual


def test_nothing_is_touched_that_was_not_asked_for():
    camera = FakeCapture()
    assert lock(camera, CameraConfig()) == {}
    assert camera.asked == []


@pytest.mark.parametrize(
    ("behaviour", "sentences"),
    [
        ({"accepts": lambda prop: False}, ["refused auto_exp", "refused exposure"]),
        ({"accepts": lambda prop: prop != EXPOSURE}, ["refused exposure = 100"]),
        ({"accepts": lambda prop: prop != AUTO}, ["refused auto", "refused exposure"]),
        (
            {"takes": lambda prop, value: 156.0 if prop == EXPOSURE else value},
            ["made 156 of exposure = 100"],
        ),
        (
            {"takes": lambda prop, value: AUTOMATIC if prop == AUTO else value},
            [f"made {AUTOMATIC:g} of auto_exposure"],
        ),
        ({"takes": lambda prop, value: round(value / 3.0) * 3.0 or 1.0}, None),
    ],
    ids=["all refused", "no exposure", "no mode", "clipped", "stays auto", "rounded"],
)
def test_every_way_not_to_obey_is_a_sentence(behaviour, sentences):
    notes = _notes(**behaviour)
    if sentences is None:
        assert not any(" exposure" in note for note in notes)
        return
    assert len(notes) == len(sentences)
    for note, part in zip(notes, sentences, strict=True):
        assert part in note


def test_white_balance_is_taken_off_automatic_first():
    camera = FakeCapture()
    lock(camera, CameraConfig(white_balance_K=5000.0))
    assert camera.asked == [
        (cv2.CAP_PROP_AUTO_WB, 0.0), (cv2.CAP_PROP_WB_TEMPERATURE, 5000.0),
    ]  # fmt: skip


def _camera(monkeypatch, *fakes: FakeCapture) -> CaptureCamera:
    queue = list(fakes)
    monkeypatch.setattr(
        camera_opencv.cv2,
        "VideoCapture",
        lambda *_: queue.pop(0) if queue else fakes[-1],
    )
    clock = SystemClock()
    return CaptureCamera(
        lambda: camera_opencv.OpenCvSource(0, CONFIG, clock), "0", CONFIG, clock
    )


def test_a_setting_forgotten_when_the_pictures_begin_is_found(monkeypatch):
    camera = _camera(monkeypatch, FakeCapture(forgets=True))
    identity = camera.identity
    camera.close()
    assert identity["api"] == "V4L2"
    assert identity["settings"]["exposure"]["read_back"] == 312.0
    assert any("made 312 of exposure = 100" in note for note in identity["notes"])


def test_a_camera_opened_anew_is_locked_anew(monkeypatch):
    first, second = FakeCapture(frames=20), FakeCapture()
    camera = _camera(monkeypatch, first, second)
    frame = camera.newest()
    while first._left >= 0 or (frame and frame.number <= 21):
        frame = camera.grab_after(camera._clock.monotonic_s())
    identity = camera.identity
    camera.close()
    assert first.released
    assert second.asked == first.asked
    assert identity["reopened"] >= 1
    assert identity["notes"] == []


def test_a_device_that_opens_and_gives_nothing_is_named(monkeypatch):
    with pytest.raises(CameraError, match="stalled or was closed"):
        _camera(monkeypatch, FakeCapture(frames=0))
