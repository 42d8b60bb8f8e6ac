"""Student's t without scipy, which takes longer to import than a small fit to do."""

from __future__ import annotations

import math


def student_t_95(freedom: int) -> float:
    """Return how many standard deviations reach 95 % with some degrees of freedom.

    By bisection on the finite sums of Abramowitz and Stegun, Handbook of Mathematical
    Functions, 26.7.3 and 26.7.4, with t = sqrt(freedom) tan(angle).
    """
    low, high = 0.0, 0.5 * math.pi
    for _ in range(60):
        angle = 0.5 * (low + high)
        if _share(angle, freedom) < 0.95:
            low = angle
        else:
            high = angle
    return math.sqrt(freedom) * math.tan(low)


def _share(angle: float, freedom: int) -> float:
    """Return the probability of a smaller |t|."""
    cosine = math.cos(angle)
    is_odd = freedom % 2
    term = cosine if is_odd else 1.0
    total = 0.0
    for k in range(2 + is_odd, freedom + 1, 2):
        total += term
        term *= cosine * cosine * (k - 1) / k
    total *= math.sin(angle)
    return (angle + total) * 2.0 / math.pi if is_odd else total
