"""Steps that are cut off at white, found by their flanks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from magbend.vision.edge.flank import fit_flanks, is_held, median_profiles

X = np.arange(-6.0, 5.0, 0.5) + 0.25
PLACES = np.linspace(0.1, 0.8, 8)


def held(place, paper, blur, rod=0.04):
    """A pixel holds no more than 1; what lies between pixels is a mean of two."""
    fine = np.arange(-9.0, 9.0, 0.01)
    light = rod + (paper - rod) * ndtr((fine - place) / blur)
    between = 0.5 + 0.01 * np.arange(-100, 101)
    tent = np.maximum(1.0 - np.abs(between - 0.5), 0.0)
    return np.interp(
        X, fine, np.convolve(np.minimum(light, 1.0), tent / tent.sum(), "same")
    )


@pytest.mark.parametrize("blur", [0.7, 1.0, 1.8])
@pytest.mark.parametrize("paper", [1.2, 1.4, 1.6])
def test_flanks_tell_what_was_cut_off(paper, blur):
    light = np.array([held(place, paper, blur) for place in PLACES])
    light += 0.003 * np.random.default_rng(4).standard_normal(light.shape)
    found = fit_flanks(X, light, blur=0.8 * blur)
    assert found.blur == pytest.approx(blur, rel=0.12)
    away = np.abs(found.place - PLACES).mean()
    half = [np.interp(0.52, row, X) for row in light]  # of what is left
    assert away < 0.18 * blur
    assert away < 0.7 * np.abs(half - PLACES).mean()


def test_a_known_blur_tells_the_place_of_one_flank():
    found = fit_flanks(X, held(0.4, 1.5, 1.0)[None], blur=1.0, known=True)
    assert found.blur == 1.0
    assert found.place[0] == pytest.approx(0.4, abs=0.04)
    assert found.paper[0] == pytest.approx(1.5, abs=0.1)


@pytest.mark.parametrize("paper", [0.9, 0.97, 1.0])
def test_paper_that_is_not_white_moves_nothing(paper):
    light = np.array([held(place, paper, 1.0) for place in PLACES])
    moves = fit_flanks(X, light, blur=1.0).moves(2)
    assert moves.shape == (2, 4)
    assert np.abs(moves).max() < (1e-6 if paper < 0.95 else 0.05)


def test_paper_that_was_made_white_is_not_cut_off():
    assert is_held(np.array([0.2, np.nan, 1.0], np.float32))
    assert not is_held(np.array([0.2, 0.9]))
    assert not is_held(np.array([0.2, 0.99, 1.02]))


def test_samples_that_lie_outside_the_picture_do_not_count():
    rows = np.array([[1.0, 2.0], [np.nan, 5.0], [3.0, 4.0], [np.nan, np.nan]])
    medians = median_profiles(rows, np.array([0, 3, 4]))
    assert medians[0].tolist() == [2.0, 4.0]
    assert np.isnan(medians[1]).all()
