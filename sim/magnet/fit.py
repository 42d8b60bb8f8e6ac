"""The remanence of a magnet from Tesla-meter readings on its axis.

On the axis of a cuboid of sides a, b and c (along the polarisation), at the distance d
from its N face,

    B = (B_r / pi) [atan(a b / (2 z sqrt(4 z^2 + a^2 + b^2)))]  from z = d + c to z = d,

the closed form of the integral in the paper's Eqs. 1-4 (`axis_flux_by_integral_mT`). Of
two readers of one magnet each reading should give the same B_r; where they do not, the
gap, the probe or the magnet's shape is wrong, and the fit says which readings disagree.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from ...core.checks import finite, positive, size, vector, within
from ...core.errors import InputError
from ...core.units import mT_from_T
from .student_t import student_t_95

Array = NDArray[np.float64]
Sides = tuple[float, float, float]
CUBE_OF_PAPER_MM: Sides = (55.0, 55.0, 55.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingVerdict:
    """What one reading says, alone and beside the others.

    Parameters
    ----------
    gap_mm, flux_mT : float
        The reading.
    remanence_T : float
        What this reading alone gives, at the fitted offset.
    predicted_mT : float
        What the one remanence of all readings predicts here.
    residual_mT, residual_percent : float
        Predicted minus measured, and that in percent of the measured.
    verdict : str
        ``ok`` beside the median of all readings, or a sentence.
    """

    gap_mm: float
    flux_mT: float
    remanence_T: float
    predicted_mT: float
    residual_mT: float
    residual_percent: float
    verdict: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MagnetFit:
    """One remanence for all readings.

    Parameters
    ----------
    remanence_T, remanence_sd_T : float
        The remanence and its standard deviation; NaN with one reading and no sd, also
        if that reading is given more than once.
    remanence_95_T : tuple of float
        Its 95 % interval: the wider of what the scatter (Student's t) and the standard
        deviations given (normal) say.
    offset_mm, offset_sd_mm : float
        How much farther than stated the probe's sensitive point is from the N face; 0
        unless it was fitted.
    readings : tuple of ReadingVerdict
        In the order given.
    chi2_reduced : float
        Of the residuals over their standard deviations (over `tolerance_percent` of the
        readings where none was given); NaN where no reading is left over.
    birge_ratio : float
        By how much the scatter of the readings exceeds the standard deviations given,
        the root of `chi2_reduced`: both of the fit's are widened by it. 1 where it does
        not, or none were given.
    """

    remanence_T: float
    remanence_sd_T: float
    remanence_95_T: tuple[float, float]
    offset_mm: float
    offset_sd_mm: float
    readings: tuple[ReadingVerdict, ...]
    chi2_reduced: float
    birge_ratio: float


def axis_share(
    distance_mm: float | Array, sides_mm: Sides = CUBE_OF_PAPER_MM
) -> float | Array:
    """Return B / B_r on the axis of a cuboid, `distance_mm` from its N face."""
    a, b, c = sides_mm

    def angle(z: float | Array) -> float | Array:
        root = np.sqrt(4.0 * np.square(z) + a * a + b * b)
        return np.arctan2(a * b, 2.0 * z * root)  # type: ignore[no-any-return]

    share = (angle(distance_mm) - angle(distance_mm + c)) / math.pi
    return share if isinstance(share, np.ndarray) and share.ndim else float(share)


def axis_flux_by_integral_mT(
    remanence_T: float,
    distance_mm: float,
    sides_mm: Sides = CUBE_OF_PAPER_MM,
    *,
    nodes: int = 96,
) -> float:
    """Return B on the axis in mT by the paper's Eqs. 1-4, integrated numerically.

    The magnet's two pole faces as sheets of charge, by a product of Gauss-Legendre
    rules: a check of the closed form, which everything else uses.
    """
    a, b, c = sides_mm
    t, w = np.polynomial.legendre.leggauss(nodes)
    x = 0.5 * a * t[:, None]
    y = 0.5 * b * t[None, :]
    weight = 0.25 * a * b * w[:, None] * w[None, :]
    north = distance_mm / (x * x + y * y + distance_mm**2) ** 1.5
    far = distance_mm + c
    south = far / (x * x + y * y + far**2) ** 1.5
    flux_T = remanence_T / (4.0 * math.pi) * float(np.sum(weight * (north - south)))
    return mT_from_T(flux_T)


def fit_magnet(
    gaps_mm: Sequence[float],
    flux_mT: Sequence[float],
    *,
    sides_mm: Sides = CUBE_OF_PAPER_MM,
    sd_mT: Sequence[float] | None = None,
    free_offset: bool = False,
    tolerance_percent: float = 1.0,
) -> MagnetFit:
    """Fit one remanence, and if asked one probe offset, to readings on the axis.

    Parameters
    ----------
    gaps_mm : sequence of float
        Distances from the centre of the N face, in mm.
    flux_mT : sequence of float
        Readings there, in mT; all of one sign.
    sides_mm : tuple of float
        Sides of the magnet, the last along the polarisation, in mm.
    sd_mT : sequence of float, optional
        Standard deviation of each reading, in mT. Without it all readings are taken to
        be equally exact in percent, and their own scatter gives the uncertainty. Where
        the readings scatter more than it allows, the uncertainty is widened.
    free_offset : bool
        Fit the offset of the probe's sensitive point along the axis too.
    tolerance_percent : float
        How far a reading may be from what the median of all needs and be called ``ok``,
        in percent of it; with `sd_mT` two standard deviations, if that is more.

    Returns
    -------
    MagnetFit

    Raises
    ------
    InputError
        If a number cannot be, or there are fewer readings than unknowns.

    Notes
    -----
    The widening is that of R. T. Birge, Physical Review 40, 207 (1932): all standard
    deviations given are taken to be too small by one factor. It cannot see an error
    that the readings share, such as a wrong gap; `free_offset` looks for that.
    """
    gaps, flux, sd = _checked(gaps_mm, flux_mT, sd_mT, 2 if free_offset else 1)
    vector(sides_mm, "magnet sides_mm", "mm")
    for side in sides_mm:
        size(side, "magnet side_mm", "mm")
    tolerance = positive(tolerance_percent, "tolerance_percent", "percent") / 100.0
    sigma = tolerance * np.abs(flux) if sd is None else sd
    offset = _best_offset(gaps, flux, sigma, sides_mm) if free_offset else 0.0
    share = np.asarray(axis_share(gaps + offset, sides_mm)) * 1e3
    weight = 1.0 / sigma**2
    remanence = float(np.sum(weight * share * flux) / np.sum(weight * share**2))
    predicted = remanence * share
    # A reading given twice to its last digit tells of its scatter once.
    told = len(flux) if sd is not None else len(set(zip(gaps, flux, strict=True)))
    spare = told - (2 if free_offset else 1)
    chi2 = float(np.sum(weight * (predicted - flux) ** 2))
    chi2_reduced = chi2 / spare if spare > 0 else math.nan
    step = 1e-4 * sides_mm[2]
    slope = (
        remanence
        * (
            np.asarray(axis_share(gaps + offset + step, sides_mm))
            - np.asarray(axis_share(gaps + offset - step, sides_mm))
        )
        * (1e3 / (2.0 * step))
    )
    columns = np.column_stack([share, slope] if free_offset else [share])
    covariance = np.linalg.inv(columns.T @ (columns * weight[:, None]))
    deviations = np.sqrt(np.diag(covariance))
    scatter = math.sqrt(chi2_reduced)
    widened = sd is None or scatter > 1.0
    half = float(deviations[0]) * _reach_95(scatter, spare, stated=sd is not None)
    if widened:
        deviations = deviations * scatter
    alone = flux / share
    allowed = tolerance * np.abs(flux)
    if sd is not None:
        allowed = np.maximum(allowed, 2.0 * sd)
    readings = tuple(
        ReadingVerdict(
            gap_mm=float(gaps[i]),
            flux_mT=float(flux[i]),
            remanence_T=float(alone[i]),
            predicted_mT=float(predicted[i]),
            residual_mT=float(predicted[i] - flux[i]),
            residual_percent=float(100.0 * (predicted[i] - flux[i]) / flux[i]),
            verdict=_verdict(alone, i, share[i], flux[i], allowed[i]),
        )
        for i in range(len(flux))
    )
    return MagnetFit(
        remanence_T=remanence,
        remanence_sd_T=float(deviations[0]),
        remanence_95_T=(remanence - half, remanence + half),
        offset_mm=offset,
        offset_sd_mm=float(deviations[1]) if free_offset else 0.0,
        readings=readings,
        chi2_reduced=chi2_reduced,
        birge_ratio=scatter if sd is not None and widened else 1.0,
    )


def _reach_95(scatter: float, spare: int, *, stated: bool) -> float:
    """Return how many standard deviations reach 95 %.

    By Student's t for the scatter seen; if they are stated, at least by the normal law.
    """
    by_scatter = student_t_95(spare) * scatter if spare > 0 else math.nan
    return max(NormalDist().inv_cdf(0.975), by_scatter) if stated else by_scatter


def _checked(
    gaps_mm: Sequence[float],
    flux_mT: Sequence[float],
    sd_mT: Sequence[float] | None,
    unknowns: int,
) -> tuple[Array, Array, Array | None]:
    gaps = np.array([finite(value, "gap_mm", "mm") for value in gaps_mm])
    flux = np.array([finite(value, "flux_mT", "mT") for value in flux_mT])
    sd = None
    if sd_mT is not None:
        sd = np.array([finite(value, "sd_mT", "mT") for value in sd_mT])
    if (
        gaps.ndim != 1
        or gaps.shape != flux.shape
        or (sd is not None and sd.shape != gaps.shape)
    ):
        raise InputError(
            "gaps_mm, flux_mT and sd_mT must be lists of one length; instead received "
            f"{gaps.shape} mm and {flux.shape} mT"
        )
    if len(set(gaps)) < unknowns:
        raise InputError(
            f"the fit must have readings of flux_mT at {unknowns} or more different "
            f"gap_mm; instead received {len(set(gaps))}"
        )
    if np.any(gaps <= 0.0):
        raise InputError(
            f"gap_mm must be above zero in mm; instead received {gaps.tolist()}"
        )
    if not (np.all(flux > 0.0) or np.all(flux < 0.0)):
        raise InputError(
            "flux_mT must be finite, not zero and of one sign in mT; instead received "
            f"{flux.tolist()}"
        )
    for gap in gaps:
        within(float(gap), 0.0, 1e5, "gap_mm", "mm")
    for value in flux:
        within(float(value), -3e4, 3e4, "flux_mT", "mT")
        if abs(value) < 1e-6:
            raise InputError(
                f"flux_mT must be above 1e-06 mT in size; instead received {value:g}"
            )
    for value in () if sd is None else sd:
        size(float(value), "sd_mT", "mT")
    if sd is not None and np.any(sd <= 0.0):
        raise InputError(
            f"sd_mT must be above zero in mT; instead received {sd.tolist()}"
        )
    return gaps, flux, sd


def _best_offset(gaps: Array, flux: Array, sigma: Array, sides_mm: Sides) -> float:
    """Return the offset of least squares, the remanence being the best for each."""
    from scipy.optimize import least_squares

    low = 1e-3 - float(gaps.min())
    high = 20.0 * max(sides_mm)

    def misfit(parameters: Array) -> Array:
        share = np.asarray(axis_share(gaps + parameters[0], sides_mm)) / sigma
        best = np.sum(share * flux / sigma) / np.sum(share**2)
        return np.asarray(best * share - flux / sigma)

    found = least_squares(
        misfit, [0.0], bounds=([low], [high]), x_scale=max(sides_mm) / 10.0,
        xtol=1e-12, ftol=1e-14, gtol=1e-14,
    )  # fmt: skip
    return float(found.x[0])


def _verdict(
    alone_T: Array, i: int, share_mT: float, flux_mT: float, allowed_mT: float
) -> str:
    """Judge a reading by the median of all: one wrong reading does not shift that."""
    median_T = float(np.median(alone_T))
    needed_mT = median_T * float(share_mT)
    if abs(needed_mT - flux_mT) <= allowed_mT:
        return "ok"
    return (
        f"disagrees: alone it gives {alone_T[i]:.4f} T, and the median of all "
        f"readings, {median_T:.4f} T, needs {needed_mT:.2f} mT here"
    )
