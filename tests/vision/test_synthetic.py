"""The generator's truth is exact: area, moments, edges, and the score itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from magbend.core.errors import InputError
from magbend.vision.extraction.extract import extract
from magbend.vision.measurement import Measurement, failure
from magbend.vision.picture.photo import as_photo
from magbend.vision.picture.raster import coverage, coverage_of
from magbend.vision.synthetic.scoring import score, signed_distance
from magbend.vision.synthetic.square_view import (
    LIGHTS,
    SHAPES,
    Light,
    curve,
    draw,
    frames,
)

PLAIN = Light(gradient=0.0, blur_px=0.0, noise=0.0)


def polygon_moments(p):
    x, y = p.T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    area = cross.sum() / 2.0
    cx = ((x + np.roll(x, -1)) * cross).sum() / (6.0 * area)
    cy = ((y + np.roll(y, -1)) * cross).sum() / (6.0 * area)
    return abs(area), cx, cy


@settings(max_examples=60, deadline=None)
@given(
    corners=st.integers(3, 9), seed=st.integers(0, 10_000), radius=st.floats(0.2, 12.0)
)
def test_coverage_has_the_area_of_the_polygon(corners, seed, radius):
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners))
    p = 16.0 + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    area, _, _ = polygon_moments(p)
    picture = coverage(p, 33, 33).astype(float)
    assert picture.sum() == pytest.approx(area, rel=1e-5, abs=1e-5)
    assert picture.min() >= 0.0
    assert picture.max() <= 1.0


def test_coverage_is_exact_where_it_can_be_counted_by_hand():
    box = np.array([[1.5, 0.5], [3.0, 0.5], [3.0, 2.25], [1.5, 2.25]])
    expected = np.array([[0, 0, 0, 0, 0], [0, 0, 1, 0.5, 0], [0, 0, 0.75, 0.375, 0]])
    np.testing.assert_allclose(coverage(box, 5, 3), expected, atol=1e-7)
    np.testing.assert_allclose(coverage(box[::-1], 5, 3), expected, atol=1e-7)


@pytest.mark.parametrize("shift", [(-5.0, 0.0), (0.0, -5.0), (9.3, 0.0), (-4.2, 11.0)])
def test_coverage_is_cut_at_the_picture(shift):
    p = np.array([[2.2, 3.3], [8.7, 4.1], [7.9, 9.9], [1.5, 8.2]]) + shift
    whole = coverage(p + 20.0, 60, 60)[20:36, 20:36]
    np.testing.assert_allclose(coverage(p, 16, 16), whole, atol=1e-6)


def test_coverage_outside_or_not_finite_is_nothing():
    away = np.array([[100.0, 100.0], [110.0, 100.0], [105.0, 120.0]])
    assert not coverage(away, 16, 16).any()
    assert not coverage(away * np.nan, 16, 16).any()
    assert not coverage(away[:2], 16, 16).any()


def test_holes_are_cut_out():
    outer = np.array([[1, 1], [9, 1], [9, 9], [1, 9]], dtype=float)
    hole = np.array([[3, 3], [5, 3], [5, 5], [3, 5]], dtype=float)
    assert coverage_of([outer, hole], [1, -1], 12, 12).sum() == pytest.approx(60.0)


@pytest.mark.parametrize(("name", "kind", "angle"), SHAPES)
def test_curves_are_consistent(name, kind, angle):
    line = curve(kind, angle_deg=angle)
    assert line.length_mm == 30.0
    steps = np.hypot(np.diff(line.x_mm), np.diff(line.y_mm))
    assert steps.sum() == pytest.approx(30.0, abs=1e-4)
    heading = np.unwrap(np.arctan2(np.diff(line.y_mm), np.diff(line.x_mm)))
    middle = 0.5 * (line.theta_rad[1:] + line.theta_rad[:-1])
    np.testing.assert_allclose(heading, middle, atol=5e-5)  # kinks of kappa
    kappa = np.diff(line.theta_rad) / np.diff(line.s_mm)
    inner = 0.5 * (line.kappa_per_mm[1:] + line.kappa_per_mm[:-1])
    assert np.median(np.abs(kappa - inner)) < 1e-5
    assert (line.x_mm[0], line.y_mm[0], line.theta_rad[0]) == (0.0, 0.0, 0.0)
    turned = math.degrees(np.abs(line.theta_rad).max())
    assert turned == pytest.approx(abs(angle), abs=1e-3)


def test_arc_is_a_circle():
    line = curve("arc", angle_deg=90.0)
    radius = 60.0 / np.pi
    assert line.tip_mm == pytest.approx((radius, radius), abs=1e-6)


def test_drawn_rod_has_the_true_area_and_centre():
    """Moments of the grey values against those of the strip."""
    light = Light(
        paper=1.0, rod=0.0, clamp=1.0, gradient=0.0, blur_px=0.0, noise=0.0
    )  # fmt: skip
    line = curve("straight")
    frame = draw(
        line, np.random.default_rng(0), light=light, clamp_height_mm=0.0,
        clamp_px=(300.3, 400.7), angle_deg=17.0, size_px=(1200, 800),
    )  # fmt: skip
    dark = 1.0 - decode(frame.image)
    assert dark.sum() == pytest.approx(600.0 * 20.0, rel=2e-3)
    y, x = np.mgrid[0:800, 0:1200]
    centre = np.array([(dark * x).sum(), (dark * y).sum()]) / dark.sum()
    middle = 0.5 * (np.array(frame.truth.clamp_px) + frame.truth.tip_px)
    np.testing.assert_allclose(centre, middle, atol=5e-3)


def decode(image):
    value = image / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def test_truth_in_px_and_mm_agree():
    frame = draw(curve("s", angle_deg=40.0), np.random.default_rng(3))
    truth = frame.truth
    back = truth.pose.from_board(truth.calibration.to_mm(truth.points_px))
    np.testing.assert_allclose(back, truth.centreline.points_mm, atol=1e-9)
    assert truth.length_px == pytest.approx(600.0)
    assert truth.width_px == pytest.approx(20.0)


def test_left_of_the_rod_is_left_in_the_picture():
    frame = draw(
        curve("arc", angle_deg=60.0), np.random.default_rng(0), light=PLAIN,
        clamp_px=(400.0, 600.0), angle_deg=0.0,
    )  # fmt: skip
    assert frame.truth.tip_px[1] < 600.0  # bends up in the picture


def test_same_seed_same_frame_and_other_seed_another():
    one, same, other = (
        draw(curve("straight"), np.random.default_rng(seed)) for seed in (5, 5, 6)
    )
    np.testing.assert_array_equal(one.image, same.image)
    assert one.truth.clamp_px != other.truth.clamp_px


def test_the_set_holds_what_the_table_needs():
    found = [f.name for f in frames(scales_px_per_mm=(10.0,), lights=("clean",))]
    assert len(found) == len(set(found)) == len(SHAPES)
    assert set(LIGHTS) == {"clean", "standard", "hard"}


def test_rod_that_does_not_fit_is_refused():
    with pytest.raises(InputError, match="fit"):
        draw(curve("straight"), np.random.default_rng(0), size_px=(300, 200))


def test_unknown_shape_is_refused():
    with pytest.raises(InputError, match="graded"):
        curve("spiral")


def perfect(frame, **change) -> Measurement:
    truth = frame.truth
    points = {
        "x_px": truth.points_px[:, 0], "y_px": truth.points_px[:, 1],
        "sigma_px": np.full(len(truth.points_px), 0.05),
    }  # fmt: skip
    given = {
        "points": points, "width_px": truth.width_px, "length_px": truth.length_px,
        "clamp_px": truth.clamp_px, "tip_px": truth.tip_px,
    }  # fmt: skip
    return Measurement(status="ok", **(given | change))


@pytest.fixture(scope="module")
def straight():
    return draw(
        curve("straight"), np.random.default_rng(0), clamp_px=(400.0, 500.0),
        angle_deg=0.0,
    )  # fmt: skip


def test_perfect_measurement_scores_nothing(straight):
    result = score(perfect(straight), straight.truth)
    assert result.rms_px == result.max_px == 0.0
    assert result.length_px == pytest.approx(0.0, abs=1e-9)
    assert result.tip_along_px == result.tip_across_px == 0.0
    assert result.coverage == 1.0


def test_known_errors_are_scored_as_they_are(straight):
    truth = straight.truth
    points = {
        "x_px": truth.points_px[:, 0], "y_px": truth.points_px[:, 1] + 0.1,
        "sigma_px": np.full(len(truth.points_px), 0.05),
    }  # fmt: skip
    tip = (truth.tip_px[0] + 0.3, truth.tip_px[1] - 0.2)
    moved = perfect(
        straight, points=points, tip_px=tip, width_px=truth.width_px + 0.4
    )  # fmt: skip
    result = score(moved, truth)
    assert result.rms_px == pytest.approx(0.1)
    assert result.max_px == pytest.approx(0.1)
    assert result.tip_along_px == pytest.approx(0.3)
    assert result.tip_across_px == pytest.approx(0.2)  # up in the picture is left
    assert result.width_px == pytest.approx(0.4)
    assert result.coverage == 0.0


def test_distance_has_a_sign_and_runs_on_past_the_ends():
    line = np.array([[0.0, 0.0], [10.0, 0.0]])
    points = np.array([[5.0, 2.0], [5.0, -1.0], [-3.0, 0.5], [14.0, 0.0]])
    np.testing.assert_allclose(signed_distance(points, line), [2.0, -1.0, 0.5, 0.0])


def test_refusal_has_no_score(straight):
    with pytest.raises(ValueError, match="no rod"):
        score(failure("no_rod", "no rod"), straight.truth)


def test_the_width_is_as_sure_as_it_says():
    """Neighbouring stations share samples and levels; the deviation must know it."""
    rng = np.random.default_rng(4)
    shape = curve("arc", angle_deg=60.0)
    frame = draw(shape, rng, light=LIGHTS["clean"], size_px=(900, 900))
    within = []
    for _ in range(6):
        frame = frame.again(rng)
        points = extract(as_photo(frame.image), frame.truth.calibration).points
        within.append(np.abs(points["width_mm"] - 1.0) < points["sigma_width_mm"])
    assert 0.58 < np.mean(within) < 0.78
