"""The direction at a root that lies before the first point of its curve."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.vision.curve.fit import solve
from magbend.vision.curve.heading import sigma_heading, turned_without
from magbend.vision.curve.problem import pose
from magbend.vision.curve.spline import Smooth

S = np.linspace(0.0, 300.0, 76)
BEFORE, WIDTH, STIFF = 15.0, 20.0, 1e9


def fitted(noise, weights=None, pulled=0.0):
    """Fit an arc with noise, pulled aside within the first width."""
    angle = 0.002 * S
    points = np.column_stack([np.sin(angle), 1.0 - np.cos(angle)]) / 0.002
    across = noise + pulled * (S < WIDTH)
    points += across[:, None] * np.column_stack([-np.sin(angle), np.cos(angle)])
    weights = np.full(len(S), 4.0) if weights is None else weights
    return solve(pose(S, points, weights, angle, spacing=20.0), Smooth(), STIFF)


def test_it_is_as_sure_as_it_scatters_over_many_noises():
    rng = np.random.default_rng(5)
    fits = [fitted(rng.normal(0.0, 0.1, len(S))) for _ in range(200)]
    at_start, at_root = (
        np.std([fit.curve.at(np.array([-back]))[1][0] for fit in fits])
        for back in (0.0, BEFORE)
    )
    fit = fits[0]
    assert at_root > 1.2 * at_start
    assert sigma_heading(fit, 0.0) == pytest.approx(fit.sigma_theta[0], rel=1e-9)
    told = sigma_heading(fit, BEFORE) / sigma_heading(fit, 0.0)
    assert told == pytest.approx(at_root / at_start, rel=0.25)


def test_without_the_points_beside_the_root_it_is_that_of_a_fit_to_the_others():
    noise = np.random.default_rng(7).normal(0.0, 0.05, len(S))
    whole = fitted(noise, pulled=0.2)
    rest = fitted(noise, np.where(S < WIDTH, 0.0, 4.0))
    turn = (
        rest.curve.at(np.array([-BEFORE]))[1] - whole.curve.at(np.array([-BEFORE]))[1]
    )
    assert turned_without(whole, BEFORE, WIDTH) == pytest.approx(turn[0], rel=0.02)
    assert abs(turn[0]) > 0.003
    assert turned_without(whole, BEFORE, 0.0) == 0.0
