"""The line at a clamp where the dark of the rod ends."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from magbend.vision.curve.curve import Curve
from magbend.vision.edge.clamp import ClampLines, between, find_clamp

ROD, PAPER, TOP = 0.03, 0.6, 0.3


def clamped(face: float, depth: float, shade: float = 0.0) -> tuple[np.ndarray, Curve]:
    """A rod along x that leaves the face of a clamp at x = 60, `depth` px deep.

    On one side the paper lies in a shade.
    """
    x, y = np.meshgrid(np.arange(200.0), np.arange(120.0))
    into = 1.0 / (1.0 + np.exp((x - 60.0) / 0.6))
    deeper = 1.0 / (1.0 + np.exp((x - 60.0 + depth) / 0.6))
    rod = 1.0 / (1.0 + np.exp((np.abs(y - 60.0) - 10.0) / 0.6))
    paper = PAPER * (1.0 - shade * (y > 60.0))
    light = paper + (ROD - paper) * rod
    light += (face - light) * into
    light += (TOP - light) * deeper
    s = np.linspace(0.0, 120.0, 121)
    points = np.column_stack([65.0 + s, np.full(121, 60.0)])
    return light.astype(np.float32), Curve(
        s=s, points=points, theta=np.zeros(121), kappa=np.zeros(121)
    )


def lines_at(grey: np.ndarray, curve: Curve, blur=1.0, **options) -> ClampLines:
    return find_clamp(
        grey, curve, expected=-5.0, width=20.0, blur=blur, contrast=PAPER - ROD,
        reach=20.0, **options,
    )  # fmt: skip


@pytest.mark.parametrize("shade", [0.3, 0.6])
def test_a_shade_on_one_side_does_not_turn_the_front(shade):
    front = lines_at(*clamped(0.1, 20.0, shade)).front
    assert front is not None
    assert front.skew == pytest.approx(0.0, abs=5e-4)
    assert front.s == pytest.approx(-5.0, abs=0.02)


@pytest.mark.parametrize(("face", "depth"), [(0.1, 12.0), (0.13, 7.0), (0.3, 9.0)])
def test_rod_ends_where_its_dark_ends_not_at_the_top_edge_of_the_face(face, depth):
    lines = lines_at(*clamped(face, depth))
    assert lines.face is not None
    assert lines.face.s == pytest.approx(-5.0, abs=0.3)


def test_a_short_line_in_grain_moves_the_root_little():
    """Grain is alike on all lanes of the face: its scatter does not tell its error."""
    grey, curve = clamped(0.3, 20.0)
    off = []
    for seed in range(12):
        grain = np.random.default_rng(seed).normal(size=grey.shape)
        grain = cv2.GaussianBlur(grain, (0, 0), 2.0)
        grainy = grey + (0.015 / grain.std() * grain).astype(np.float32)
        lines = lines_at(grainy, curve)
        assert lines.face is not None
        assert lines.front is not None
        face, front = lines.face.s, lines.front.s
        off.append([between(face, front, lines) + 5.0, front + 5.0])
    root, front_alone = np.sqrt(np.mean(np.square(off), axis=0))
    assert root < 1.2 * front_alone


def test_the_blur_of_the_front_steadies_the_place_of_the_face():
    """A lens blurs both alike; the face alone confounds its blur with its place."""
    grey, curve = clamped(0.3, 20.0)
    grey = cv2.GaussianBlur(grey, (0, 0), 1.2)
    places, ratios = [], []
    for seed in range(32):
        grain = np.random.default_rng(seed).normal(scale=0.02, size=grey.shape)
        lines = lines_at(grey + grain.astype(np.float32), curve, optics=(1.6, 1.6))
        assert lines.face is not None
        assert lines.front is not None
        places.append(lines.face.s + 5.0)
        ratios.append(lines.face.blur / lines.front.blur)
    assert np.std(ratios) < 0.1  # 0.21 by itself
    assert np.sqrt(np.mean(np.square(places))) < 0.4  # 0.53 by itself


def test_what_moved_along_the_rod_is_not_held_to_the_blur_of_its_sides():
    grey, curve = clamped(0.3, 20.0)
    moved = cv2.blur(grey, (5, 1))
    lines = lines_at(moved, curve, blur=1.75, optics=(1.05, 1.75))
    assert lines.face is not None
    assert lines.front is not None
    assert lines.face.blur == pytest.approx(lines.front.blur, rel=0.15)
    assert lines.face.s == pytest.approx(-5.0, abs=0.1)


def front_of_bent(radius: float, slope: float, width: float, expected: float = 0.0):
    """Return the front of a clamp which a rod leaves at (60, 110) on an arc."""
    x, y = np.meshgrid(np.arange(260.0), np.arange(220.0))
    into = 1.0 / (1.0 + np.exp((x - 60.0 - slope * (y - 110.0)) / 0.6))
    away = np.abs(np.hypot(x - 60.0, y - 110.0 - radius) - abs(radius))
    paper = PAPER + (ROD - PAPER) / (1.0 + np.exp((away - 0.5 * width) / 0.6))
    light = (paper + (TOP - paper) * into).astype(np.float32)
    s = np.linspace(0.0, 120.0, 121)
    theta = s / radius
    points = np.column_stack(
        [60.0 + radius * np.sin(theta), 110.0 + radius * (1.0 - np.cos(theta))]
    )
    curve = Curve(s=s, points=points, theta=theta, kappa=np.full(121, 1.0 / radius))
    return find_clamp(
        light, curve, expected=expected, width=width, blur=1.0, contrast=PAPER - ROD,
        reach=10.0,
    ).front  # fmt: skip


@pytest.mark.parametrize("radius", [150.0, -150.0])
def test_a_front_askew_to_a_bent_rod_is_met_where_its_axis_meets_it(radius):
    """Lanes beside a bent rod are no parallels: the straight line is none on them."""
    front = front_of_bent(radius, 0.15, 16.0)
    assert front is not None
    assert front.s == pytest.approx(0.0, abs=0.05)
    assert front.skew == pytest.approx(0.15, abs=5e-3)


@pytest.mark.parametrize("radius", [56.0, -56.0])
def test_lanes_that_meet_inside_a_bend_do_not_turn_the_front(radius):
    slope = -0.05 * np.sign(radius)
    front = front_of_bent(radius, slope, 28.0, expected=1.0)
    assert front is not None
    assert front.s == pytest.approx(0.0, abs=0.3)
    assert front.skew == pytest.approx(slope, abs=0.01)


@pytest.mark.parametrize(("slope", "seen"), [(0.2, True), (0.7, False)])
def test_what_ends_aslant_on_a_rod_is_no_clamp(slope, seen):
    """A lamp lights it from there on; a rod leaves its clamp about squarely."""
    x, y = np.meshgrid(np.arange(200.0), np.arange(120.0))
    lit = 1.0 / (1.0 + np.exp((x - 60.0 - slope * (y - 60.0)) / 0.6))
    rod = 1.0 / (1.0 + np.exp((np.abs(y - 60.0) - 10.0) / 0.6))
    light = PAPER + (ROD + 0.3 * lit - PAPER) * rod
    _, curve = clamped(0.3, 20.0)
    lines = lines_at(light.astype(np.float32), curve)
    assert (lines.face is not None) == seen
    assert lines.front is None
