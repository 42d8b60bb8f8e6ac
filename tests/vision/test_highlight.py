"""A dark bar with a light one in it: edges beside narrow rims, and light cut off."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from magbend.vision.edge.highlight import Bars, fit_bars

X = np.arange(-40.0, 40.0, 0.5)
LOW, HIGH = -9.7, 10.2


def profile(first, last, *, light=0.6, blur=1.2, shade=0.0):
    """Return light, as linear superposition of blurred steps, held at 1 by a sensor."""
    low, high, up, down = (ndtr((X - at) / blur) for at in (LOW, HIGH, first, last))
    left = 0.6 + shade * (X - LOW)
    whole = left * (1.0 - low) + 0.05 * (low - high) + 0.65 * high
    return np.minimum(whole + light * (up - down), 1.0)


def fitted(light, first, last):
    start = np.array([[LOW + 0.4, first - 0.4, last + 0.4, HIGH - 0.4]])
    return fit_bars(X, light[None], start, blur=1.0)


@pytest.mark.parametrize("rim", [6.0, 1.8, 1.5])
@pytest.mark.parametrize("light", [0.3, 0.6, 1.6])
def test_an_edge_beside_a_highlight_is_where_it_is_without(rim, light):
    noise = np.random.default_rng(5).normal(0.0, 0.002, X.size)
    first, last = HIGH - rim - 4.0, HIGH - rim
    bars = fitted(profile(first, last, light=light) + noise, first, last)
    assert bars.high[0] == pytest.approx(HIGH, abs=0.05)
    assert bars.low[0] == pytest.approx(LOW, abs=0.03)


def test_the_paper_may_slope():
    bars = fitted(profile(-2.0, 3.0, shade=0.01), -2.0, 3.0)
    assert bars.low[0] == pytest.approx(LOW, abs=0.03)


def test_what_is_taken_off_leaves_the_rod_alone():
    first, last = 3.0, 8.5
    glossy, plain = profile(first, last), profile(first, last, light=0.0)
    left = glossy - fitted(glossy, first, last).highlight(X[None])[0]
    assert np.abs(left - plain).max() < 0.01


def test_light_that_a_sensor_does_not_hold_is_not_taken_off():
    glossy, plain = profile(-2.0, 3.0, light=1.6), profile(-2.0, 3.0, light=0.0)
    left = glossy - fitted(glossy, -2.0, 3.0).highlight(X[None])[0]
    assert np.abs(left - plain).max() < 0.02


@pytest.mark.parametrize("blur", [3.0, 6.0, 8.0])
def test_edges_that_feel_each_other_are_where_they_are(blur):
    light = profile(0.0, 1.0, light=0.0, blur=blur)[None]
    start = np.array([[LOW - 1.5, HIGH + 1.5]])
    bars = fit_bars(X, light, start, blur=0.8 * blur)
    assert np.exp(bars.blur[0]) == pytest.approx(blur, rel=0.01)
    assert bars.high[0] - bars.low[0] == pytest.approx(HIGH - LOW, abs=0.1)


def test_bars_between_profiles_lie_between_them():
    two = Bars(*np.array([[0.0, 1.0]] * 12))
    assert two.at(np.array([0.0, 10.0]), np.array([2.5])).low == pytest.approx([0.25])
