"""``calibration.json``: what a `Calibration` is on the disk."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ...core.errors import ConfigError, InputError
from ...core.json import write_json
from ...core.toml import FileModel, read_toml
from .calibration import STRAIGHT_SD_DEG, Calibration, View
from .clamp_tag import ClampTag

Pair = tuple[float, float]
Positive = Annotated[float, Field(gt=0.0)]
Triple = tuple[float, float, float]


class ViewModel(FileModel):
    """One photograph of the board."""

    name: str
    rms_px: float | None
    corners: int
    used: bool
    why_not: str = ""


class TagModel(FileModel):
    """The tag on the clamp; see `ClampTag`."""

    dictionary: str
    number: int
    side_mm: Positive
    height_mm: float
    root_x_mm: float
    root_y_mm: float
    angle_deg: float
    place_sd_mm: Positive
    angle_sd_deg: Positive
    board_angle_deg: float | None = None


class CalibrationModel(FileModel):
    """The file's keys; see `Calibration` for what they mean."""

    schema_version: Literal[1, 2] = Field(1, alias="schema")
    image_size_px: tuple[int, int]
    focal_px: tuple[Positive, Positive]
    centre_px: Pair
    distortion: tuple[float, float, float, float, float]
    board_to_camera_rotation: tuple[Triple, Triple, Triple]
    board_to_camera_mm: Triple
    camera_height_mm: float
    camera_height_sd_mm: float | None
    camera_height_source: str
    tilt_deg: float
    scale_relative_sd: float | None
    rms_px: float | None
    tilt_sd_deg: float | None = None
    rod_height_mm: float | None = None
    print_scale: float = 1.0
    board: str = ""
    views: tuple[ViewModel, ...] = ()
    orientation: Annotated[int, Field(ge=1, le=8)] | None = None
    clamp_tag: TagModel | None = None


def write_calibration(calibration: Calibration, path: Path | str) -> None:
    """Write `calibration` as JSON, whole or not at all."""
    data = {
        "schema": 2,
        "image_size_px": list(calibration.image_size_px),
        "focal_px": list(calibration.focal_px),
        "centre_px": list(calibration.centre_px),
        "distortion": list(calibration.distortion),
        "board_to_camera_rotation": calibration.rotation.tolist(),
        "board_to_camera_mm": calibration.translation_mm.tolist(),
        "camera_height_mm": calibration.camera_height_mm,
        "camera_height_sd_mm": calibration.camera_height_sd_mm,
        "camera_height_source": calibration.camera_height_source,
        "tilt_deg": calibration.tilt_deg,
        "scale_relative_sd": calibration.scale_relative_sd,
        "rms_px": calibration.rms_px,
        "tilt_sd_deg": calibration.tilt_sd_deg,
        "rod_height_mm": calibration.rod_height_mm,
        "print_scale": calibration.print_scale,
        "board": calibration.board,
        "views": [
            {
                "name": view.name, "rms_px": view.rms_px,
                "corners": view.corners, "used": view.used, "why_not": view.why_not,
            }
            for view in calibration.views
        ],
        "orientation": calibration.orientation,
        "clamp_tag": calibration.clamp_tag and asdict(calibration.clamp_tag),
    }  # fmt: skip
    write_json(Path(path), data)


def read_calibration(path: Path | str) -> Calibration:
    """Read what `write_calibration` wrote.

    Raises
    ------
    ConfigError
        If the file is missing, a key is missing, unknown or impossible, or the numbers
        do not make a camera.
    """
    path = Path(path)
    if not path.exists():
        raise ConfigError(
            f"{path}: there is no such file; name yours, or write one: "
            f"magbend vision calibrate BOARD.png --out {path}"
        )
    model = read_toml(path, CalibrationModel, is_json=True)
    try:
        return _calibration(model)
    except InputError as error:
        raise ConfigError(f"{path}: {error}") from None


def _calibration(model: CalibrationModel) -> Calibration:
    return Calibration(
        image_size_px=model.image_size_px,
        focal_px=model.focal_px,
        centre_px=model.centre_px,
        distortion=model.distortion,
        rotation=np.array(model.board_to_camera_rotation),
        translation_mm=np.array(model.board_to_camera_mm),
        camera_height_sd_mm=_or(model.camera_height_sd_mm, math.inf),
        camera_height_source=model.camera_height_source,
        scale_relative_sd=_or(model.scale_relative_sd, math.nan),
        rms_px=_or(model.rms_px, math.nan),
        tilt_sd_deg=_or(model.tilt_sd_deg, _untold_tilt_sd_deg(model)),
        rod_height_mm=_told_height_mm(model),
        print_scale=model.print_scale,
        board=model.board,
        views=tuple(
            View(
                name=view.name,
                rms_px=_or(view.rms_px, math.nan),
                corners=view.corners,
                used=view.used,
                why_not=view.why_not,
            )
            for view in model.views
        ),
        orientation=model.orientation,
        clamp_tag=(
            None
            if model.clamp_tag is None
            else ClampTag(**model.clamp_tag.model_dump())
        ),
    )


def _told_height_mm(model: CalibrationModel) -> float | None:
    """Return the rod's height; files of before wrote 0 where nobody had told it."""
    if model.schema_version == 1 and model.rod_height_mm == 0.0:
        return None
    return model.rod_height_mm


def _untold_tilt_sd_deg(model: CalibrationModel) -> float:
    """Return what a file of before knew of its tilt: nothing if it saw no board."""
    return STRAIGHT_SD_DEG if model.rms_px is None else 0.0


def _or(value: float | None, missing: float) -> float:
    return missing if value is None else value
