"""How a rod rings after a step: frequency, damping and settling from its tip's path.

A small free vibration in one mode is x(t) = r + exp(-d t) (a cos w t + b sin w t). A
large one is not: the tip runs on a bent path and the rod stiffens, which adds terms of
the amplitude's square (at frequencies 0 and 2 w, with decay 2 d) and cube (w and 3 w, 3
d; Nayfeh and Mook 1979, section 2.3). Taken for small, a swing by 20 degrees has its
damping wrong by ten deviations. How many terms the path needs is weighed by Akaike's
criterion, which rather takes one too many than leaves out one that is there.

For given w and d the other numbers follow by linear least squares, so only two are
sought (variable projection, Golub and Pereyra 1973).
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
_FREE = 0.5
"""Share of the largest deflection below which the rod is surely let go: it is held in
the frame before its release, and moves otherwise than a vibration carried back."""
_CLEAR = 3.0
"""Amplitude over the residual, below which nothing rings."""
_DECAYS = 0.0, 0.01, 0.03, 0.1, 0.3
"""Damping ratios from which the best fit is sought."""
_TERMS = ((0, 0), (1, 1)), ((2, 0), (2, 2)), ((3, 1), (3, 3))
"""What the amplitude's first power adds, its square and its cube: times the decay, and
times the frequency."""


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
        At the first frame that was used, without what its square and cube add.
    settle_s, settle_sd_s : float
        From there until the amplitude is below what counts as settled; infinite for a
        vibration that does not die away.
    rest_mm : float
        Where the tip comes to rest along its line of motion.
    residual_mm : float
        Standard deviation of what the model leaves.
    first_s : float
        Time of the first frame that was used, the rod being let go.
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
    found, covariance, sd = _weighed(_fits(t, place, best[0]))
    omega, decay, rest, a, b = found.tolist()
    amplitude = math.hypot(a, b)
    if not amplitude > _CLEAR * sd:
        raise VisionError(
            "the tip does not ring: its largest deflection is "
            f"{amplitude:.3f} mm and {sd:.3f} mm of its path is no vibration"
        )
    omega_sd, decay_sd = np.sqrt(np.diag(covariance)[:2])
    settled = math.log(max(amplitude / settle_mm, 1.0))
    settle_s = settle_sd_s = math.inf
    if decay > 0.0:
        settle_s = settled / decay
        by = np.array([0.0, -settle_s, 0.0, a / amplitude**2, b / amplitude**2]) / decay
        settle_sd_s = math.sqrt(by @ covariance @ by) if settled else 0.0
    return Ringing(
        frequency_Hz=omega / (2.0 * math.pi),
        frequency_sd_Hz=float(omega_sd) / (2.0 * math.pi),
        damping_ratio=decay / math.hypot(omega, decay),
        damping_ratio_sd=float(decay_sd) / math.hypot(omega, decay),
        amplitude_mm=amplitude,
        settle_s=settle_s, settle_sd_s=settle_sd_s,
        rest_mm=rest, residual_mm=sd, first_s=start, frames=len(t),
    )  # fmt: skip


def _along_the_motion(tip: Array) -> Array:
    """Return the tip's place along the line on which it moves most."""
    if len(tip) < 2:
        return np.zeros(len(tip))
    away = tip - np.median(tip, axis=0)
    _, _, axes = np.linalg.svd(away, full_matrices=False)
    return np.asarray(away @ axes[0])


def _release(place: Array) -> int:
    """Return the first frame in which the tip surely swings back freely.

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
    held = np.flatnonzero(away[:end] >= _FREE * away[largest])
    return int(held[-1]) + 1


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fit:
    """A vibration with terms up to one power of its amplitude.

    `found` are angular frequency, decay, rest, and the linear term's cosine and sine.
    """

    found: Array
    covariance: Array
    sd: float
    criterion: float


def _fits(t: Array, place: Array, start: Array) -> list[_Fit]:
    """Return the fits of all powers that so many frames can tell."""
    fits: list[_Fit] = []
    for power in range(1, len(_TERMS) + 1):
        start = _refined(t, place, start, power)
        residual, linear, design, by_omega, by_decay = _left(
            t, place, start[0], start[1], power
        )
        unknown = len(linear) + 2
        if fits and len(t) < 2 * unknown:
            break
        rows = np.column_stack([by_omega @ linear, by_decay @ linear, design])
        loss = float(residual @ residual)
        variance = loss / max(1, len(t) - unknown)
        inverse = np.linalg.pinv(rows.T @ rows)
        fits.append(_Fit(
            found=np.array([abs(start[0]), start[1], *linear[:3]]),
            covariance=variance * inverse[:5, :5], sd=math.sqrt(variance),
            criterion=len(t) * math.log(loss + 1e-30) + 2.0 * unknown,
        ))  # fmt: skip
    return fits


def _weighed(fits: list[_Fit]) -> tuple[Array, Array, float]:
    """Return the mean of the fits, weighed by likelihood, its covariance and noise.

    The covariance holds the doubt which of them is right (Hoeting et al. 1999).
    """
    loss = np.array([fit.criterion for fit in fits])
    weights = np.exp(-0.5 * (loss - loss.min()))
    weights /= weights.sum()
    each = np.array([fit.found for fit in fits])
    found = weights @ each
    covariance = (weights * (each - found).T) @ (each - found)
    for fit, weight in zip(fits, weights, strict=True):
        covariance += weight * fit.covariance
    return found, covariance, fits[int(np.argmax(weights))].sd


def _left(
    t: Array, place: Array, omega: float, decay: float, power: int = 1
) -> tuple[Array, Array, Array, Array, Array]:
    """Return what the model leaves, its factors, its terms, and what changes these.

    The first three factors are rest, cosine and sine; terms change with the angular
    frequency and with the decay.
    """
    decay = min(max(decay, -5.0), 1e4)
    columns = []
    for times, harmonic in (term for terms in _TERMS[:power] for term in terms):
        wave = np.exp(-times * decay * t) * np.exp(1j * harmonic * omega * t)
        each = np.array([wave, 1j * harmonic * t * wave, -times * t * wave])
        columns += [each.real, each.imag] if harmonic else [each.real]
    design, by_omega, by_decay = np.moveaxis(np.array(columns), 0, 2)
    linear = np.linalg.lstsq(design, place, rcond=None)[0]
    return np.asarray(place - design @ linear), linear, design, by_omega, by_decay


def _refined(t: Array, place: Array, start: Array, power: int) -> Array:
    """Return the best angular frequency and decay."""
    from scipy.optimize import least_squares

    def left(x: Array) -> Array:
        return _left(t, place, float(x[0]), float(x[1]), power)[0]

    return np.asarray(least_squares(left, start, x_scale=np.abs(start) + 0.1).x)


def _loss(found: tuple[Array, float]) -> float:
    return found[1]


def _start(t: Array, place: Array, ratio: float) -> tuple[Array, float]:
    """Return the likeliest of a grid of frequencies, and its loss; a matched filter."""
    step = float(np.median(np.diff(t)))
    grid = np.arange(math.pi / t[-1], math.pi / step, 0.5 * math.pi / t[-1])[:, None]
    waves = np.exp((1j - ratio) * grid * t)
    power = np.sum(np.abs(waves) ** 2, axis=1)
    best = int(np.argmax(np.abs(waves @ (place - place.mean())) ** 2 / power))
    omega = float(grid[best, 0])
    residual = _left(t, place, omega, ratio * omega)[0]
    return np.array([omega, ratio * omega]), float(residual @ residual)
