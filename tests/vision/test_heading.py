"""How surely the direction at a root is told, which may lie before its curve."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.vision.curve.fit import solve
from magbend.vision.curve.heading import sigma_heading
from magbend.vision.curve.problem import pose
from magbend.vision.curve.spline import Smooth
from magbend.vision.edge.crossings import EndFace
from magbend.vision.extraction.deviations import direction_rad
from magbend.vision.extraction.refine import Refined
from magbend.vision.find.ground import View

S = np.linspace(0.0, 300.0, 76)
BEFORE, WIDTH, STIFF = 15.0, 20.0, 1e9
DARK = View(grey=np.zeros((1, 1), np.float32), sign=1.0)


def fitted(noise):
    angle = 0.002 * S
    points = np.column_stack([np.sin(angle), 1.0 - np.cos(angle)]) / 0.002
    points += noise[:, None] * np.column_stack([-np.sin(angle), np.cos(angle)])
    weights = np.full(len(S), 4.0)
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


def as_rod(fit, *, shaded=0.0, relit=0.0, wider=0.0, whole=False):
    """Return an even rod with this midline, but for its first width."""
    near = S < WIDTH
    width = WIDTH + wider * near
    tip = EndFace(s=S[-1], sigma=0.05, skew=0.0, scatter=0.0, found=1.0, rise=0.5)
    return Refined(
        fit=fit, shaded=shaded * near, relit=relit * near,
        good=np.ones(len(S), np.bool_), width=width,
        sigma_width=np.full(len(S), 0.05), typical_width=WIDTH, tip=tip, clamp=None,
        rough=False, blur=1.0, saturated=0.0, whole=whole,
    )  # fmt: skip


def told_rad(fit, **seen):
    return direction_rad(as_rod(fit, **seen), 0.0, np.zeros(len(S)), DARK)


def test_a_direction_under_noise_alone_is_told_once():
    """Told again as doubt of what lies beside the clamp, that noise made it 2.9."""
    rng = np.random.default_rng(6)
    fits = [fitted(rng.normal(0.0, 0.1, len(S))) for _ in range(200)]
    scatter = np.std([fit.curve.theta[0] for fit in fits])
    told = [told_rad(fit) for fit in fits]
    assert 1.0 < np.sqrt(np.mean(np.square(told))) / scatter < 1.6


def test_light_another_width_and_white_paper_leave_a_direction_in_doubt():
    fit = fitted(np.random.default_rng(7).normal(0.0, 0.01, len(S)))
    plain = told_rad(fit)
    assert told_rad(fit, shaded=0.3) > 1.5 * plain
    assert told_rad(fit, relit=0.3) > 1.5 * plain
    assert told_rad(fit, wider=1.0) > 1.5 * plain
    # Edges beside white paper are fitted to a part of their light.
    assert told_rad(fit, whole=True) > 1.5 * plain
