"""The Taylor march with a column for each unknown and parameter (`sensitivity`)."""

from __future__ import annotations

import math

import numpy as np

from ...core.jit import njit
from ..magnet.flux import PART, field_at, plane_source, source_at, sources_in
from ..planar.follow import solve3
from ..planar.march import STATE, SWING, WX, WY, E, H, M, add_load, begin, enter_section
from ..planar.taylor import advance, column_step, series, substeps


@njit(**PART)
def _field_change(field, changes, x, y, parts):  # type: ignore[no-untyped-def]
    """Return dB of one parameter at a fixed point (`sensitivity.parameters`).

    `parts`, shape (sources, 5), holds what each source does there.
    """
    fx = fy = 0.0
    for i in range(changes.shape[0]):
        change = changes[i]
        b = parts[i]
        fx += change[0] + change[2] * b[0] - b[2] * change[3] - b[3] * change[4]
        fy += change[1] + change[2] * b[1] - b[3] * change[3] - b[4] * change[4]
        if change[5] != 0.0:
            source = source_at(field, i)
            dx = x - source[4]
            dy = y - source[5]
            fx += change[5] * (-b[1] + b[2] * dy - b[3] * dx)
            fy += change[5] * (b[0] + b[3] * dy - b[4] * dx)
    return fx, fy


@njit(**PART)
def _load_columns(field, m, dm, changes, at_tip, x, y, cf, sf, X, D):  # type: ignore[no-untyped-def]
    """Add to all columns the change of the load m B(r) of the point (x, y)."""
    b = field_at(field, x, y)
    parts = np.empty((sources_in(field), 5))
    own, one = np.empty(12), np.empty(12)
    for i in range(parts.shape[0]):
        part = plane_source(field, i, x, y, own, one)
        for k in range(5):
            parts[i, k] = part[k]
    along = cf * b[0] + sf * b[1]
    across = 0.0 if at_tip and m != 0.0 else cf * b[1] - sf * b[0]
    for n in range(D.shape[0]):
        for a in range(4):
            px, py = _moved(n, a, D[n, 2, a], D[n, 3, a], X[2], X[3], cf, sf, D)
            dx = cf * px - sf * py
            dy = sf * px + cf * py
            bx, by = _field_change(field, changes[n, a], x, y, parts)
            bx += b[2] * dx + b[3] * dy
            by += b[3] * dx + b[4] * dy
            if at_tip and m != 0.0 and along != 0.0:
                D[n, SWING, a] = (b[0] * by - b[1] * bx) / (along * along)
            swing = D[n, SWING, a]
            fx = m * bx + dm[n, a] * b[0]
            fy = m * by + dm[n, a] * b[1]
            D[n, 4, a] += cf * fx + sf * fy + m * across * swing
            if not at_tip or m == 0.0:
                D[n, 5, a] += cf * fy - sf * fx - m * along * swing


@njit(**PART)
def _moved(n, a, dx, dy, x, y, cf, sf, D):  # type: ignore[no-untyped-def]
    """Return what column (n, a) does to a point (x, y), in the frame as it stands.

    The columns are in a frame that swings with the load at the tip, as those of x_L
    and y_L are in `planar.march`, which says why; `dx` and `dy` are theirs.
    """
    dx -= D[n, SWING, a] * y
    dy += D[n, SWING, a] * x
    if n == 0 and a == 1:
        dx += cf
        dy -= sf
    elif n == 0 and a == 2:
        dx += sf
        dy += cf
    return dx, dy


@njit(**PART)
def _enter_columns(rows, cf, sf, X, D):  # type: ignore[no-untyped-def]
    """Set the changes of what acts within a section, whose rod rows are `rows`."""
    for n in range(D.shape[0]):
        for a in range(4):
            wx = rows[n, a, WX]
            wy = rows[n, a, WY]
            D[n, 6, a] = rows[n, a, E]
            D[n, 7, a] = cf * wx + sf * wy + D[n, SWING, a] * X[8]
            D[n, 8, a] = cf * wy - sf * wx - D[n, SWING, a] * X[7]


@njit(**PART)
def _end_section(rows, X, D):  # type: ignore[no-untyped-def]
    """Move the end of a section, for parameters that change its length."""
    sine = math.sin(X[0])
    cosine = math.cos(X[0])
    for n in range(D.shape[0]):
        for a in range(4):
            dh = rows[n, a, H]
            D[n, 0, a] += dh * X[6] * X[1]
            D[n, 1, a] += dh * (X[4] * sine - X[5] * cosine)
            D[n, 2, a] -= dh * cosine
            D[n, 3, a] -= dh * sine
            D[n, 4, a] += dh * X[7]
            D[n, 5, a] += dh * X[8]


@njit(**PART)
def _integrate(h, order, C):  # type: ignore[no-untyped-def]
    """Turn the products with cos and sin into series of the positions, over tau / h."""
    for n in range(C.shape[0]):
        for k in range(order):
            f = h / (k + 1)
            for a in range(4):
                C[n, k, 2, a] *= f
                C[n, k, 3, a] *= f


@njit(**PART)
def _station_columns(r, h, order, before, grow, cf, sf, X, T, C, D, out):  # type: ignore[no-untyped-def]
    """Evaluate the columns at the fraction `r` of a step of length `h`.

    `before` holds their positions where the step begins, as X that of the rod, and the
    products in C are integrated (`_integrate`). `grow` holds how far the station slides
    along the section, as its distance from the clamp is kept while lengths change.
    """
    slope = sine = cosine = x0 = y0 = 0.0
    for k in range(order - 1, -1, -1):
        slope = slope * r + (k + 1) * T[0, k + 1]
        sine = sine * r + T[2, k]
        cosine = cosine * r + T[3, k]
        x0 = x0 * r + T[3, k] * h / (k + 1)
        y0 = y0 * r + T[2, k] * h / (k + 1)
    x0, y0 = X[2] - r * x0, X[3] - r * y0
    for n in range(C.shape[0]):
        for a in range(4):
            theta = C[n, order, 0, a]
            x = y = 0.0
            for k in range(order - 1, -1, -1):
                theta = theta * r + C[n, k, 0, a]
                x = x * r + C[n, k, 3, a]
                y = y * r + C[n, k, 2, a]
            x, y = before[n, 0, a] - r * x, before[n, 1, a] - r * y
            x, y = _moved(n, a, x, y, x0, y0, cf, sf, D)
            c = 4 * n + a
            out[0, c] = theta + D[n, SWING, a] + grow[n, a] * slope / h
            out[1, c] = x - grow[n, a] * cosine
            out[2, c] = y - grow[n, a] * sine


@njit(**PART)
def _combine(D, clamps, cf, sf, out):  # type: ignore[no-untyped-def]
    """Close the columns at the clamp: subtract what the unknowns must make up for.

    Return False if the Newton matrix is singular.
    """
    d = np.empty(3)
    for c in range(3, out.shape[2]):
        n = c // 4
        a = c % 4
        miss = D[n, 0, a] - clamps[n, a]
        if not solve3(D[0], miss, D[n, 2, a], D[n, 3, a], d):
            return False
        for k in range(out.shape[0]):
            for i in range(3):
                for j in range(3):
                    out[k, i, c] += out[k, i, j] * d[j]
            x = out[k, 1, c]
            y = out[k, 2, c]
            out[k, 1, c] = cf * x - sf * y
            out[k, 2, c] = sf * x + cf * y
    return True


@njit(cache=True, error_model="numpy")
def parameter_columns(rod, field, u, rods, changes, clamps, s, order, step, out):  # type: ignore[no-untyped-def]
    """March with a column for each unknown and parameter; return whether it went well.

    Parameters
    ----------
    rod, field, u
        The case and the unknowns (gamma, x_L, y_L, phi) of its equilibrium.
    rods : ndarray, shape (sections, b, 4, 5)
        Derivatives of the rod's rows with respect to parameters, in b blocks of four;
        the first three columns, those of the unknowns, are zero.
    changes, clamps : ndarray, shapes (b, 4, sources, 6), (b, 4)
        The same of the field (module docstring) and of the clamp angle.
    s : ndarray, shape (n,)
        Stations.
    order, step
        As of `planar.march.march`.
    out : ndarray, shape (n, 3, 4 b)
        Receives the derivatives of theta, x and y.
    """
    blocks = clamps.shape[0]
    X = np.empty(STATE)
    D = np.zeros((blocks, STATE, 4))
    T = np.empty((4, order + 1))
    C = np.empty((blocks, order + 1, 4, 4))
    before = np.empty((blocks, 2, 4))
    grow = np.zeros((blocks, 4))
    dm = np.empty((blocks, 4))
    for i in range(rod.shape[0]):
        for n in range(blocks):
            for a in range(4):
                grow[n, a] += rods[i, n, a, H]
    begin(u, 0, X, D[0])
    D[0, 0, 0] = 1.0
    k = s.shape[0] - 1
    reached = 0.0
    for i in range(rod.shape[0]):
        m = rod[i, M] - rod[i - 1, M] if i > 0 else rod[i, M]
        for n in range(blocks):
            for a in range(4):
                dm[n, a] = rods[i, n, a, M]
                if i > 0:
                    dm[n, a] -= rods[i - 1, n, a, M]
        add_load(rod, field, i, 1.0, u, 0, X, D[0])
        cf = math.cos(u[3])
        sf = math.sin(u[3])
        x = u[1] + cf * X[2] - sf * X[3]
        y = u[2] + sf * X[2] + cf * X[3]
        _load_columns(field, m, dm, changes, i == 0, x, y, cf, sf, X, D)
        enter_section(rod, i, 1.0, u, 0, X, D[0])
        _enter_columns(rods[i], cf, sf, X, D)
        count = substeps(rod[i, H], X, step)
        h = rod[i, H] / count
        for j in range(count):
            series(h, order, X, T)
            for n in range(blocks):
                for a in range(4):
                    before[n, 0, a] = D[n, 2, a]
                    before[n, 1, a] = D[n, 3, a]
                column_step(h, order, X, T, D[n], C[n])
            _integrate(h, order, C)
            last = i + 1 == rod.shape[0] and j + 1 == count
            while k >= 0 and (last or 1.0 - s[k] <= reached + h + 1e-13):
                r = (1.0 - s[k] - reached) / h
                _station_columns(r, h, order, before, grow, cf, sf, X, T, C, D, out[k])
                k -= 1
            advance(h, order, X, T)
            reached += h
        _end_section(rods[i], X, D)
        for n in range(blocks):
            for a in range(4):
                grow[n, a] -= rods[i, n, a, H]
    for n in range(blocks):
        for a in range(4):
            D[n, 2, a], D[n, 3, a] = _moved(
                n, a, D[n, 2, a], D[n, 3, a], X[2], X[3], cf, sf, D
            )
            D[n, 0, a] += D[n, SWING, a]
    return _combine(D, clamps, cf, sf, out)
