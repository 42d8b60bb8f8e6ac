"""Where the rod of a film is next: a Kalman filter for how it is bent.

A rod that bends turns its pieces. Their angles go to and fro evenly where its points
run along arcs, so it is the pieces that are filtered. Each goes on with its velocity v
and acceleration a, and as what swings at one frequency w does: da/dt = -w^2 v, with w 0
at rest and where it is driven along. What is left of a change of the acceleration is a
random push (Bar-Shalom, Li and Kirubarajan 2001, section 6.3.3). All pieces share w,
which the last frames tell, and one covariance, that of the point that moves most. How
hard the rod is pushed is learnt from the innovations, what was measured minus what was
expected; an innovation that is too large for its deviation says that it is another rod,
or a jump.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..measurement import Measurement, Motion

Array = NDArray[np.float64]
Pieces = NDArray[np.complex128]

SEEN_PX = 0.1
"""Standard deviation of a measured point, in noise and along the rod."""
AT_REST = 0.3
"""Standard deviation of the velocity of a rod just found, in its widths."""
LEAST_PUSH_PX = 0.05
FORGET = 0.5
"""Share of the last innovation in what is known of the pushes."""
GATE = 4.5
"""Deviations from what was expected beyond which the rod counts as lost."""

KEPT, STILL_PX = 0.8, 0.45
"""Share of what frames told of the frequency that the next one keeps; and how far
points go, along x or y, in frames that tell half of it."""

_PUSHED = np.array([0.5, 1.0, 1.0])
"""What a change of the acceleration does to place, velocity and acceleration."""


def pieces_of(points_px: Array) -> Pieces:
    """Return the root x + iy and the logarithms of the pieces of a polyline.

    The imaginary parts of these are the pieces' angles.
    """
    points = points_px[:, 0] + 1j * points_px[:, 1]
    return np.concatenate([points[:1], np.log(np.diff(points))])


def points_of(pieces: Pieces) -> Array:
    """Return the polyline of `pieces_of`."""
    points = np.cumsum(np.concatenate([pieces[:1], np.exp(pieces[1:])]))
    return np.column_stack([points.real, points.imag])


def begun(found: Measurement) -> Measurement:
    """Return a measurement that a film begins with, at rest as far as is known."""
    if not found.ok:
        return found
    pieces = pieces_of(found.points_px)
    speed = AT_REST * found.width_px
    motion = Motion(
        state=np.stack([pieces, np.zeros_like(pieces), np.zeros_like(pieces)]),
        covariance=np.diag([SEEN_PX, speed, 0.3 * speed]) ** 2, push_px=0.1 * speed,
        seen_px=(found.points_px,), beats_px2=(0.0, 0.0), looked=found,
    )  # fmt: skip
    return replace(found, motion=motion)


def expected(motion: Motion) -> tuple[Array, float]:
    """Return where the points are in the next frame, and the standard deviation, px."""
    step = _step(motion)
    variance = _covariance(motion, step)[0, 0] + SEEN_PX**2
    return points_of(step[0] @ motion.state), math.sqrt(variance)


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
    step = _step(motion)
    state, covariance = step @ motion.state, _covariance(motion, step)
    variance = covariance[0, 0] + SEEN_PX**2
    points = found.points_px
    off = points - points_of(state[0])
    largest = math.sqrt(float((off * off).sum(axis=1).max()))
    if largest > GATE * math.sqrt(variance):
        return None
    innovation = _less_turns(pieces_of(points) - state[0])
    gain = covariance[:, 0] / variance
    # What the innovation has beyond an acceleration held is the push of this frame.
    held = variance - (_PUSHED[0] * motion.push_px) ** 2
    push = max(largest**2 - held, 0.0) / _PUSHED[0] ** 2
    push = (1.0 - FORGET) * motion.push_px**2 + FORGET * push
    seen_px = (*motion.seen_px[-3:], points)
    updated = Motion(
        state=state + gain[:, None] * innovation,
        covariance=covariance - np.outer(gain, covariance[0]),
        push_px=max(math.sqrt(push), LEAST_PUSH_PX),
        seen_px=seen_px, beats_px2=_beats(motion.beats_px2, seen_px), looked=looked,
    )  # fmt: skip
    return replace(found, motion=updated)


def _less_turns(change: Pieces) -> Pieces:
    """Return a change of root and pieces without whole turns, which no angle shows."""
    turns = np.round(change.imag / (2.0 * np.pi))
    turns[0] = 0.0
    return np.asarray(change - 2j * np.pi * turns)


def _beats(
    before: tuple[float, float], seen_px: Sequence[Array]
) -> tuple[float, float]:
    """Return how much velocities change, and how large they are, by the last frames.

    Both are mean products with d1, px^2, of the differences between four frames in
    turn: of what swings at w, 2 d1 - d2 - d0 = 4 sin^2(w / 2) d1. Points tell it with
    less noise than the pieces between them.
    """
    if len(seen_px) < 4:
        return before
    x0, x1, x2, x3 = seen_px
    d1 = x2 - x1
    changed, moved = float(np.vdot(d1, 3.0 * d1 - x3 + x0)), float(np.vdot(d1, d1))
    return (
        KEPT * before[0] + changed / d1.size,
        KEPT * before[1] + moved / d1.size,
    )


def _step(motion: Motion) -> Array:
    """Return what becomes of place, velocity and acceleration in one frame."""
    changed, moved = motion.beats_px2
    part = min(max(changed / (moved + STILL_PX**2), 0.0), 2.0)
    w = math.acos(1.0 - 0.5 * part)
    if w < 1e-3:
        return np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    sin, cos = math.sin(w), math.cos(w)
    return np.array(
        [[1.0, sin / w, (1.0 - cos) / w**2], [0.0, cos, sin / w], [0.0, -w * sin, cos]]
    )


def _covariance(motion: Motion, step: Array) -> Array:
    """Return the covariance one frame on."""
    push = motion.push_px * _PUSHED
    return np.asarray(step @ motion.covariance @ step.T + np.outer(push, push))
