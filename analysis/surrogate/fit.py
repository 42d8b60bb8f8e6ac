"""Fit the surrogate to solved shapes, and calibrate its error bar on others."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import within
from ...core.progress import Progress, silent
from ...sim import Designs, solve_shapes
from ..library.space import sobol_points
from .model import (
    COVERAGE,
    FEATURES,
    POINTS,
    Surrogate,
    error_terms,
    features,
    legendre,
    predict,
    scale,
    to_box,
    total_degree,
)

Array = NDArray[np.float64]

DOMAIN = {
    "E_MPa": (6.0, 48.0),
    "unit_length_mm": (5.0, 20.0),
    "side_mm": (0.75, 1.35),
    "remanence_mT": (14.0, 26.0),
    "flux_mT": (10.0, 120.0),
}
"""The domain of the packaged surrogate; moduli fall from root to tip."""
DEGREE = 7
MODES = 9
TRAINING, CALIBRATION = 16_384, 16_384


def draw(count: int, seed: int, *, towards_walls: bool = False) -> Designs:
    """Return designs that fill the domain.

    Parameters
    ----------
    count : int
    seed : int
    towards_walls : bool
        Draw with the density of Chebyshev points, dense at the walls of the domain,
        where polynomials go astray first, and begin with its 512 corners.
    """
    u = sobol_points(9, 0, count, seed)
    if towards_walls:
        u = 0.5 - 0.5 * np.cos(np.pi * u)
        corners = np.array(list(itertools.product((0.0, 1.0), repeat=u.shape[1])))
        u[: len(corners)] = corners[: len(u)]
    low, high = (
        np.repeat([DOMAIN[name][end] for name in DOMAIN], [3, 3, 1, 1, 1])
        for end in (0, 1)
    )
    p = low + u * (high - low)
    return Designs(
        E_MPa=np.sort(p[:, :3], axis=1)[:, ::-1],
        length_mm=p[:, 3:6],
        side_mm=p[:, 6],
        remanence_mT=p[:, 7],
        flux_mT=p[:, 8],
        angle_deg=np.full(count, 90.0),
    )


def fit(
    *,
    degree: int = DEGREE,
    modes: int = MODES,
    training: int = TRAINING,
    seed: int = 0,
    progress: Progress = silent,
) -> Surrogate:
    """Fit a surrogate over the domain.

    Parameters
    ----------
    degree, modes, training : int
        Total degree of the polynomial, number of shape modes, number of solves.
    seed : int
    progress : Progress

    Raises
    ------
    InputError
        If a number is out of range.
    """
    degree = int(within(degree, 1, 12, "degree", ""))
    modes = int(within(modes, 1, POINTS - 1, "modes", ""))
    powers = total_degree(len(FEATURES), degree)
    training = int(within(training, 2 * len(powers), 10**6, "training", "designs"))
    designs = draw(training, seed, towards_walls=True)
    theta = solve_shapes(designs, points=POINTS, by_section=True).points[:, :, 3]
    progress(1, 4)
    scaled = scale(designs)
    f = features(scaled)
    polytope = np.stack([f.min(axis=0), f.max(axis=0)])
    box = polytope[:, : len(FEATURES)]
    ratio = theta[:, 1:] / scaled.linear[:, 1:]
    mean = ratio.mean(axis=0)
    shapes = np.linalg.svd(ratio - mean, full_matrices=False)[2][:modes]
    basis = legendre(to_box(box, f[:, : len(FEATURES)]), powers)
    progress(2, 4)
    # Errors count in mm: an angle's error is theta_lin times that of the ratio.
    weight = (scaled.linear[:, -1] * scaled.length_mm)[:, None]
    weight = weight / weight.mean() + 0.05
    target = (ratio - mean) @ shapes.T
    square = (basis * weight**2).T @ basis
    right = (basis * weight**2).T @ target
    square += 1e-13 * np.trace(square) / len(square) * np.eye(len(square))
    coefficients = np.linalg.solve(square, right)
    progress(3, 4)
    model = Surrogate(
        mean=mean,
        modes=shapes,
        powers=powers,
        coefficients=coefficients.astype(np.float32).astype(np.float64),
        box=box,
        polytope=polytope,
        error_fit=np.zeros(len(total_degree(len(FEATURES), 3))),
        card={},
    )
    model = _calibrated(model, seed + 1)
    progress(4, 4)
    return model


def deviations(model: Surrogate, designs: Designs) -> tuple[Array, Any]:
    """Return distances from the solver at every station (n, 61), and the prediction."""
    truth = solve_shapes(designs, points=POINTS, by_section=True).points
    predicted = predict(model, designs)
    away = predicted.points[:, :, 1:3] - truth[:, :, 1:3]
    return np.hypot(away[:, :, 0], away[:, :, 1]), predicted


def _calibrated(model: Surrogate, seed: int) -> Surrogate:
    """Fit the error's size on half of unseen designs, scale it on the other half."""
    from dataclasses import replace

    designs = draw(CALIBRATION, seed)
    away, _ = deviations(model, designs)
    scaled = scale(designs)
    x = to_box(model.box, features(scaled)[:, : len(FEATURES)])
    size = np.log(away.max(axis=1) / scaled.length_mm + 1e-12)
    terms = error_terms(x)
    half = len(size) // 2
    guess = np.linalg.lstsq(terms[:half], size[:half], rcond=None)[0]
    excess = np.sort((size - terms @ guess)[half:])
    rank = min(int(np.ceil(COVERAGE * (len(excess) + 1))) - 1, len(excess) - 1)
    shifted = guess.copy()
    constant = int(np.flatnonzero(total_degree(len(FEATURES), 3).sum(axis=1) == 0)[0])
    shifted[constant] += excess[rank]
    card = {
        "what": "whole shape of a rod of three sections in a uniform field at 90 deg",
        "units": "mm, rad; inputs mm, MPa, mT",
        "data": f"magbend rod solver, {TRAINING} solves to fit, {CALIBRATION} to check",
        "domain": {**DOMAIN, "moduli": "falling from root to tip"},
        "rms_mm": float(np.sqrt(np.mean(away**2))),
        "worst_tip_mm": float(away[:, -1].max()),
        "coverage": COVERAGE,
        "terms": len(model.powers),
        "modes": len(model.modes),
    }
    return replace(model, error_fit=shifted, card=card)
