from __future__ import annotations

import numpy as np
import pytest
from scipy.special import erf

from magbend.vision.edge.edges import find_edges
from magbend.vision.edge.profiles import _bilinear
from magbend.vision.edge.rough_edges import rough_edges
from magbend.vision.find.binarise import binarise


def bar(
    angle: float, half: float, blur: float, *, slope: float = 0.0, size: int = 240
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A dark bar through the middle; `slope`: shade on its positive side, per px."""
    y, x = np.mgrid[0:size, 0:size].astype(float)
    n = np.array([-np.sin(angle), np.cos(angle)])
    t = (x - size / 2) * n[0] + (y - size / 2) * n[1]
    light = np.where(t > 0.0, 1.0 + slope * (t - half - 10.0), 1.0)
    out = 0.5 * (1 + erf((np.abs(t) - half) / (blur * np.sqrt(2))))
    u = np.linspace(-70, 70, 141)
    points = size / 2 + u[:, None] * np.array([np.cos(angle), np.sin(angle)])
    image = 0.05 + 0.75 * light * out
    return image.astype(np.float32), points, np.tile(n, (141, 1))


@pytest.mark.parametrize("angle", [0.0, 0.1, 0.7, 1.5707963, 2.4])
@pytest.mark.parametrize("blur", [0.7, 1.0, 1.8])
def test_edges_of_a_bar_are_found_to_a_hundredth(angle, blur):
    image, points, normals = bar(angle, 9.3, blur)
    expected = np.full(len(points), 9.0)
    edges = find_edges(image, points, normals, -expected, expected, reach=3, blur=blur)
    edges = find_edges(
        image, points, normals, edges.low, edges.high, reach=3, blur=edges.blur
    )
    assert np.abs(edges.middle.mean()) < 0.003
    # A sharp edge along the rows falls between samples always in the same way.
    assert edges.width.mean() == pytest.approx(18.6, abs=0.03 if blur >= 1.0 else 0.06)
    # Bilinear sampling adds its own blur.
    assert edges.blur == pytest.approx(np.hypot(blur, 0.5), rel=0.1)
    assert edges.contrast == pytest.approx(0.75, rel=0.02)


def test_shade_on_one_side_does_not_pull_the_midline():
    image, points, normals = bar(0.3, 9.3, 1.0, slope=0.03)
    expected = np.full(len(points), 9.0)
    edges = find_edges(image, points, normals, -expected, expected, reach=3, blur=1.0)
    level = 0.05 + 0.5 * 0.75
    plain = np.mean(
        [np.interp(level, [_bilinear(image, *(p + u * n)) for u in t], t)
         for p, n in zip(points, normals, strict=True)
         for t in [np.linspace(5.0, 14.0, 91)]]
    )  # fmt: skip
    assert plain > 9.45
    assert np.abs(edges.middle.mean()) < 0.015
    assert np.nanmedian(edges.shade_high) == pytest.approx(0.0225, rel=0.2)


def test_hairs_along_the_edges_cost_no_width():
    """Edges that wander by a pixel, as a yarn's: levels are taken clear of that."""
    image, points, normals = bar(0.0, 15.0, 1.0)
    shifts = np.random.default_rng(0).integers(-2, 3, size=(2, image.shape[1]))
    rows = np.arange(120)
    for column, (upper, lower) in enumerate(shifts.T):
        image[:120, column] = image[np.clip(rows - upper, 0, 119), column]
        image[120:, column] = image[120 + np.clip(rows - lower, 0, 119), column]
    expected = np.full(len(points), 15.0)
    edges = find_edges(
        image, points, normals, -expected, expected, reach=8.0, blur=1.0, fuzz=4.0
    )
    assert np.isfinite(edges.width).mean() > 0.95
    true = 30.0 + (shifts[1] - shifts[0])[points[:, 0].astype(int)]
    assert np.nanmean(edges.width - true) == pytest.approx(0.0, abs=0.1)


def test_light_bars_are_measured_as_dark_ones_are():
    image, points, normals = bar(0.4, 7.0, 1.0)
    expected = np.full(len(points), 7.0)
    dark = find_edges(image, points, normals, -expected, expected, reach=3, blur=1.0)
    light = find_edges(
        1 - image, points, normals, -expected, expected, reach=3, blur=1.0, sign=-1.0
    )
    # But for the slope that a lamp may make on a round light rod.
    assert np.median(dark.width) == pytest.approx(14.0, abs=0.01)
    assert np.median(light.width) == pytest.approx(14.0, abs=0.01)


def test_no_edge_is_nan_not_a_number():
    image = np.full((240, 240), 0.7, np.float32)
    _, points, normals = bar(0.0, 9.0, 1.0)
    expected = np.full(len(points), 9.0)
    edges = find_edges(image, points, normals, -expected, expected, reach=3, blur=1.0)
    assert np.isnan(edges.low).all()
    assert np.isnan(edges.high).all()


def test_outside_the_picture_is_nan():
    image = np.ones((20, 30), np.float32)
    for x, y in ((-0.1, 3.0), (29.1, 3.0), (3.0, 19.1), (3.0, -0.1)):
        assert np.isnan(_bilinear(image, x, y))
    assert _bilinear(image, 3.0, 3.0) == 1.0


@pytest.mark.parametrize("shade", [0.5, 0.35])
def test_rough_edges_see_through_a_shadow(shade):
    image, points, normals = bar(0.0, 9.0, 0.8)
    t = points[0, 1] + np.arange(9, 18)
    image[t.astype(int)] *= shade
    low, high, *_ = rough_edges(image, points, normals, reach=20.0)
    assert np.median(high - low) == pytest.approx(18.0, abs=1.0)


def test_rough_edges_see_through_a_deep_shadow_that_fades():
    image, points, normals = bar(0.0, 9.0, 0.8)
    t = (points[0, 1] + np.arange(9, 24)).astype(int)
    image[t] *= np.linspace(0.2, 0.4, image.shape[1], dtype=np.float32)
    low, high, *_ = rough_edges(image, points, normals, reach=26.0)
    assert np.median(high - low) == pytest.approx(18.0, abs=2.0)


@pytest.mark.parametrize("fall", [0.0, 0.3, 0.5])
def test_mask_survives_uneven_light(fall):
    image, *_ = bar(0.2, 5.0, 1.0, size=400)
    image = image * np.linspace(1.0, 1.0 - fall, 400, dtype=np.float32)[None, :]
    found = binarise(image)
    assert found is not None
    assert not found.inverted
    assert found.mask.mean() == pytest.approx(
        10.0 * 400 / np.cos(0.2) / 400**2, rel=0.15
    )


def test_light_on_dark_is_noticed():
    image, *_ = bar(0.2, 5.0, 1.0, size=400)
    found = binarise(1.0 - image)
    assert found is not None
    assert found.inverted


@pytest.mark.parametrize("level", [0.0, 0.5, 1.0])
def test_nothing_stands_out_of_an_even_picture(level):
    noise = np.random.default_rng(0).normal(scale=0.003, size=(300, 400))
    assert binarise((level + noise).astype(np.float32)) is None
