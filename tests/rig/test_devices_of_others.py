"""Meters and cameras of other packages, found by name and held to the same promises."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from magbend.core.errors import ConfigError, MeterError
from magbend.rig.bench.open import open_camera, open_meter
from magbend.rig.camera.config import CameraConfig
from magbend.rig.clock import SystemClock
from magbend.rig.meter.config import MeterConfig

CAMERA = """
import time
import numpy as np
from pydantic import BaseModel

class GreyCamera:
    class Options(BaseModel):
        level: int = 100

    def __init__(self, config, options, clock):
        self.level, self.clock = options.level, clock

    @property
    def identity(self):
        return {"maker": "lab", "level": self.level}

    def open(self): pass

    def read(self):
        time.sleep(0.005)
        noise = np.random.default_rng().integers(0, 9, (48, 64))
        return (self.level + noise).astype(np.uint8), self.clock.monotonic_s()

    def close(self): pass
"""


@pytest.fixture(autouse=True)
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "examples")
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "grey_camera.py").write_text(CAMERA)
    info = tmp_path / "lab_devices-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: lab-devices\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[magbend.meters]\nhall_xyz = hall_xyz_meter:HallXyz\ngone = no_such:thing\n"
        "[magbend.cameras]\ngrey = grey_camera:GreyCamera\n"
    )
    yield
    sys.modules.pop("grey_camera", None)


@pytest.fixture
def sensor(monkeypatch: pytest.MonkeyPatch):
    """The sensor's end of a line; what is written there is read by the meter."""
    if not hasattr(os, "openpty"):
        pytest.skip("needs POSIX")
    ours, theirs = os.openpty()
    os.set_blocking(ours, False)
    yield ours, os.ttyname(theirs)
    os.close(ours)
    os.close(theirs)


def meter_on(port: str, **options):
    table = {"axis": (0.0, 3.0, 4.0), "mT_per_unit": 1e-3, "timeout_s": 0.05}
    config = MeterConfig(driver="hall_xyz", port=port, sign=-1, options=table | options)
    return open_meter(config, Path())


def speak(meter, ours: int, lines: bytes):
    """Let the sensor speak just after the meter has emptied its buffer."""
    empty = meter._port.reset_input_buffer

    def then_speak() -> None:
        empty()
        os.write(ours, lines)

    meter._port.reset_input_buffer = then_speak
    return meter.read_flux(2, gap_mm=60.0)


def test_a_sensor_of_three_axes_reads_along_one(sensor) -> None:
    meter = meter_on(sensor[1])
    flux = speak(meter, sensor[0], b"7,99\n0,1000,2000\n5,1000,2010\n")
    # (0, 1000, 2000) along (0, .6, .8) is 2200 uT; the torn first line is not taken.
    assert flux.status == "ok"
    assert flux.flux_mT == pytest.approx(-0.5 * (2.2 + 2.208))
    assert meter.identity["driver"] == "hall_xyz"
    meter.close()


@pytest.mark.parametrize(
    ("lines", "status"),
    [
        (b"", "silent"),
        (b"1,2,3\n1,2\n1,2,x\n", "garbled"),
        (b"1,2,3\n1,2,inf\n1,2,3\n", "overload"),
        (b"1,2,3\n1,2,3\n1,2", "ok"),
    ],
)
def test_what_is_no_reading_says_so(sensor, lines, status) -> None:
    assert speak(meter_on(sensor[1]), sensor[0], lines).status == status


def test_wrong_keys_and_broken_packages_are_one_sentence(sensor) -> None:
    with pytest.raises(ConfigError, match=r"meter\.options\.mT_per_unit: .*hall_xyz"):
        meter_on(sensor[1], mT_per_unit=-1.0)
    with pytest.raises(MeterError, match="does not open"):
        meter_on("/dev/no-such-port")
    with pytest.raises(ConfigError, match="package lab-devices cannot be loaded"):
        open_meter(MeterConfig(driver="gone", port="x"), Path())


def test_a_camera_of_others_hands_out_pictures_that_began_after_the_question() -> None:
    clock = SystemClock()
    config = CameraConfig(
        backend="grey", source="left", options={"level": 120}, warmup_s=0.0,
        latency_s=0.0,
    )  # fmt: skip
    camera = open_camera(config, Path(), clock)
    try:
        asked_s = clock.monotonic_s()
        frame = camera.grab_after(asked_s)
        assert frame.arrival_s > asked_s
        assert 120 <= np.mean(frame.image) <= 129
    finally:
        camera.close()


def test_an_unknown_backend_lists_ours_and_theirs() -> None:
    with pytest.raises(ValueError, match=r"grey, mjpeg, opencv.*'gray'"):
        CameraConfig(backend="gray")
    with pytest.raises(ValueError, match="auto has none"):
        CameraConfig(options={"level": 1})
