"""What the commands of ``magbend vision`` know beside photographs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import InputError

if TYPE_CHECKING:
    from ..core import Specimen
    from ..vision import Setting


def specimen_of(path: Path | None, run: Path | None) -> Specimen | None:
    """Return the rod of a file, else of a run; None where neither tells."""
    from ..core import read_specimen
    from ..core.json import read_json
    from ..core.specimen_file import SpecimenModel

    if path is not None:
        return read_specimen(path)
    if run is None:
        return None
    try:
        record = read_json(run / "run.json")
        return SpecimenModel.model_validate(record["specimen"]).specimen()
    except (ValueError, KeyError):
        return None  # the run says so itself, to whoever reads it as a run


def setting_of(
    calibration: Path | None,
    bare: Path | None,
    lengths: dict[str, float | None],
    **others: Any,
) -> Setting:
    """Return the setting of a calibration's file and of lengths in mm.

    Raises
    ------
    InputError
        If a length cannot be, or the rod lies above the camera.
    """
    from ..core.checks import finite, positive
    from ..vision import Setting, read_bare, read_calibration

    known = None if calibration is None else read_calibration(calibration)
    given: dict[str, Any] = {
        name: finite(value, f"--{name.replace('_', '-')}", "mm")
        for name, value in lengths.items()
        if value is not None
    }
    if "length_mm" in given:
        positive(given["length_mm"], "--length-mm", "mm")
    setting = Setting(
        calibration=known,
        bare=None if bare is None else read_bare(bare, linear=others.get("linear")),
        **given,
        **others,
    )
    if known is not None:
        _below_the_camera(setting.axis_height_mm, known.camera_height_mm)
    return setting


def squareness(sd_deg: float | None) -> dict[str, float]:
    """Return what is known of how squarely a rod leaves its clamp.

    Raises
    ------
    InputError
        If a deviation cannot be.
    """
    from ..core.checks import positive

    if sd_deg is None:
        return {}
    return {"clamp_square_sd_deg": positive(sd_deg, "--clamp-square-sd-deg", "degrees")}


def _below_the_camera(rod_height_mm: float, camera_height_mm: float) -> None:
    """Refuse a rod that the camera could not see.

    Raises
    ------
    InputError
        If it is not between the board's plane, give or take a bench, and the lens.
    """
    if not abs(rod_height_mm) < camera_height_mm:
        raise InputError(
            "--rod-height-mm must be below the camera, which the calibration puts "
            f"{camera_height_mm:.0f} mm above the board; instead received "
            f"{rod_height_mm:g} mm"
        )
