"""The predicted shape over the measured one: pure functions of a gap and a picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline
from ...core.errors import MagbendError
from ...core.magnet import Magnet
from ...core.specimen import Specimen
from ..workspace import BenchFiles

if TYPE_CHECKING:
    from ...vision import Calibration, Measurement, Pose

POINTS = 61
MODELS = ("magnet", "uniform")


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """What decides a predicted shape: the gap, and the flux density that is believed.

    Parameters
    ----------
    gap_mm : float
        From the stage.
    flux_mT : float or None
        Read by the meter at this gap; the magnet's own value is taken without one.
    """

    gap_mm: float
    flux_mT: float | None = None


def model_flux_mT(magnet: Magnet, length_mm: float, gap_mm: float) -> float:
    """Return the flux density in mT at the undeformed tip, along the magnet's axis."""
    from ...sim import magnet_flux_mT

    flux = magnet_flux_mT(
        magnet, np.array([[length_mm, 0.0, 0.0]]), length_mm=length_mm, gap_mm=gap_mm
    )[0]
    return float(np.dot(flux, magnet.axes()[2]))


def predict(files: BenchFiles, place: Place) -> dict[str, Any]:
    """Return the predicted shape of each model and rod at a place.

    Returns
    -------
    dict
        ``magnet.nominal`` and so on, each to a `magbend.sim.Solution` or a sentence
        that says why there is none.
    """
    rods = {"nominal": files.specimen}
    if files.fitted is not None:
        rods["fitted"] = files.fitted.specimen
    return {
        f"{model}.{name}": _solve(files, rod, model, place)
        for model in MODELS
        for name, rod in rods.items()
    }


def _solve(files: BenchFiles, rod: Specimen | None, model: str, place: Place) -> Any:
    from ...sim import MagnetField, Support, UniformField, solve

    if rod is None:
        return "there is no specimen file yet"
    if files.rig is None or files.rig.magnet is None:
        return "the rig file has no [magnet]"
    magnet = files.rig.magnet.magnet()
    bench = files.rig.bench
    gravity = bench.gravity_m_s2(rod) if bench else (0.0, 0.0, 0.0)
    try:
        if model == "magnet":
            field: Any = MagnetField(magnet=magnet, gap_mm=place.gap_mm)
        else:
            flux = place.flux_mT
            if flux is None:
                flux = model_flux_mT(magnet, rod.length_mm, place.gap_mm)
            field = UniformField(flux_mT=flux, angle_deg=magnet.axis_angle_deg)
        return solve(rod, field, support=Support(gravity_m_s2=gravity), points=POINTS)
    except MagbendError as error:
        return str(error)


def overlay(
    measured: Measurement,
    calibration: Calibration | None,
    predicted: dict[str, Any],
    pose: Pose | None,
) -> dict[str, Any]:
    """Return what is drawn over a picture, and how far theory is from it.

    Parameters
    ----------
    measured : Measurement
        Of this picture.
    calibration : Calibration or None
        Without it only the measured line is drawn.
    predicted : dict
        From `predict`.
    pose : Pose or None
        Where the rod is clamped, as last measured: theory is drawn from there.

    Returns
    -------
    dict
        ``measured`` and ``predicted`` lines in pixels, ``misfit_mm``, and the doubts.
    """
    line = measured.centreline()
    shapes: dict[str, Any] = {}
    for name, found in predicted.items():
        shapes[name] = _shape(found, line, calibration, pose)
    points = measured.points_px
    step = max(1, len(points) // 80)
    return {
        "status": measured.status,
        "flags": list(measured.flags),
        "reason": measured.reason,
        "measured_px": _pairs(points[::step]) if measured.ok else [],
        "tip_mm": list(measured.tip_mm) if line is not None else None,
        "length_mm": measured.length_mm if line is not None else None,
        "predicted": shapes,
    }


def _shape(
    found: Any,
    line: Centreline | None,
    calibration: Calibration | None,
    pose: Pose | None,
) -> dict[str, Any]:
    if isinstance(found, str):
        return {"why_not": found}
    if found.centreline is None:
        return {"why_not": found.status}
    shape: dict[str, Any] = {
        "status": found.status, "tip_mm": list(found.centreline.tip_mm)
    }  # fmt: skip
    if calibration is not None and pose is not None:
        from ...vision import specimen_to_px

        xy = found.centreline.points_mm
        shape["px"] = _pairs(specimen_to_px(calibration, pose, xy))
    if line is not None:
        shape["misfit_mm"], shape["tip_off_mm"] = misfit_mm(line, found.centreline)
    return shape


def misfit_mm(
    measured: Centreline, simulated: Centreline
) -> tuple[float | None, float | None]:
    """Return RMS and tip distance of two shapes at the same material points, in mm."""
    from ...analysis import position_at

    if measured.s_mm[0] > simulated.s_mm[-1]:
        return None, None
    s_mm = measured.s_mm[measured.s_mm <= simulated.s_mm[-1] * (1.0 + 1e-9)]
    if len(s_mm) < 2:
        return None, None
    x_mm, y_mm = position_at(simulated, s_mm)
    n = len(s_mm)
    off = np.hypot(measured.x_mm[:n] - x_mm, measured.y_mm[:n] - y_mm)
    tip = np.hypot(*np.subtract(measured.tip_mm, simulated.tip_mm))
    return float(np.sqrt(np.mean(off**2))), float(tip)


def _pairs(points: NDArray[np.float64]) -> list[list[float]]:
    rounded: list[list[float]] = np.round(points, 1).tolist()
    return rounded


def shape_mm(found: Any) -> list[list[float]] | None:
    """Return a predicted shape as pairs in mm, or None."""
    if isinstance(found, str) or found.centreline is None:
        return None
    points: list[list[float]] = np.round(found.centreline.points_mm, 3).tolist()
    return points
