"""One clamp for a run: the surest readings count, common errors stay, moves show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import nnls

from magbend.vision.batch.shared_clamp import (
    ALIKE,
    DISAGREE,
    OUTLIER,
    Reading,
    _weights,
    shared_direction,
)

SD = st.floats(0.01, 1.0)


def readings(angles, sds, places=None):
    places = np.zeros((len(angles), 2)) if places is None else places
    return [
        Reading(x_mm=x, y_mm=y, angle_deg=angle, sd_deg=sd, mm_per_px=0.05)
        for (x, y), angle, sd in zip(places, angles, sds, strict=True)
    ]


def covariance(sd):
    return np.outer(sd, sd) * (ALIKE + (1.0 - ALIKE) * np.eye(len(sd)))


@given(sds=st.lists(SD, min_size=2, max_size=12))
def test_weights_are_the_best_that_are_not_negative(sds):
    sd = np.array(sds)
    weights = _weights(sd)
    # min w.C w with sum w = 1, w >= 0, by another route: the minimum norm with the sum
    # held by one heavy row
    root = np.linalg.cholesky(covariance(sd)).T
    heavy = 1e3
    held, _ = nnls(
        np.vstack([root, np.full((1, len(sd)), heavy)]),
        np.r_[np.zeros(len(sd)), heavy],
    )
    held /= held.sum()
    assert weights.sum() == pytest.approx(1.0)
    assert np.all(weights >= 0.0)
    best = held @ covariance(sd) @ held
    assert weights @ covariance(sd) @ weights == pytest.approx(best, rel=1e-4)


@given(
    pulls=st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=12),
    sds=st.lists(SD, min_size=12, max_size=12),
    middle=st.floats(-180.0, 180.0),
    turn=st.floats(-360.0, 360.0),
)
def test_the_frame_of_the_board_does_not_matter(pulls, sds, middle, turn):
    sd = np.array(sds[: len(pulls)])
    angles = middle + np.array(pulls) * sd
    one = shared_direction(readings(angles, sd))
    other = shared_direction(readings((angles + turn) % 360.0, sd))
    assert (one is None) == (other is None)
    if one is not None and other is not None:
        apart = (other.angle_deg - one.angle_deg - turn + 180.0) % 360.0 - 180.0
        assert apart == pytest.approx(0.0, abs=1e-8)
        assert other.sd_deg == pytest.approx(one.sd_deg, rel=1e-6)
        assert -180.0 <= one.angle_deg <= 180.0
        least = np.min(sd)
        assert np.sqrt(ALIKE) * least * 0.999 < one.sd_deg
        # No worse than the surest alone, which Huber's weights widen by the root of how
        # far it is off, times the largest scatter of readings that still agree.
        widest = max(least, np.sqrt(least * np.ptp(angles) / OUTLIER))
        assert one.sd_deg <= 1.001 * DISAGREE * widest


def test_more_photographs_do_not_take_away_what_they_have_in_common():
    for count in (2, 10, 1000):
        found = shared_direction(readings(np.zeros(count), np.full(count, 0.1)))
        assert found is not None
        assert 0.1 * np.sqrt(ALIKE) < found.sd_deg < 0.1


def test_a_straight_rod_outweighs_many_bent_ones():
    sd = np.r_[0.05, np.full(20, 0.5)]
    found = shared_direction(readings(np.r_[0.0, np.full(20, 0.4)], sd))
    assert found is not None
    assert abs(found.angle_deg) < 0.01
    assert found.sd_deg == pytest.approx(0.05, rel=0.02)


def test_one_wrong_reading_hardly_pulls():
    angles, sd = np.zeros(10), np.full(10, 0.1)
    angles[4] = 2.0
    found = shared_direction(readings(angles, sd))
    assert found is not None
    assert abs(found.angle_deg) < OUTLIER * 0.1 / 10 * 3


@pytest.mark.parametrize("count", [3, 8, 40])
def test_the_stated_deviation_is_that_of_the_errors(count):
    rng = np.random.default_rng(count)
    scores, moved = [], 0
    for _ in range(400):
        sd = rng.uniform(0.05, 0.5, count)
        errors = np.linalg.cholesky(covariance(sd)) @ rng.standard_normal(count)
        found = shared_direction(readings(30.0 + errors, sd))
        if found is None:
            moved += 1
        else:
            scores.append((found.angle_deg - 30.0) / found.sd_deg)
    assert moved <= 4, "a clamp that stands still is hardly ever called moved"
    assert 0.85 < np.sqrt(np.mean(np.square(scores))) < 1.15


def stage(count):
    """Return places along a straight stage, 4 mm apart, 0.003 mm of scatter."""
    rng = np.random.default_rng(1)
    along = 4.0 * np.arange(count)
    return np.column_stack([0.6 * along, 0.8 * along]) + 0.003 * rng.standard_normal(
        (count, 2)
    )


@pytest.mark.parametrize("carried", [False, True])
def test_a_step_aside_is_noticed(carried):
    places = stage(10) if carried else 0.003 * stage(10) / 4.0
    still = readings(np.zeros(10), np.full(10, 0.2), places)
    assert shared_direction(still) is not None
    across = np.array([-0.08, 0.06])
    bumped = [
        replace(r, x_mm=r.x_mm + across[0], y_mm=r.y_mm + across[1]) for r in still[5:]
    ]
    assert shared_direction(still[:5] + bumped) is None


def test_a_turn_is_noticed():
    rng = np.random.default_rng(2)
    sd = np.full(10, 0.12)
    common, own = 0.1, 0.04 * rng.standard_normal(10)
    assert shared_direction(readings(common + own, sd)) is not None
    turned = common + own + 0.3 * (np.arange(10) >= 5)
    assert shared_direction(readings(turned, sd)) is None
