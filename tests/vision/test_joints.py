"""Joints of a rod are found where its curvature jumps, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.vision.curve import joints
from magbend.vision.curve.joints import find_joints

WIDTH = 20.0
SHARED = 8.0


def offsets(kappa, noise_px, seed):
    """Offsets of a rod of given curvature from a smooth curve near it."""
    s = np.arange(0.0, 601.0)
    theta = np.cumsum(kappa(s))
    smooth = np.polynomial.Polynomial.fit(s, theta, 3)(s)
    normals = np.column_stack([-np.sin(smooth), np.cos(smooth)])
    turn = (theta - smooth)[:, None] * normals
    offset = np.sum(np.cumsum(turn, axis=0) * normals, axis=1)
    rng = np.random.default_rng(seed)
    wobble = np.convolve(rng.normal(size=len(s) + 15), np.ones(16) / 4.0, mode="valid")
    return s, smooth, offset + noise_px * wobble


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_joints_are_where_the_curvature_jumps(seed) -> None:
    def kappa(s):
        return 1.2e-3 * (1.0 + (s > 200.0) + 1.5 * (s > 400.0)) * (1.0 - s / 900.0)

    s, theta, offset = offsets(kappa, 0.05, seed)
    found = find_joints(
        s, theta, offset, np.ones_like(s), width=WIDTH, shared=SHARED
    )  # fmt: skip
    np.testing.assert_allclose(found, [200.0, 400.0], atol=12.0)


@pytest.mark.parametrize("bend_rad", [0.0, 0.5, 2.5])
def test_a_smooth_rod_has_no_joints(bend_rad) -> None:
    def kappa(s):
        return bend_rad * np.pi / 1200.0 * np.cos(np.pi * s / 1200.0)

    for seed in range(4):
        s, theta, offset = offsets(kappa, 0.03, seed)
        assert not find_joints(
            s, theta, offset, np.ones_like(s), width=WIDTH, shared=SHARED
        )


def test_a_rod_too_short_for_joints_has_none() -> None:
    s = np.arange(0.0, 101.0)
    assert not find_joints(
        s, 0.01 * s, 0.0 * s, np.ones_like(s), width=WIDTH, shared=SHARED
    )


@pytest.mark.parametrize("moved", [30.0, 570.0])
def test_what_settles_beside_an_end_is_no_joint(monkeypatch, moved) -> None:
    def kappa(s):
        return 1.2e-3 * (1.0 + (s > 200.0) + 1.5 * (s > 400.0)) * (1.0 - s / 900.0)

    settle = joints._settled
    monkeypatch.setattr(
        joints,
        "_settled",
        lambda model, found, step: [
            x if abs(x - moved) > 200.0 else moved for x in settle(model, found, step)
        ],
    )
    s, theta, offset = offsets(kappa, 0.05, 0)
    found = joints.find_joints(
        s, theta, offset, np.ones_like(s), width=WIDTH, shared=SHARED
    )  # fmt: skip
    assert all(abs(x - moved) > 100.0 for x in found)
