from __future__ import annotations

import math
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magbend.core.errors import CameraError
from magbend.rig.bench.config import SettleConfig
from magbend.rig.camera.protocol import Frame
from magbend.rig.clock import SteppedClock
from magbend.rig.runs.settle import Settled, change_percent, settle
from magbend.rig.virtual.camera import VirtualCamera

CONFIG = SettleConfig(
    time_s=0.5, image_change_percent=0.02, frames=5, window_s=0.5, timeout_s=60.0
)


def picture(middle_px: float, generator: np.random.Generator) -> np.ndarray:
    """A dark bar, 8 px wide, with soft edges, on noisy paper."""
    rows = np.arange(120)[:, None] - middle_px
    cover = np.clip(4.5 - np.abs(rows), 0.0, 1.0)
    image = 215.0 - 180.0 * cover * np.ones((1, 160))
    image += generator.normal(0.0, 2.0, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def swinging(clock: SteppedClock, generator, **swing) -> VirtualCamera:
    return VirtualCamera(
        lambda gap_mm, time_s: picture(gap_mm, generator),
        lambda: 60.0,
        clock,
        frame_s=0.08,
        **swing,
    )


def test_noise_is_no_change_and_a_third_of_a_pixel_is() -> None:
    generator = np.random.default_rng(1)
    still = picture(60.0, generator)
    assert change_percent(still, picture(60.0, generator)) < 0.01
    assert change_percent(still, picture(60.3, generator)) > 1.0


def test_a_breathing_lamp_is_no_change() -> None:
    generator = np.random.default_rng(2)
    first = picture(60.0, generator)
    brighter = (picture(60.0, generator) * 0.97).astype(np.uint8)
    assert change_percent(first, brighter) < CONFIG.image_change_percent


def test_the_photograph_waits_until_the_rod_is_still() -> None:
    clock = SteppedClock()
    generator = np.random.default_rng(3)
    camera = swinging(clock, generator, swing_mm=8.0, swing_Hz=1.3, damping_s=1.5)
    camera.at_step(0, 70.0)
    settled = settle(camera, clock, CONFIG)
    left_px = 8.0 * math.exp(-(settled.time_s - CONFIG.window_s) / 1.5)
    print(
        f"settled after {settled.time_s:.1f} s with at most {left_px:.2f} px of swing"
    )
    assert settled.status == "settled"
    assert left_px < 0.5
    assert settled.time_s < 12.0


@pytest.mark.parametrize("swing_Hz", [0.2, 1.3, 5.0])
def test_a_turning_point_is_not_stillness(swing_Hz: float) -> None:
    clock = SteppedClock()
    camera = swinging(
        clock, np.random.default_rng(4), swing_mm=6.0, swing_Hz=swing_Hz, damping_s=1e9
    )
    camera.at_step(0, 70.0)
    short = CONFIG.model_copy(update={"timeout_s": 12.0})
    settled = settle(camera, clock, short)
    assert settled.status == "timeout"
    assert settled.time_s < 13.0


def test_a_busy_processor_times_nothing_out_on_a_fast_twin() -> None:
    def settled(clock: SteppedClock) -> Settled:
        still = picture(60.0, np.random.default_rng(4))

        def slow(gap_mm: float, time_s: float) -> np.ndarray:
            time.sleep(0.005)
            return still

        return settle(VirtualCamera(slow, lambda: 1.0, clock), clock, CONFIG)

    fast = SteppedClock(speed=1e4)
    start_s = time.monotonic()
    assert settled(fast) == settled(SteppedClock())
    assert time.monotonic() - start_s > fast.monotonic_s() / 1e4


def test_the_fixed_time_always_passes() -> None:
    clock = SteppedClock()
    camera = swinging(clock, np.random.default_rng(5))
    settled = settle(camera, clock, CONFIG.model_copy(update={"time_s": 7.0}))
    assert settled.status == "settled"
    assert settled.time_s >= 7.0 + CONFIG.window_s


def test_every_picture_is_newer_than_the_fixed_time() -> None:
    clock = SteppedClock()
    asked: list[float] = []

    class Recorder(VirtualCamera):
        def grab_after(self, time_s: float, **options) -> Frame:
            asked.append(time_s)
            return super().grab_after(time_s, **options)

    generator = np.random.default_rng(6)
    camera = Recorder(lambda g, t: picture(60.0, generator), lambda: 1.0, clock)
    settle(camera, clock, CONFIG)
    assert asked[0] >= CONFIG.time_s
    assert asked == sorted(asked)


def test_a_picture_of_another_size_is_refused() -> None:
    with pytest.raises(CameraError, match="picture size"):
        change_percent(np.zeros((4, 4), "u1"), np.zeros((4, 5), "u1"))


@given(
    shape=st.tuples(st.integers(1, 9), st.integers(1, 9)),
    dtype=st.sampled_from(["u1", "u2", "f4"]),
    seed=st.integers(0, 1000),
)
def test_a_picture_never_differs_from_itself(shape, dtype, seed) -> None:
    generator = np.random.default_rng(seed)
    image = (generator.random(shape) * (1.0 if dtype == "f4" else 255)).astype(dtype)
    assert change_percent(image, image) == 0.0
    coloured = np.stack([image] * 3, axis=2)
    assert change_percent(coloured, coloured) == 0.0
