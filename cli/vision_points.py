"""``magbend vision points``: measure a rod that a person points at."""

from __future__ import annotations

import re
from pathlib import Path

import typer

from ..core.errors import InputError, VisionError
from .console import JSON, print_json, say


def register(app: typer.Typer) -> None:
    """Add the command to the group."""
    app.command(
        epilog="Example: magbend vision points photo.jpg --clamp 310,402 --tip 844,215 "
        '--ruler "120,900 1120,905 50" --out measured'
    )(points)


def points(
    photo: Path = typer.Argument(..., help="The photograph; of a run, images/NAME."),
    clamp: str = typer.Option(
        ..., "--clamp", help="X,Y where the rod leaves the clamp, in pixels."
    ),
    tip: str = typer.Option(..., "--tip", help="X,Y of its end."),
    via: str = typer.Option(
        "", "--via", help="'X,Y X,Y ...' between, where the way is not plain."
    ),
    ruler: str = typer.Option(
        "", "--ruler", help="'X,Y X,Y MM': two ticks and the length between."
    ),
    calibration: Path = typer.Option(
        None, "--calibration", help="From `vision calibrate`, instead of a ruler."
    ),
    out: Path = typer.Option(
        Path("measured"), "--out", help="Folder of the tables; the run's, to rescue."
    ),
    rod_height_mm: float = typer.Option(
        None, "--rod-height-mm", help="As for `vision extract`."
    ),
    length_mm: float = typer.Option(
        None, "--length-mm", help="Nominal length, to check against."
    ),
    linear: bool = typer.Option(
        None, "--linear/--no-linear", help="As for `vision extract`."
    ),
    json: bool = JSON,
) -> None:
    """Measure a rod by clamp, tip and ruler, where it is not found by itself."""
    from ..vision import Hints, Setting, read_calibration, rescue

    hints = Hints(
        clamp_px=_points(clamp, "--clamp", 1)[0],
        tip_px=_points(tip, "--tip", 1)[0],
        via_px=tuple(_points(via, "--via", None)) if via else (),
        ruler=_ruler(ruler) if ruler else None,
    )
    found = rescue(
        photo,
        out,
        Setting(
            calibration=read_calibration(calibration) if calibration else None,
            rod_height_mm=rod_height_mm,
            length_mm=length_mm,
            linear=linear,
        ),
        hints,
        made_with=[calibration] if calibration else [],
    )
    if not found.ok:
        raise VisionError(
            f"{photo}: {found.reason}; see that --clamp and --tip lie on the rod, in "
            "pixels from the upper left"
        )
    if json:
        print_json(
            {
                "image": photo.name,
                "flags": list(found.flags),
                "hints": hints.words,
                "length_mm": found.length_mm,
                "width_mm": found.width_mm,
                "tip_mm": list(found.tip_mm),
                "tip_angle_deg": found.tip_angle_deg,
                "length_px": found.length_px,
                "out": str(out),
            }
        )
        return
    size = (
        f"{found.length_mm:.2f} mm long, {found.width_mm:.2f} mm wide"
        if found.length_mm == found.length_mm
        else f"{found.length_px:.1f} px long (no ruler, no calibration)"
    )
    say(f"{photo.name}: {size}; {', '.join(found.flags)}; in {out}")


def _points(text: str, option: str, count: int | None) -> list[tuple[float, float]]:
    """Return pixels written as ``X,Y X,Y``."""
    try:
        found = [tuple(map(float, part.split(","))) for part in text.split()]
    except ValueError:
        found = []
    if not found or any(len(p) != 2 for p in found) or count not in (None, len(found)):
        raise InputError(f"{option} must be X,Y in pixels; instead received {text!r}")
    return [(x, y) for x, y in found]


def _ruler(text: str) -> tuple[tuple[float, float], tuple[float, float], float]:
    parts = re.split(r"\s+", text.strip())
    if len(parts) != 3:
        raise InputError(
            f"--ruler must be 'X,Y X,Y MM', as '120,900 1120,905 50'; instead received "
            f"{text!r}"
        )
    start, end = _points(" ".join(parts[:2]), "--ruler", 2)
    try:
        length_mm = float(parts[2])
    except ValueError:
        length_mm = 0.0
    if not 0.0 < length_mm < 1e6:
        raise InputError(f"--ruler must end in a length in mm; received {parts[2]!r}")
    return start, end, length_mm
