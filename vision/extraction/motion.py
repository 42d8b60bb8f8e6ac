"""Where the rod of a film is next: a Kalman filter for the points of its axis.

Each point goes on with its velocity and acceleration; the latter changes at random from
frame to frame (Bar-Shalom, Li and Kirubarajan 2001, section 6.3.3). All points share
one covariance, that of the point that moves most. How hard they are pushed is learnt
from the innovations, what was measured minus what was expected; an innovation that is
too large for its deviation says that it is another rod, or a jump.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..measurement import Measurement, Motion

Array = NDArray[np.float64]

SEEN_PX = 0.1
"""Standard deviation of a measured point, in noise and along the rod."""
AT_REST = 0.3
"""Standard deviation of the velocity of a rod just found, in its widths."""
LEAST_PUSH_PX = 0.05
FORGET = 0.5
"""Share of the last innovation in what is known of the pushes."""
GATE = 4.5
"""Deviations from what was expected beyond which the rod counts as lost."""

_STEP = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
_PUSHED = np.array([0.5, 1.0, 1.0])
"""What a change of the acceleration does to place, velocity and acceleration."""


def begun(found: Measurement) -> Measurement:
    """Return a measurement that a film begins with, at rest as far as is known."""
    if not found.ok:
        return found
    points = found.points_px
    speed = AT_REST * found.width_px
    motion = Motion(
        state_px=np.stack([points, np.zeros_like(points), np.zeros_like(points)]),
        covariance=np.diag([SEEN_PX, speed, 0.3 * speed]) ** 2, push_px=0.1 * speed,
        looked=found,
    )  # fmt: skip
    return replace(found, motion=motion)


def expected(motion: Motion) -> tuple[Array, float]:
    """Return where the points are in the next frame, and the standard deviation, px."""
    variance = _covariance(motion)[0, 0] + SEEN_PX**2
    return _carried(motion)[0], math.sqrt(variance)


def moved_on(
    motion: Motion, found: Measurement, looked: Measurement
) -> Measurement | None:
    """Return a frame's measurement with the motion so far; None where it is lost.

    Parameters
    ----------
    motion : Motion
        Up to the frame before.
    found : Measurement
        The same number of points, measured.
    looked : Measurement
        The last frame in which what lies around the rod was looked at.
    """
    state, covariance = _carried(motion), _covariance(motion)
    variance = covariance[0, 0] + SEEN_PX**2
    innovation = found.points_px - state[0]
    largest = float(np.hypot(*innovation.T).max())
    if largest > GATE * math.sqrt(variance):
        return None
    gain = covariance[:, 0] / variance
    # What the innovation has beyond an acceleration held is the push of this frame.
    held = variance - (_PUSHED[0] * motion.push_px) ** 2
    push = max(largest**2 - held, 0.0) / _PUSHED[0] ** 2
    push = (1.0 - FORGET) * motion.push_px**2 + FORGET * push
    updated = Motion(
        state_px=state + gain[:, None, None] * innovation,
        covariance=covariance - np.outer(gain, covariance[0]),
        push_px=max(math.sqrt(push), LEAST_PUSH_PX),
        looked=looked,
    )
    return replace(found, motion=updated)


def _carried(motion: Motion) -> Array:
    """Return the state one frame on."""
    state = motion.state_px
    return np.asarray((_STEP @ state.reshape(3, -1)).reshape(state.shape))


def _covariance(motion: Motion) -> Array:
    """Return the covariance one frame on."""
    push = motion.push_px * _PUSHED
    return np.asarray(_STEP @ motion.covariance @ _STEP.T + np.outer(push, push))
