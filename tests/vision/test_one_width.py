"""A shade as dark as its rod shows in how the width changes with direction."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.vision.camera.calibrate import calibrate_known_length
from magbend.vision.extraction.one_width import is_uneven
from magbend.vision.extraction.setting import Setting
from magbend.vision.measurement import Measurement

N = 80
THETA = np.linspace(0.0, 1.4, N)


def rod(width, per_mm=np.nan):
    """Return a bent rod 400 px long, measured with a width in px, and so many a mm."""
    step = 400.0 / N * np.column_stack([np.cos(THETA), np.sin(THETA)])
    x, y = np.cumsum(step, axis=0).T
    points = {
        "x_px": x, "y_px": y, "theta_rad": THETA, "good": np.ones(N),
        "width_px": np.broadcast_to(width, N),
    }  # fmt: skip
    points["width_mm"] = points["width_px"] / per_mm
    return Measurement(status="ok", points=points, width_px=float(np.median(width)))


@pytest.mark.parametrize("towards_deg", [0.0, 60.0, 150.0])
def test_rod_and_shade_as_one_are_wider_the_more_it_turns_from_their_shift(towards_deg):
    both = 20.0 + 12.0 * np.abs(np.sin(THETA - np.radians(towards_deg)))
    assert is_uneven(rod(both), Setting())


def test_an_even_rod_a_taper_and_a_little_noise_are_no_doubt():
    noise = np.random.default_rng(0).normal(0.0, 0.3, N)
    assert not is_uneven(rod(20.0 + noise), Setting())
    assert not is_uneven(rod(np.linspace(24.0, 14.0, N)), Setting())


@pytest.mark.parametrize(
    ("told", "uneven"), [(None, False), (True, False), (False, True)]
)
def test_a_round_rod_that_a_near_camera_sees_aslant_is_even(told, uneven):
    near = calibrate_known_length(
        (800, 500), from_px=(0.0, 0.0), to_px=(400.0, 0.0), length_mm=20.0,
        camera_height_mm=20.0,
    )  # fmt: skip
    points = rod(20.0).points
    axis = np.column_stack([points["x_px"], points["y_px"]])
    is_round = Setting(calibration=near, is_round=True)
    view = is_round.view(near, axis, THETA)
    seen = is_round.silhouette(view)
    setting = Setting(calibration=near, is_round=told)
    measured = rod(1.0 * seen, setting.silhouette(view))
    assert is_uneven(measured, setting) == uneven
