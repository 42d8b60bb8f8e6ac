"""The planar rod on which loads of one sign act along one direction.

Dimensionless as `planar.march`. In a uniform field, without weight and with one sign of
magnetisation, gamma (the angle from the load) solves (gamma' / e)' = P sin(gamma) with
gamma' = 0 at the tip and gamma = T at the clamp. With v = pi - gamma this is
-(v' / e)' = P sin(v), and sin(v) / v falls on (0, pi): by the theorem of Brezis and
Oswald (Nonlinear Analysis 10, 55, 1986) there is exactly one solution inside (0, pi).
It is connected to zero load, it is stable, and as gamma at the clamp crosses T once, a
bracketed Newton on the tip angle alone finds it at any load. tan(gamma / 4) at the
clamp is nearly proportional to its value at the tip, so the iteration runs on these.
"""

from __future__ import annotations

import math

from ...core.jit import njit
from ..magnet.flux import PART, is_uniform
from .march import WX, WY, E, H, M


@njit(**PART)
def one_sided(rod, field):  # type: ignore[no-untyped-def]
    """Tell whether the first road applies: uniform field, one sign, no weight."""
    if not is_uniform(field) or rod[0, M] == 0.0:
        return False
    for i in range(rod.shape[0]):
        if rod[i, WX] != 0.0 or rod[i, WY] != 0.0 or rod[i, M] * rod[0, M] < 0.0:
            return False
    return True


@njit(**PART)
def _growth(rod, flux):  # type: ignore[no-untyped-def]
    """Return by what factor a small angle from the load grows from tip to clamp."""
    g = 1.0
    r = 0.0
    for i in range(rod.shape[0]):
        p = abs(rod[i, M]) * flux
        w = math.sqrt(rod[i, E] * p)
        c = math.cosh(rod[i, H] * w)
        s = rod[i, H] if w == 0.0 else math.sinh(rod[i, H] * w) / w
        g, r = g * c + r * rod[i, E] * s, r * c + g * p * s
    return g


@njit(**PART)
def first_guess(rod, field, clamp, u, bracket):  # type: ignore[no-untyped-def]
    """Set u and the bracket (low, high, guess, goal, side) of a one-sided rod.

    Return the angle from the load at which a march may stop: pi, but for a rod that
    starts against the field and stays there.
    """
    sign = 1.0 if rod[0, M] > 0.0 else -1.0
    u[3] = math.atan2(sign * field[2], sign * field[1])
    target = clamp - u[3]
    target -= 2.0 * math.pi * math.floor(target / (2.0 * math.pi) + 0.5)
    u[3] = clamp - target
    side = -1.0 if target < 0.0 else 1.0
    goal = math.tan(0.25 * abs(target))
    guess = goal / _growth(rod, math.hypot(field[1], field[2]))
    bracket[0] = 0.0
    bracket[1] = goal
    bracket[2] = guess
    bracket[3] = goal
    bracket[4] = side
    u[0] = side * 4.0 * math.atan(guess)
    if abs(target) > math.pi - 1e-12:
        u[0] = target
        return math.inf
    return math.pi


@njit(**PART)
def narrow(passed, enough, X, D, u, bracket):  # type: ignore[no-untyped-def]
    """Improve the bracketed guess by what a march found; return whether it is done."""
    low, high, t, goal, side = (
        bracket[0], bracket[1], bracket[2], bracket[3], bracket[4],
    )  # fmt: skip
    new = -1.0
    if passed:
        high = t
    else:
        g = math.tan(0.25 * side * X[0])
        if g > goal:
            high = t
        else:
            low = t
        new = t - (g - goal) * (1.0 + t * t) / (D[0, 0] * (1.0 + g * g))
    done = not passed and abs(new - t) <= enough * t
    if not done and not low < new < high:
        new = math.sqrt(low * high) if low > 0.0 else 0.1 * high
    bracket[0] = low
    bracket[1] = high
    bracket[2] = new
    u[0] = side * 4.0 * math.atan(new)
    return done
