"""A second rod, as dark and as wide, that lies across the one in the clamp."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.vision import Pose, as_photo, extract
from magbend.vision.synthetic import (
    Block,
    Rod,
    Scene,
    curve,
    render_scene,
    scene_camera,
)

CAMERA = scene_camera(
    size_px=(1600, 1200), focal_px=6800.0, tilt_deg=3.0, target_mm=(15.0, 0.0)
)


def found_under(*others: Rod):
    pose = Pose(x_mm=0.0, y_mm=-5.0, angle_deg=5.0, height_mm=1.1)
    line = curve("graded", angle_deg=60.0, length_mm=28.0)
    scene = Scene(clamp=Block(pose=pose), centreline=line, others=others)
    picture = render_scene(scene, CAMERA, np.random.default_rng(0))
    return extract(as_photo(picture), CAMERA, rod_height_mm=1.1)


def across(x_mm: float, y_mm: float, angle_deg: float) -> Rod:
    line = curve("arc", angle_deg=20.0, length_mm=22.0)
    pose = Pose(x_mm=x_mm, y_mm=y_mm, angle_deg=angle_deg, height_mm=2.2)
    return Rod(line=line, pose=pose)


def test_a_rod_is_measured_under_a_second_one_across_it_and_in_doubt():
    found = found_under(across(14.0, 6.5, 0.0))
    assert found.ok, found.reason
    assert "other_rod" in found.flags
    assert found.length_mm == pytest.approx(28.0, abs=0.05)


def test_a_second_rod_close_by_is_no_crossing():
    found = found_under(across(12.0, -20.0, -20.0))
    assert found.ok
    assert found.length_mm == pytest.approx(28.0, abs=0.02)
