"""How a rod rings after a step: frequency, damping and settling from its tip's path.

A free vibration in one mode is x(t) = r + exp(-d t) (a cos w t + b sin w t). For given
w and d the other three numbers follow by linear least squares, so only two are sought
(variable projection, Golub and Pereyra 1973).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.errors import VisionError

Array = NDArray[np.float64]

LEAST_FRAMES = 12
"""Frames from the largest deflection on that two numbers can be told from."""
_HELD = 0.96
"""Share of the largest deflection at which the rod is let go."""
_CLEAR = 3.0
"""Amplitude over the residual, below which nothing rings."""
_DECAYS = 0.0, 0.01, 0.03, 0.1, 0.3
"""Damping ratios from which the best fit is sought."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ringing:
    """A vibration that dies away.

    Parameters
    ----------
    frequency_Hz, frequency_sd_Hz : float
        Of the damped vibration.
    damping_ratio, damping_ratio_sd : float
        Decay rate over the angular frequency without damping.
    amplitude_mm : float
        At the first frame that was used.
    settle_s, settle_sd_s : float
        From there until the amplitude is below what counts as settled; infinite for a
        vibration that does not die away.
    rest_mm : float
        Where the tip comes to rest along its line of motion.
    residual_mm : float
        Standard deviation of what the model leaves.
    first_s : float
        Time of the first frame that was used.
    frames : int
        How many were used.
    """

    frequency_Hz: float
    frequency_sd_Hz: float
    damping_ratio: float
    damping_ratio_sd: float
    amplitude_mm: float
    settle_s: float
    settle_sd_s: float
    rest_mm: float
    residual_mm: float
    first_s: float
    frames: int


def ring_down(time_s: Array, tip_mm: Array, *, settle_mm: float = 0.05) -> Ringing:
    """Fit a vibration that dies away to the path of a tip.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Times of the frames, rising.
    tip_mm : ndarray, shape (n, 2)
        The tip; NaN in frames that were not measured.
    settle_mm : float
        Amplitude that counts as settled.

    Returns
    -------
    Ringing
        Along the line on which the tip moves most.

    Raises
    ------
    VisionError
        If too few frames were measured, or the tip does not ring.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(200) / 100.0
    >>> y = 2.0 * np.exp(-1.5 * t) * np.cos(2.0 * np.pi * 7.0 * t)
    >>> found = ring_down(t, np.column_stack([np.zeros_like(y), y]))
    >>> round(found.frequency_Hz, 3), round(found.damping_ratio, 4)
    (7.0, 0.0341)
    """
    seen = np.all(np.isfinite(tip_mm), axis=1)
    t, place = time_s[seen], _along_the_motion(tip_mm[seen])
    first = _release(place)
    t, place = t[first:], place[first:]
    if len(t) < LEAST_FRAMES:
        raise VisionError(
            f"a vibration needs {LEAST_FRAMES} measured frames from its largest "
            f"deflection on; instead received {len(t)}: film longer or faster"
        )
    start, t = float(t[0]), t - t[0]
    best = min((_start(t, place, ratio) for ratio in _DECAYS), key=_loss)
    (omega, decay), jacobian = _refined(t, place, best[0])
    residual, (rest, a, b) = _left(t, place, omega, decay)
    freedom = max(1, len(t) - 5)
    sd = math.sqrt(float(residual @ residual) / freedom)
    amplitude = math.hypot(a, b)
    if not amplitude > _CLEAR * sd:
        raise VisionError(
            "the tip does not ring: its largest deflection is "
            f"{amplitude:.3f} mm and {sd:.3f} mm of its path is no vibration"
        )
    covariance = sd**2 * np.linalg.pinv(jacobian.T @ jacobian)
    omega_sd, decay_sd = np.sqrt(np.diag(covariance))
    settled = math.log(max(amplitude / settle_mm, 1.0))
    settle_s = settle_sd_s = math.inf
    if decay > 0.0:
        settle_s, settle_sd_s = settled / decay, settled * float(decay_sd) / decay**2
    return Ringing(
        frequency_Hz=omega / (2.0 * math.pi),
        frequency_sd_Hz=float(omega_sd) / (2.0 * math.pi),
        damping_ratio=decay / math.hypot(omega, decay),
        damping_ratio_sd=float(decay_sd) / math.hypot(omega, decay),
        amplitude_mm=amplitude,
        settle_s=settle_s, settle_sd_s=settle_sd_s,
        rest_mm=float(rest), residual_mm=sd, first_s=start, frames=len(t),
    )  # fmt: skip


def _along_the_motion(tip: Array) -> Array:
    """Return the tip's place along the line on which it moves most."""
    if len(tip) < 2:
        return np.zeros(len(tip))
    away = tip - np.median(tip, axis=0)
    _, _, axes = np.linalg.svd(away, full_matrices=False)
    return np.asarray(away @ axes[0])


def _release(place: Array) -> int:
    """Return the last frame of the largest deflection before the tip swings back.

    A film may begin while the rod is still held.
    """
    if len(place) < LEAST_FRAMES:
        return 0
    rest = float(np.median(place[-len(place) // 4 :]))
    away = place - rest
    largest = int(np.argmax(np.abs(away)))
    away *= np.sign(away[largest]) or 1.0
    crossed = np.flatnonzero(away[largest:] < 0.0)
    end = largest + int(crossed[0]) if crossed.size else len(place)
    held = np.flatnonzero(away[:end] >= _HELD * away[largest])
    return int(held[-1])


def _left(t: Array, place: Array, omega: float, decay: float) -> tuple[Array, Array]:
    """Return what the model leaves, and its rest, cosine and sine."""
    fades = np.exp(-np.clip(decay, -5.0, 1e4) * t)
    design = np.column_stack(
        [np.ones_like(t), fades * np.cos(omega * t), fades * np.sin(omega * t)]
    )
    found = np.linalg.lstsq(design, place, rcond=None)[0]
    return np.asarray(place - design @ found), np.asarray(found)


def _refined(t: Array, place: Array, start: Array) -> tuple[tuple[float, float], Array]:
    """Return the best angular frequency and decay, and how residuals go with them."""
    from scipy.optimize import least_squares

    def left(x: Array) -> Array:
        return _left(t, place, float(x[0]), float(x[1]))[0]

    done = least_squares(left, start, x_scale=np.abs(start) + 0.1)
    return (abs(float(done.x[0])), float(done.x[1])), np.asarray(done.jac)


def _loss(found: tuple[Array, float]) -> float:
    return found[1]


def _start(t: Array, place: Array, ratio: float) -> tuple[Array, float]:
    """Return the best of a grid of frequencies up to half that of the frames."""
    step = float(np.median(np.diff(t)))
    low, high = math.pi / t[-1], math.pi / step
    grid = np.arange(low, high, 0.5 * math.pi / t[-1])
    losses = [float(np.sum(_left(t, place, w, ratio * w)[0] ** 2)) for w in grid]
    best = int(np.argmin(losses))
    return np.array([grid[best], ratio * grid[best]]), losses[best]
