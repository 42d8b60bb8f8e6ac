"""Fit one camera and the poses of a board to corners: the numbers behind `calibrate`.

Maximum a posteriori bundle adjustment. The unknowns are the logarithm of the focal
length (square pixels), the principal point, four distortion coefficients and a pose per
view. Weak priors keep what a set of views cannot tell (one view at right angles to the
board says little about the focal length) and their width comes back in the covariance,
so the result says how well each number is known. Pixels and mm; the frame of the board
is OpenCV's here (y down, z into the board).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LENS = 7
"""Leading unknowns: log f, cx, cy, and k1, k2, p1, p2 as shifts at the corner."""

DISTORTION_SD = np.array([0.25, 0.15, 1e-3, 1e-3])
LEAST_SHIFT = 3e-4
"""How far k1, k2, p1, p2 of OpenCV scatter among lenses, and how far any of them may
shift the corner at least. What a lens bends grows with the angle it sees: a k2 left
free behind a long lens follows noise, by 8 px in the corner with two lens views."""

_POWERS = np.array([2.0, 4.0, 1.0, 1.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Corners:
    """Corners of one view: on the board in mm and in px, both of shape (n, 2)."""

    board_mm: Array
    points_px: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Prior:
    """Means and standard deviations of the lens, and of the first view's distance.

    Parameters
    ----------
    mean, sd : ndarray, shape (7,)
        Of the leading unknowns. Distortion is counted as the relative shift of a point
        in the corner of the picture.
    distance_mm, distance_relative_sd : float
        Distance from the camera to the first view's plane; NaN where unknown.
    """

    mean: Array
    sd: Array
    distance_mm: float = math.nan
    distance_relative_sd: float = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Bundle:
    """The fit.

    Parameters
    ----------
    focal_px : float
        Focal length.
    centre_px : tuple of float
        Principal point.
    distortion : tuple of float
        k1, k2, p1, p2, k3 of OpenCV.
    rotations, translations : list of ndarray
        Poses of the board, one a view.
    residuals_px : list of ndarray, shape (n, 2)
        Model minus corner, one a view.
    sigma_px : float
        Standard deviation of a corner in x or y.
    distance_relative_sd, scale_relative_sd : float
        Of the first view's distance, and of its mm per pixel at the principal point.
    tilt_sd : float
        Of the angle at which its plane is seen there, in any direction, rad.
    """

    focal_px: float
    centre_px: tuple[float, float]
    distortion: tuple[float, float, float, float, float]
    rotations: list[Array]
    translations: list[Array]
    residuals_px: list[Array]
    sigma_px: float
    distance_relative_sd: float
    scale_relative_sd: float
    tilt_sd: float


def default_prior(
    size_px: tuple[int, int],
    *,
    views: int,
    focal_px: float | None = None,
    distance_mm: float | None = None,
) -> Prior:
    """Return what is known of a camera before its first photograph.

    Parameters
    ----------
    size_px : tuple of int
        Size of the photographs.
    views : int
        Number of views; with one view the principal point is held closer to the centre.
    focal_px, distance_mm : float, optional
        Given by the user; else a focal length about twice the picture's longer side,
        within a factor of 2.2 in 68 % of all cases (a telephone has 0.75, a bench
        camera with a long lens 5).
    """
    width, height = size_px
    longer = float(max(size_px))
    mean = np.zeros(LENS)
    mean[:3] = math.log(2.0 * longer), (width - 1) / 2.0, (height - 1) / 2.0
    off_centre = (0.05 if views > 1 else 0.015) * longer
    sd = np.array([0.8, off_centre, off_centre, *np.full(LENS - 3, LEAST_SHIFT)])
    if focal_px is not None:
        mean[0], sd[0] = math.log(focal_px), 0.005
    return Prior(
        mean=mean, sd=sd, distance_mm=math.nan if distance_mm is None else distance_mm
    )


def fit_bundle(views: list[Corners], size_px: tuple[int, int], prior: Prior) -> Bundle:
    """Fit the camera and the poses of all views.

    Parameters
    ----------
    views : list of Corners
        The first one is the measuring plane.
    size_px : tuple of int
        Size of the photographs.
    prior : Prior
        What is known before.
    """
    radius = 0.5 * math.hypot(*size_px)
    prior = _distorting(prior, prior.mean[0] + prior.sd[0], radius)
    best: tuple[float, Array] | None = None
    for start in _starts(views, prior):
        sigma = 0.2
        guess = start
        for _ in range(2):
            guess, cost = _solve(guess, views, radius, prior, sigma)
            sigma = _sigma(guess, views, radius)
        if best is None or cost < best[0]:
            best = (cost, guess)
    if best is None:
        raise ValueError("a bundle needs a view with a board")
    solution = best[1]
    for _ in range(2):
        sigma = _sigma(solution, views, radius)
        covariance = _covariance(solution, views, radius, prior, sigma)
        longest = float(solution[0] + math.sqrt(covariance[0, 0]))
        prior = _distorting(prior, longest, radius)
        solution, _ = _solve(solution, views, radius, prior, sigma)
    return _report(solution, views, radius, prior, sigma)


def _distorting(prior: Prior, log_focal: float, radius: float) -> Prior:
    """Return a prior with the distortion that lenses of a focal length have."""
    shift = DISTORTION_SD * (radius / math.exp(log_focal)) ** _POWERS
    sd = np.concatenate([prior.sd[:3], np.hypot(shift, LEAST_SHIFT)])
    return replace(prior, sd=sd)


def _starts(views: list[Corners], prior: Prior) -> list[Array]:
    """Return starting points: some focal lengths, and both tilts of the first view."""
    spread = (-0.9, -0.2, 0.5, 1.2) if prior.sd[0] > 0.1 else (0.0,)
    starts = []
    for offset in spread:
        lens = prior.mean.copy()
        lens[0] += offset
        matrix = _matrix(math.exp(lens[0]), lens[1], lens[2])
        options = [_poses(view, matrix) for view in views]
        for first in options[0]:
            rest = [option[0] for option in options[1:]]
            starts.append(np.concatenate([lens, first, *rest]))
    return starts


def _poses(view: Corners, matrix: Array) -> list[Array]:
    """Return the one or two poses of a plane that explain its corners, best first."""
    board = np.column_stack([view.board_mm, np.zeros(len(view.board_mm))])
    _, turns, shifts, _ = cv2.solvePnPGeneric(
        board, view.points_px, matrix, None, flags=cv2.SOLVEPNP_IPPE
    )
    return [
        np.concatenate([np.ravel(turn), np.ravel(shift)])
        for turn, shift in zip(turns, shifts, strict=True)
    ]


def _matrix(focal: float, cx: float, cy: float) -> Array:
    return np.array([[focal, 0.0, cx], [0.0, focal, cy], [0.0, 0.0, 1.0]])


def _coefficients(lens: Array, radius: float) -> Array:
    """Return k1, k2, p1, p2 from shifts at the corner."""
    return np.asarray(lens[3:] / (radius / math.exp(lens[0])) ** _POWERS)


def _project(
    unknowns: Array, views: list[Corners], radius: float
) -> tuple[list[Array], Array]:
    """Return the residuals per view in px, and their derivatives."""
    lens = unknowns[:LENS]
    focal = math.exp(lens[0])
    matrix = _matrix(focal, lens[1], lens[2])
    k = _coefficients(lens, radius)
    per_shift = (focal / radius) ** _POWERS
    residuals, blocks = [], []
    for index, view in enumerate(views):
        pose = unknowns[LENS + 6 * index : LENS + 6 * index + 6]
        board = np.column_stack([view.board_mm, np.zeros(len(view.board_mm))])
        points, jacobian = cv2.projectPoints(board, pose[:3], pose[3:], matrix, k)
        residuals.append(np.asarray(points).reshape(-1, 2) - view.points_px)
        block = np.zeros((len(jacobian), len(unknowns)))
        by_lens = jacobian[:, 10:14]
        block[:, 0] = focal * jacobian[:, 6:8].sum(axis=1) + by_lens @ (k * _POWERS)
        block[:, 1:3] = jacobian[:, 8:10]
        block[:, 3:LENS] = by_lens * per_shift
        block[:, LENS + 6 * index : LENS + 6 * index + 6] = jacobian[:, :6]
        blocks.append(block)
    return residuals, np.concatenate(blocks)


def _solve(
    start: Array, views: list[Corners], radius: float, prior: Prior, sigma: float
) -> tuple[Array, float]:
    def residuals(unknowns: Array) -> Array:
        pieces, _ = _project(unknowns, views, radius)
        return np.concatenate(
            [np.concatenate(pieces).ravel() / sigma, _prior_rows(unknowns, prior)[0]]
        )

    def jacobian(unknowns: Array) -> Array:
        _, rows = _project(unknowns, views, radius)
        return np.concatenate([rows / sigma, _prior_rows(unknowns, prior)[1]])

    from scipy.optimize import least_squares  # half a second, not needed to measure

    fit = least_squares(
        residuals, start, jacobian, method="lm", x_scale="jac",
        ftol=1e-12, xtol=1e-12, gtol=1e-12, max_nfev=200,
    )  # fmt: skip
    return np.asarray(fit.x), float(fit.cost) + len(residuals(fit.x)) * math.log(sigma)


def _prior_rows(unknowns: Array, prior: Prior) -> tuple[Array, Array]:
    values = (unknowns[:LENS] - prior.mean) / prior.sd
    rows = np.zeros((LENS, len(unknowns)))
    rows[np.arange(LENS), np.arange(LENS)] = 1.0 / prior.sd
    if math.isnan(prior.distance_mm):
        return values, rows
    distance, gradient = _distance(unknowns)
    # no logarithm: on its way a fit may put the camera below the board
    sd = prior.distance_relative_sd * prior.distance_mm
    value = (distance - prior.distance_mm) / sd
    return np.append(values, value), np.vstack([rows, gradient / sd])


def _distance(unknowns: Array) -> tuple[float, Array]:
    """Return the camera's height above the first view's plane, and its derivatives."""
    height = float(_camera_mm(unknowns[LENS : LENS + 6])[2])
    return height, _by_pose(unknowns, _camera_mm)[2]


def _by_pose(unknowns: Array, of_pose: Callable[[Array], Array]) -> Array:
    """Return the derivatives of numbers that hang on the first view's pose."""
    pose = unknowns[LENS : LENS + 6]
    columns = []
    for i in range(6):
        step = np.zeros(6)
        step[i] = 1e-6 * max(1.0, abs(pose[i]))
        columns.append((of_pose(pose + step) - of_pose(pose - step)) / (2.0 * step[i]))
    gradient = np.zeros((len(columns[0]), len(unknowns)))
    gradient[:, LENS : LENS + 6] = np.column_stack(columns)
    return gradient


def _camera_mm(pose: Array) -> Array:
    """Return where the camera is, z counted up from the board."""
    rotation = np.asarray(cv2.Rodrigues(pose[:3])[0])
    return np.asarray((rotation.T @ pose[3:]) * [-1.0, -1.0, 1.0])


def _by_tilt(unknowns: Array) -> Array:
    """Return the derivatives of how the camera sees what stands on the board lean.

    By height, where its axis meets the first view's plane, along x and y.
    """
    pose = unknowns[LENS : LENS + 6]
    axis = np.asarray(cv2.Rodrigues(pose[:3])[0])[2]
    camera = _camera_mm(pose)
    target = camera[:2] + camera[2] / axis[2] * axis[:2]

    def lean(pose: Array) -> Array:
        x, y, height = _camera_mm(pose)
        return np.asarray((np.array([x, y]) - target) / height)

    return _by_pose(unknowns, lean)


def _sigma(unknowns: Array, views: list[Corners], radius: float) -> float:
    residuals, _ = _project(unknowns, views, radius)
    everything = np.concatenate(residuals).ravel()
    free = max(1, len(everything) - 8 - 6 * (len(views) - 1))
    return max(0.005, math.sqrt(float(everything @ everything) / free))


def _report(
    unknowns: Array, views: list[Corners], radius: float, prior: Prior, sigma: float
) -> Bundle:
    residuals, _ = _project(unknowns, views, radius)
    covariance = _covariance(unknowns, views, radius, prior, sigma)
    distance, gradient = _distance(unknowns)
    by_log_distance = gradient / distance
    by_log_scale = by_log_distance.copy()
    by_log_scale[0] -= 1.0
    lens = unknowns[:LENS]
    poses = unknowns[LENS:].reshape(-1, 6)
    k1, k2, p1, p2 = (float(k) for k in _coefficients(lens, radius))
    return Bundle(
        focal_px=math.exp(lens[0]),
        centre_px=(float(lens[1]), float(lens[2])),
        distortion=(k1, k2, p1, p2, 0.0),
        rotations=[np.asarray(cv2.Rodrigues(pose[:3])[0]) for pose in poses],
        translations=[pose[3:].copy() for pose in poses],
        residuals_px=residuals,
        sigma_px=sigma,
        distance_relative_sd=_sd(by_log_distance, covariance),
        scale_relative_sd=_sd(by_log_scale, covariance),
        tilt_sd=max(_sd(row, covariance) for row in _by_tilt(unknowns)),
    )


def _covariance(
    unknowns: Array, views: list[Corners], radius: float, prior: Prior, sigma: float
) -> Array:
    _, rows = _project(unknowns, views, radius)
    design = np.concatenate([rows / sigma, _prior_rows(unknowns, prior)[1]])
    scale = np.sqrt((design**2).sum(axis=0))
    scaled = design / scale
    return np.asarray(np.linalg.pinv(scaled.T @ scaled) / np.outer(scale, scale))


def _sd(gradient: Array, covariance: Array) -> float:
    return math.sqrt(max(0.0, float(gradient @ covariance @ gradient)))
