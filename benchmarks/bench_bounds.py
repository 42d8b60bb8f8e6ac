"""Do the error bounds bound? A hundred thousand random rods against scipy and magpylib.

    python benchmarks/bench_bounds.py [rods of each kind] [seed]

Paper-like rods at 1, 5 and 20 times the printed remanence, both signs, in uniform
fields of any direction and before a cube. Each tip that `solve` claims is marched back
to the clamp by scipy's DOP853 at 1e-13, under the flux that magpylib has at the tip,
with variational columns; the Newton step from there says how far the claimed tip is
from a true one (where the march back does not blow up: those are counted as tips). Tips
of `solve_many` are held against those of `solve`. Counts misses beyond the bounds; the
march is trusted to `ORACLE_MM`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import magpylib as magpy
import numpy as np
from bench_never_give_up import rods
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from magbend.core.errors import InputError
from magbend.core.magnet import Magnet
from magbend.core.units import MU0
from magbend.sim import MagnetField, Rod, Section, UniformField, solve, solve_many

Array = NDArray[np.float64]
Flux = Callable[[Array, Array], Array]

CUBE = Magnet.cube(55.0, 1.305)
ORACLE_MM = 5e-12
CHUNK = 500
WORST = 1e9
"""Condition beyond which a march back tells nothing: strong loads make it grow so."""
NEAR = 1e-5
"""Of the differences of the flux: of the length."""


def miss_mm(tip: Array, columns: dict[str, Array], flux_T: Flux) -> Array:
    """Return how far claimed tips are from true ones, in mm; NaN: cannot be told.

    Parameters
    ----------
    tip : ndarray, shape (3, n)
        Angle, x and y over length.
    columns : dict of arrays
        The designs.
    flux_T : callable
        Of x and y over length, shape (n,) each; returns shape (2, n).
    """
    n = tip.shape[1]
    length = columns["length_mm"].sum(axis=1)
    share = columns["length_mm"].T / length
    moment = columns["remanence_mT"] * 1e-3 / MU0 * 12.0 / columns["side_mm"] ** 2
    pull = moment * length**2 / (columns["E_MPa"].T * 1e6) * share  # a tesla's load
    _, x, y = tip
    bx, by = flux_T(x, y)
    dbx, dby = np.zeros((2, 3, n))
    dbx[1], dby[1] = (flux_T(x + NEAR, y) - flux_T(x - NEAR, y)) / (2.0 * NEAR)
    dbx[2], dby[2] = (flux_T(x, y + NEAR) - flux_T(x, y - NEAR)) / (2.0 * NEAR)

    def slope(_t: float, flat: Array, h: Array, load: Array) -> Array:
        state = flat.reshape(4, 4, n)  # theta, moment, x, y; themselves, derivatives
        c, s = np.cos(state[0, 0]), np.sin(state[0, 0])
        out = np.empty_like(state)
        out[0] = load * state[1]
        out[1, 0], out[2, 0], out[3, 0] = h * (s * bx - c * by), h * c, h * s
        dtheta = state[0, 1:]
        out[1, 1:] = h * ((c * bx + s * by) * dtheta + s * dbx - c * dby)
        out[2, 1:], out[3, 1:] = -h * s * dtheta, h * c * dtheta
        return out.ravel()

    state = np.zeros((4, 4, n))
    state[[0, 2, 3], 0] = tip
    state[[0, 2, 3], [1, 2, 3]] = 1.0
    for h, load in zip(share[::-1], pull[::-1], strict=True):
        state = solve_ivp(
            slope, (1.0, 0.0), state.ravel(), method="DOP853", args=(h, load),
            rtol=1e-13, atol=1e-14,
        ).y[:, -1].reshape(4, 4, n)  # fmt: skip
    left, matrix = state[[0, 2, 3], 0].T, state[[0, 2, 3], 1:].transpose(2, 0, 1)
    step = np.linalg.solve(matrix, left[:, :, None])[:, 1:, 0]
    miss = np.abs(step).max(axis=1) * length
    return np.where(np.linalg.cond(matrix) < WORST, miss, np.nan)


def flux_of(columns: dict[str, Array]) -> Flux:
    """Return the flux that the rods of some designs feel, in T."""
    if "flux_mT" in columns:
        turn = np.radians(columns["angle_deg"])
        flux = 1e-3 * columns["flux_mT"] * np.stack([np.cos(turn), np.sin(turn)])
        return lambda _x, _y: flux
    length = columns["length_mm"].sum(axis=1)
    cube = magpy.magnet.Cuboid(dimension=(0.055,) * 3, polarization=(0, 1.305, 0))

    def flux_T(x: Array, y: Array) -> Array:
        away = y * length + columns["gap_mm"] + 0.5 * CUBE.sides_mm[2]
        places = np.stack([(x - 1.0) * length, away, np.zeros_like(x)], axis=1)
        return np.array(cube.getB(1e-3 * places)[:, :2].T)

    return flux_T


def single(columns: dict[str, Array], i: int) -> tuple[float, float, float, float]:
    """Return tip angle, x and y over length that `solve` finds, and its bound in mm."""
    parts = zip(columns["length_mm"][i], columns["E_MPa"][i], strict=True)
    rod = Rod(
        name="random", side_mm=columns["side_mm"][i],
        remanence_mT=columns["remanence_mT"][i],
        sections=tuple(Section(length_mm=mm, E_MPa=MPa) for mm, MPa in parts),
    )  # fmt: skip
    field = (
        UniformField(flux_mT=columns["flux_mT"][i], angle_deg=columns["angle_deg"][i])
        if "flux_mT" in columns
        else MagnetField(magnet=CUBE, gap_mm=columns["gap_mm"][i])
    )
    try:
        found = solve(rod, field)
    except InputError:  # beyond the loads that are taken
        return np.nan, np.nan, np.nan, np.nan
    line = found.centreline
    if line is None:  # pulled in
        return np.nan, np.nan, np.nan, np.nan
    x, y = (one / rod.length_mm for one in line.tip_mm)
    return float(line.theta_rad[-1]), x, y, found.error_mm


def judge(name: str, columns: dict[str, Array]) -> None:
    """Print how many tips of some designs miss by more than their bounds."""
    length = columns["length_mm"].sum(axis=1)
    *tip, bound = np.array([single(columns, i) for i in range(length.size)]).T
    own = np.full(length.size, np.nan)
    for begin in range(0, length.size, CHUNK):
        at = np.flatnonzero(np.isfinite(bound[begin : begin + CHUNK])) + begin
        some = {key: values[at] for key, values in columns.items()}
        own[at] = miss_mm(np.array(tip)[:, at], some, flux_of(some))
    many = solve_many(columns, magnet=None if "flux_mT" in columns else CUBE)
    apart = np.maximum(
        np.abs(many["tip_x_mm"] - tip[1] * length),
        np.abs(many["tip_y_mm"] - tip[2] * length),
    )
    for who, miss, allowed in (
        ("solve", own, bound), ("solve_many", apart, many["error_mm"] + bound),
    ):  # fmt: skip
        beyond = np.sum(miss > allowed + ORACLE_MM)
        print(
            f"{name:12} {who:10} {np.isfinite(miss).sum():6} tips, {beyond} beyond; "
            f"largest miss {np.nanmax(miss):.1e} mm, bound {np.nanmax(allowed):.1e} mm"
        )


def main(n: int = 50_000, seed: int = 2026) -> None:
    """Print two rows for each field and remanence."""
    rng = np.random.default_rng(seed)
    each = n // 3
    for times in (1.0, 5.0, 20.0):
        designs = rods(rng, each, times, signs=1)
        designs["remanence_mT"] = designs["remanence_mT"][:, 0]
        gap = {"gap_mm": rng.uniform(30.0, 120.0, each)}
        flux = {
            "flux_mT": rng.uniform(0.0, 120.0, each),
            "angle_deg": rng.uniform(0.0, 360.0, each),
        }
        judge(f"uniform, {times:g}", designs | flux)
        judge(f"cube, {times:g}", designs | gap)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
