"""A rod whose free end is not in the picture, held by a clamp that is."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from magbend.vision import as_photo, extract

FINE, SIZE = 3, (640, 480)


def photograph(board: float, rod: float, clamp: float | None):
    """A rod from (440, 230) out of the lower border; linear light of what is there."""
    turn = np.linspace(0.0, 1.9, 400)
    axis = [440.0, 230.0] + 260.0 * np.column_stack([-np.sin(turn), 1.0 - np.cos(turn)])
    mask = np.zeros((SIZE[1] * FINE, SIZE[0] * FINE), np.uint8)
    points = np.rint(axis * FINE * 16).astype(int)
    cv2.polylines(mask, [points], False, 255, 14 * FINE, cv2.LINE_AA, 4)
    light = board + (rod - board) * (mask / 255.0)
    light[:, 440 * FINE :] = board
    if clamp is not None:
        light[170 * FINE : 300 * FINE, 440 * FINE :] = clamp
    light = cv2.resize(
        cv2.GaussianBlur(light, (0, 0), FINE), SIZE, interpolation=cv2.INTER_AREA
    )
    light += np.random.default_rng(0).normal(0.0, 0.003, light.shape)
    values = 1.055 * np.clip(light, 0.004, 1.0) ** (1 / 2.4) - 0.055
    return as_photo(np.rint(255.0 * values).astype(np.uint8))


@pytest.mark.parametrize(
    ("board", "rod", "clamp"), [(0.03, 0.7, 0.2), (0.7, 0.02, 0.35), (0.7, 0.1, 0.5)]
)
def test_what_runs_from_the_border_to_a_clamp_is_not_measured_turned_round(
    board, rod, clamp
):
    result = extract(photograph(board, rod, clamp), None)
    assert not result.ok
    assert result.flags[0] == "touches_border"


@pytest.mark.parametrize(("board", "rod"), [(0.03, 0.7), (0.7, 0.02)])
def test_a_rod_that_enters_at_the_border_is_measured_to_its_tip(board, rod):
    result = extract(photograph(board, rod, None), None)
    assert result.ok, result.reason
    assert result.tip_px == pytest.approx((439.5, 229.5), abs=0.5)
    assert "clamp_at_border" in result.flags
