"""A round light rod on a dark board under one lamp, drawn pixel by pixel."""

from __future__ import annotations

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from magbend.vision import as_photo, extract
from magbend.vision.extraction.quality import _lines_differ
from magbend.vision.extraction.strip import along_candidate, blur_of
from magbend.vision.find.candidate import Candidate
from magbend.vision.find.ground import View

WIDTH, RADIUS, TURN = 30.0, 300.0, 1.2
CENTRE = np.array([150.0, 380.0])
FINE = 2
BOARD, AMBIENT, BLUR_PX = 0.03, 0.2, 1.2


def light(lamp_deg: float, gloss: float = 0.0) -> np.ndarray:
    """Linear light: an arc from straight above its centre on, with its clamp and shade.

    The lamp stands at an angle from the vertical, across the rod.
    """
    y, x = np.mgrid[0 : 480 * FINE, 0 : 640 * FINE] / FINE + 0.25 - 0.5
    x, y = x - CENTRE[0], y - CENTRE[1]
    across, turn = (np.hypot(x, y) - RADIUS) / (0.5 * WIDTH), np.arctan2(x, -y)
    lamp = np.radians(lamp_deg)
    up = np.sqrt(np.clip(1.0 - across**2, 0.0, 1.0))
    lit = np.clip(across * np.sin(lamp) + up * np.cos(lamp), 0.0, 1.0)
    rod = 0.7 * (AMBIENT + (1.0 - AMBIENT) * lit) + gloss * lit**40
    picture = np.full(x.shape, BOARD)
    along = (turn > 0.0) & (turn < TURN)
    picture[along & (across < 0.0) & (across > -2.5)] = 0.4 * BOARD  # its shade
    picture[along & (np.abs(across) < 1.0)] = rod[along & (np.abs(across) < 1.0)]
    picture[(x < 0.0) & (x > -90.0) & (np.abs(y + RADIUS) < 60.0)] = 0.25
    picture = cv2.GaussianBlur(picture, (0, 0), FINE * BLUR_PX)
    picture = cv2.resize(picture, (640, 480), interpolation=cv2.INTER_AREA)
    return np.clip(
        picture + np.random.default_rng(1).normal(0, 0.002, (480, 640)), 0, 1
    )


def found(lamp_deg: float, gloss: float = 0.2):
    values = 1.055 * np.clip(light(lamp_deg, gloss), 0.004, 1.0) ** (1 / 2.4) - 0.055
    return extract(as_photo(np.rint(255.0 * values).astype(np.uint8)), None)


@pytest.mark.parametrize(
    ("lamp_deg", "gloss"),
    [(0.0, 0.2), (40.0, 0.2), (65.0, 0.2), (40.0, 0.0)],
)
def test_a_lamp_at_one_side_leaves_the_other_side_to_the_rod(lamp_deg, gloss):
    result = found(lamp_deg, gloss)
    assert result.ok, result.reason
    inner = result.points_px[3:-3] - CENTRE
    assert np.abs(np.hypot(*inner.T) - RADIUS).mean() < 0.05 * WIDTH
    assert result.width_px == pytest.approx(WIDTH, rel=0.1)
    assert result.length_px == pytest.approx(TURN * RADIUS, abs=3.0)


def test_shading_across_a_light_rod_is_no_blur():
    theta = np.linspace(0.1, TURN - 0.1, 60)
    axis = CENTRE + RADIUS * np.column_stack([np.sin(theta), -np.cos(theta)])
    rod = Candidate(
        points_px=axis, width_px=WIDTH, length_px=300.0, root="clamp", contacts=1,
        ratio=0.3,
    )  # fmt: skip
    view = View(grey=light(50.0).astype(np.float32), sign=-1.0)
    assert blur_of(along_candidate(view, rod))[0] < 0.1 * WIDTH


def test_a_light_face_of_the_clamp_is_not_told_from_a_light_rod(monkeypatch):
    plain = found(0.0)
    assert "clamp_doubtful" not in plain.flags
    monkeypatch.setattr("magbend.vision.extraction.quality._lines_differ", bool)
    assert "clamp_doubtful" in found(0.0).flags


@pytest.mark.parametrize(("apart", "differ"), [(0.5, False), (12.0, True)])
def test_two_lines_at_a_clamp_differ_by_more_than_pixels(apart, differ):
    face, front = (SimpleNamespace(s=s) for s in (-apart, 0.0))
    rod = SimpleNamespace(clamp=SimpleNamespace(face=face, front=front))
    assert _lines_differ(rod) == differ
