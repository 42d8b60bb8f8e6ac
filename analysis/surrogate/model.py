"""A surrogate for the whole shape of a graded rod in a uniform field across it.

Three sections, field at 90 deg to the rod. The shape depends on five numbers only: the
load, two shares of length, two ratios of compliance. With b_i = 12 B_r B L^2 / (mu0 E_i
a^2) and s over L, the angle of the linear beam is theta_lin' = b (1 - s), and what is
learnt is g = theta / theta_lin at fixed stations within each section, where it is
smooth: g = mean + modes of a polynomial (Legendre, total degree limited) in

    v = 1 / sqrt(1 + theta_lin(L)^2),  l_1,  l_2,  ln(b_2 / b_1),  ln(b_3 / b_2)

The *trust region* is the convex polytope between the smallest and largest trained
value of these and of l_3 and ln(b_3 / b_1). The *error bar* is split-conformal: a
smooth guess of the error's size, scaled to cover 95 % of designs kept out of the fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.units import MU0
from ...sim import Designs
from ..expansion.model_file import DAMAGE, damaged, read_model, write_model

Array = NDArray[np.float64]

SECTIONS = 3
PER_SECTION = 20
POINTS = SECTIONS * PER_SECTION + 1
COVERAGE = 0.95
FEATURES = ("v", "l1", "l2", "ln(b2/b1)", "ln(b3/b2)")
_ARRAYS = ("mean", "modes", "powers", "coefficients", "box", "polytope", "error_fit")
_ERROR_DEGREE = 3
_ROWS = 128
_SCHEMA = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Surrogate:
    """A fitted surrogate.

    Parameters
    ----------
    mean, modes : ndarray, shape (60,), (k, 60)
        Of g at the stations after the clamp.
    powers : ndarray, shape (terms, 5)
        Degree of each feature in each term.
    coefficients : ndarray, shape (terms, k)
    box : ndarray, shape (2, 5)
        Ends of the features, mapped onto -1 to 1.
    polytope : ndarray, shape (2, 7)
        Ends of features, l3 and ln(b3 / b1): the trust region.
    error_fit : ndarray, shape (error terms,)
        Polynomial of ln(error / L), shifted to cover 95 %.
    card : dict
        Data, errors, domain.
    """

    mean: Array
    modes: Array
    powers: NDArray[np.int64]
    coefficients: Array
    box: Array
    polytope: Array
    error_fit: Array
    card: dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """Predicted shapes.

    Parameters
    ----------
    points : ndarray, shape (n, 61, 5)
        s, x, y in mm, theta in rad, kappa in 1/mm, equally spaced within each section.
    error_mm : ndarray, shape (n,)
        The largest deviation of any point from the solver stays below this in 95 % of
        designs; NaN outside the trust region.
    inside : ndarray, shape (n,), bool
        Whether the design is in the trust region.
    """

    points: Array
    error_mm: Array
    inside: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaled:
    """Designs in dimensionless numbers.

    Parameters
    ----------
    load, share : ndarray, shape (n, 3)
        b_i (above zero) and l_i.
    sign : ndarray, shape (n,)
        +1 or -1: the sign of remanence times flux, which mirrors the shape.
    length_mm : ndarray, shape (n,)
    stations, linear : ndarray, shape (n, 61)
        s over L, and theta_lin.
    """

    load: Array
    share: Array
    sign: Array
    length_mm: Array
    stations: Array
    linear: Array


def scale(designs: Designs) -> Scaled:
    """Return designs in dimensionless numbers.

    Raises
    ------
    InputError
        If they are not of three sections in a uniform field at 90 deg.
    """
    if designs.flux_mT is None or designs.length_mm.shape[1] != SECTIONS:
        raise InputError(
            "the surrogate knows rods of three sections in a uniform field; solve "
            "others directly"
        )
    if np.any(designs.angle_deg != 90.0):
        raise InputError("the surrogate knows fields at angle_deg = 90 only")
    length_mm = designs.length_mm.sum(axis=1)
    share = designs.length_mm / length_mm[:, None]
    drive = designs.remanence_mT * designs.flux_mT * 1e-6 / MU0
    slender = (length_mm / designs.side_mm) ** 2
    b = 12.0 * np.abs(drive) * slender / (designs.E_MPa.T * 1e6)
    inner = np.arange(1, PER_SECTION + 1) / PER_SECTION
    start = np.cumsum(share, axis=1) - share
    s = (start[:, :, None] + share[:, :, None] * inner).reshape(len(share), -1)
    s = np.concatenate([np.zeros((len(share), 1)), s], axis=1)
    moment = s - 0.5 * s * s  # integral of 1 - s
    steps = np.diff(moment, axis=1) * np.repeat(b.T, PER_SECTION, axis=1)
    linear = np.concatenate([np.zeros((len(s), 1)), np.cumsum(steps, axis=1)], axis=1)
    return Scaled(
        load=b.T,
        share=share,
        sign=np.where(drive < 0.0, -1.0, 1.0),
        length_mm=length_mm,
        stations=s,
        linear=linear,
    )


def features(scaled: Scaled) -> Array:
    """Return the five features and the two more that bound the polytope, (n, 7)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.log(scaled.load)
    step = np.nan_to_num(np.diff(log, axis=1))
    return np.column_stack(
        [
            1.0 / np.sqrt(1.0 + scaled.linear[:, -1] ** 2),
            scaled.share[:, 0],
            scaled.share[:, 1],
            step,
            scaled.share[:, 2],
            step.sum(axis=1),
        ]
    )


def legendre(x: Array, powers: NDArray[np.int64]) -> Array:
    """Return products of Legendre polynomials, shape (n, terms)."""
    tables = np.polynomial.legendre.legvander(x, int(powers.max(initial=0)))
    out = tables[:, 0, powers[:, 0]]
    for j in range(1, powers.shape[1]):
        out *= tables[:, j, powers[:, j]]
    return np.asarray(out, dtype=np.float64)


def total_degree(variables: int, degree: int) -> NDArray[np.int64]:
    """Return all exponents of at most a total degree, shape (terms, variables)."""
    rows = [()]  # type: list[tuple[int, ...]]
    for _ in range(variables):
        rows = [(*row, p) for row in rows for p in range(degree - sum(row) + 1)]
    return np.array(rows, dtype=np.int64)


def to_box(model_box: Array, f: Array) -> Array:
    """Return features mapped so that the box becomes -1 to 1."""
    mapped: Array = 2.0 * (f - model_box[0]) / (model_box[1] - model_box[0]) - 1.0
    return mapped


def predict(model: Surrogate, designs: Designs) -> Prediction:
    """Predict whole shapes.

    Parameters
    ----------
    model : Surrogate
    designs : Designs
        Three sections, uniform field at 90 deg.

    Raises
    ------
    InputError
        If the designs are of another kind.
    """
    scaled = scale(designs)
    f = features(scaled)
    slack = 1e-9
    inside = np.all(
        (f >= model.polytope[0] - slack) & (f <= model.polytope[1] + slack), axis=1
    )
    x = to_box(model.box, f[:, : len(FEATURES)])
    ratio = np.empty((len(x), len(model.mean)))
    for start in range(0, len(x), _ROWS):  # small enough to stay in the cache
        rows = slice(start, start + _ROWS)
        weights = legendre(x[rows], model.powers) @ model.coefficients
        ratio[rows] = model.mean + weights @ model.modes
    theta = scaled.linear.copy()
    theta[:, 1:] *= ratio
    error = np.exp(error_terms(x) @ model.error_fit) * scaled.length_mm
    return Prediction(
        points=integrate(scaled, theta),
        error_mm=np.where(inside, error, np.nan),
        inside=inside,
    )


def error_terms(x: Array) -> Array:
    """Return the terms of the error's size."""
    return legendre(x, total_degree(len(FEATURES), _ERROR_DEGREE))


def integrate(scaled: Scaled, theta: Array) -> Array:
    """Return s, x, y, theta, kappa from angles at the stations (Simpson per pair).

    kappa = b M with the moment M = x(L) - x(s), exact for this load.
    """
    x = _simpson(np.cos(theta), scaled)
    y = _simpson(np.sin(theta), scaled)
    b = np.repeat(scaled.load, PER_SECTION, axis=1)
    b = np.concatenate([b, b[:, -1:]], axis=1)
    kappa = b * (x[:, -1:] - x)
    L = scaled.length_mm[:, None]
    sign = scaled.sign[:, None]
    columns = (scaled.stations * L, x * L, sign * y * L, sign * theta, sign * kappa / L)
    return np.stack(columns, axis=2)


def _simpson(values: Array, scaled: Scaled) -> Array:
    """Cumulative integral over s; odd stations by the parabola of their pair."""
    n = len(values)
    h = np.repeat(scaled.share / PER_SECTION, PER_SECTION // 2, axis=1)
    f0, f1, f2 = values[:, :-2:2], values[:, 1::2], values[:, 2::2]
    ends = np.cumsum(h / 3.0 * (f0 + 4.0 * f1 + f2), axis=1)
    out = np.zeros((n, POINTS))
    out[:, 2::2] = ends
    out[:, 1::2] = out[:, :-2:2] + h / 12.0 * (5.0 * f0 + 8.0 * f1 - f2)
    return out


def save(model: Surrogate, path: Path) -> None:
    """Write a surrogate to one ``.npz`` file (float32 coefficients, no pickle)."""
    small = {
        "modes": np.float32, "coefficients": np.float32, "error_fit": np.float32,
        "powers": np.uint8,
    }  # fmt: skip
    arrays: dict[str, Any] = {
        name: getattr(model, name).astype(small.get(name, np.float64))
        for name in _ARRAYS
    }
    write_model(path, {**arrays, "schema": np.int64(_SCHEMA)}, model.card)


def load(path: Path | None = None) -> Surrogate:
    """Read a surrogate; the packaged one without a path.

    Raises
    ------
    StoreError
        If the file is missing, damaged, or no surrogate.
    """
    source = path or Path(str(files("magbend.analysis") / "data" / "surrogate.npz"))
    try:
        found, card = read_model(source)
        if int(found["schema"]) != _SCHEMA:
            raise ValueError("unknown schema")
        arrays: dict[str, Any] = {
            name: found[name].astype(np.float64) for name in _ARRAYS
        }
        arrays["powers"] = found["powers"].astype(np.int64)
        model = Surrogate(card=card, **arrays)
        one = legendre(np.zeros((1, len(FEATURES))), model.powers)
        model.mean + one @ model.coefficients @ model.modes  # the arrays fit each other
    except DAMAGE as error:
        way_out = "magbend analysis surrogate fit --out FILE"
        raise damaged(source, "surrogate", error, way_out) from None
    return model
