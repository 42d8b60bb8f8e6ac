"""Fields of rings and of cylindrical current sheets, with their gradients.

A ring of radius a and current I has, with K = mu0 I / 4 pi, d^2 = a^2 + rho^2 + z^2 -
2 a rho cos(phi) and J(m, n) the integral of cos(phi)^m / d^n over a turn,

    B_rho = K a z J(1, 3),   B_z = K a (a J(0, 3) - rho J(1, 3)),

whose derivatives by z hold J(., 5). J comes from complete elliptic integrals; near the
axis and far away, where these cancel, from a sum over twelve points of the turn, which
there is exact to rounding, with B_rho / rho by parts: J(1, 3) = 3 a rho (J(0, 5) -
J(2, 5)). A sheet, which is also the field of a cylinder polarised along its axis
(mu0 I per length = B_r), is the integral of rings: B in closed form (Derby and Olbert,
Am. J. Phys. 78, 229, 2010), and dB/dz the difference of the rings at its ends. The rest
of the gradient follows as there is neither curl nor divergence.

All functions return (B_rho, B_z, B_rho / rho, dB_rho / dz, dB_z / dz) per unit of the
strength, at a point (rho, z) off the winding.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit

OPTIONS = {
    "cache": True,
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}
SUMMED = 0.1
"""Below this k^2 the twelve points are exact: they leave (k^2 / 4)^12."""
_COSINES = np.cos((np.arange(6) + 0.5) * math.pi / 6.0)
_WEIGHT = math.pi / 3.0


@njit(**OPTIONS)
def _cel(kc, p, c, s):  # type: ignore[no-untyped-def]
    """Return Bulirsch's complete elliptic integral (Numer. Math. 13, 305, 1969)."""
    k = abs(kc)
    em = 1.0
    pp = math.sqrt(p)
    f = c
    s = s / pp
    c = c + s / pp
    g = k / pp
    s = 2.0 * (s + f * g)
    pp = g + pp
    g = em
    em = k + em
    kk = k
    for _ in range(30):
        if abs(g - k) <= g * 1e-8:
            break
        k = 2.0 * math.sqrt(kk)
        kk = k * em
        f = c
        c = c + s / pp
        g = kk / pp
        s = 2.0 * (s + f * g)
        pp = g + pp
        g = em
        em = k + em
    return 0.5 * math.pi * (s + c * em) / (em * (em + pp))


@njit(**OPTIONS)
def ring(a, rho, z):  # type: ignore[no-untyped-def]
    """Return the field of a ring, per K."""
    total = a * a + rho * rho + z * z
    twice = 2.0 * a * rho
    far2 = total + twice
    if 2.0 * twice < SUMMED * far2:
        j03 = j05 = j15 = j25 = 0.0
        for c in _COSINES:
            d2 = total - twice * c
            d3 = _WEIGHT / (d2 * math.sqrt(d2))
            d5 = d3 / d2
            j03 += d3
            j05 += d5
            j15 += c * d5
            j25 += c * c * d5
        over = 3.0 * a * (j05 - j25)
        j13 = rho * over
    else:
        near2 = (a - rho) * (a - rho) + z * z
        kc2 = near2 / far2
        kc = math.sqrt(kc2)
        first = _cel(kc, 1.0, 1.0, 1.0)
        second = _cel(kc, 1.0, 1.0, kc2)
        f = 4.0 / math.sqrt(far2)
        j01 = f * first
        j03 = f * second / near2
        j05 = f * (2.0 * (1.0 + kc2) * second - kc2 * first) / (3.0 * near2 * near2)
        j13 = (total * j03 - j01) / twice
        j15 = (total * j05 - j03) / twice
        over = j13 / rho
    return (
        a * z * j13,
        a * (a * j03 - rho * j13),
        a * z * over,
        a * (j13 - 3.0 * z * z * j15),
        -3.0 * a * z * (a * j05 - rho * j15),
    )


@njit(**OPTIONS)
def _sheet_end(a, rho, z):  # type: ignore[no-untyped-def]
    """Return what one end, at a height -z, adds to B_rho, B_z and B_rho / rho."""
    total = a * a + rho * rho + z * z
    twice = 2.0 * a * rho
    far2 = total + twice
    kc = math.sqrt(((a - rho) * (a - rho) + z * z) / far2)
    if 2.0 * twice < SUMMED * far2:
        over = 0.0
        for c in _COSINES:
            d2 = total - twice * c
            over += _WEIGHT * (1.0 - c * c) / (d2 * math.sqrt(d2))
        over *= a
        j11 = rho * over
    else:
        j11 = 4.0 / math.sqrt(far2) * _cel(kc, 1.0, -1.0, 1.0)
        over = j11 / rho
    g = (a - rho) / (a + rho)
    third = _cel(kc, 1.0, 1.0, 1.0) if g == 0.0 else _cel(kc, g * g, 1.0, g)
    along = 4.0 * a / (a + rho) * z / math.sqrt(far2) * third
    return -a * j11, along, -a * over


@njit(**OPTIONS)
def sheet(a, b, rho, z):  # type: ignore[no-untyped-def]
    """Return the field of a sheet of half length b, per B_r / 4 pi."""
    top = _sheet_end(a, rho, z + b)
    bottom = _sheet_end(a, rho, z - b)
    upper = ring(a, rho, z + b)
    lower = ring(a, rho, z - b)
    return (
        top[0] - bottom[0],
        top[1] - bottom[1],
        top[2] - bottom[2],
        upper[0] - lower[0],
        upper[1] - lower[1],
    )
