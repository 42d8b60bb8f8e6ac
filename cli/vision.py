"""``magbend vision``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ..core.errors import InputError
from . import vision_camera, vision_points
from .console import JSON, group, print_json, progress
from .vision_camera import LINEAR
from .vision_setting import setting_of, specimen_of, squareness
from .vision_show import tell_frames, tell_ringing

if TYPE_CHECKING:
    from ..vision import Setting

app = group(
    "vision",
    "Photographs to calibrated centrelines in mm.",
    "magbend vision extract photo.png --calibration calibration.json --out measured",
)
vision_camera.register(app)
vision_points.register(app)


@app.command(
    epilog="Example: magbend vision extract runs/gmc2 --calibration calibration.json "
    "--rod-height-mm 0.9 --out measured"
)
def extract(
    images: list[Path] = typer.Argument(
        ..., help="Photographs, folders, runs or videos."
    ),
    calibration: Path = typer.Option(
        None, "--calibration",
        help="From `vision calibrate`; default: the run's own. Without one: pixels.",
    ),
    out: Path = typer.Option(
        None, "--out", help="Folder for the results; default: the run, or 'measured'."
    ),
    rod_height_mm: float = typer.Option(
        None, "--rod-height-mm",
        help="Height of the rod's axis above the board's plane; default: the "
        "calibration's.",
    ),
    invert: bool = typer.Option(
        None, "--invert/--no-invert",
        help="Light rod on dark ground; default: found out.",
    ),
    length_mm: float = typer.Option(
        None, "--length-mm", help="Nominal length, to check against."
    ),
    joints_mm: str = typer.Option(
        "", "--joints-mm", help="Where the stiffness jumps, such as 10,20."
    ),
    specimen: Path = typer.Option(
        None, "--specimen",
        help="The rod (TOML): its side, length and joints help to find and measure "
        "it; default: the run's own.",
    ),
    free: bool = typer.Option(
        False, "--free", help="Measure things without a clamp too, end to end."
    ),
    clamp_height_mm: float = typer.Option(
        None, "--clamp-height-mm",
        help="Height of the clamp's top above the board's plane; where it hides the "
        "root (flag root_hidden).",
    ),
    clamp_square_sd_deg: float = typer.Option(
        None, "--clamp-square-sd-deg",
        help="How squarely to the clamp's front the rod leaves it: standard deviation; "
        "default: 0.25.",
    ),
    bare: Path = typer.Option(
        None, "--bare", help="The paper alone, to divide the light out."
    ),
    shared_clamp: bool = typer.Option(
        None, "--shared-clamp/--own-clamps",
        help="One clamp in all photographs: they give its direction together; "
        "default: those of a run or a video do.",
    ),
    edges: Path = typer.Option(
        None, "--edges", help="Write the side-edge points too (CSV)."
    ),
    figure_steps: Path = typer.Option(
        None, "--figure-steps",
        help="Draw the processing steps of the first measured photograph (.pdf, .png).",
    ),
    overlays: bool = typer.Option(
        True, "--overlays/--no-overlays", help="Draw what was found."
    ),
    linear: bool = LINEAR,
    workers: int = typer.Option(0, "--workers", min=0, help="Processes; 0: by itself."),
    resume: bool = typer.Option(
        False, "--resume", help="Keep what is measured already, with these settings."
    ),
    json_output: bool = JSON,
) -> None:  # fmt: skip
    """Measure the rod's centreline in photographs."""
    from ..core.derived import note_derived
    from ..core.files import output_file
    from ..core.owned import owning_folder
    from ..vision import (
        extract_files,
        figure_kind,
        figure_of_steps,
        is_made_by_us,
        list_sources,
        read_source,
        with_specimen,
    )

    if figure_steps is not None:
        figure_kind(figure_steps)
    sources = list_sources(images)
    run = _only_run(images)
    if calibration is None and run is not None:
        own = run / "calibration.json"
        calibration = own if own.exists() else None
    folder = out or run or Path("measured")
    setting = setting_of(
        calibration,
        bare,
        {
            "rod_height_mm": rod_height_mm,
            "length_mm": length_mm,
            "clamp_height_mm": clamp_height_mm,
        },
        invert=invert,
        joints_mm=_numbers(joints_mm),
        clamp="none" if free else "auto",
        linear=linear,
        **squareness(clamp_square_sd_deg),
    )
    rod = specimen_of(specimen, run)
    if rod is not None:
        setting = with_specimen(setting, rod)
    _check_joints(setting, joints_mm)
    made_with = [path for path in (calibration, bare) if path is not None]
    kept = f"{folder} holds what was measured; --resume goes on from there"
    with owning_folder(folder, "extraction", "vision extract", ours=is_made_by_us):
        if figure_steps is not None:
            read = [source.path for source in sources]
            output_file(figure_steps, taken=[*read, *made_with])
        with progress("photographs", kept=kept) as report:
            result = extract_files(
                images,
                folder,
                setting=setting,
                overlays=overlays,
                edges=edges,
                workers=workers or _workers(len(sources)),
                resume=resume,
                shared_clamp=shared_clamp,
                made_with=made_with,
                progress=report,
            )
        if figure_steps is not None:
            index = next(i for i, frame in enumerate(result.frames) if frame.ok)
            shown = sources[index]
            figure_of_steps(read_source(shown), setting, figure_steps)
            note_derived(
                [figure_steps], sources=[shown.path, *made_with],
                command="vision extract --figure-steps",
            )  # fmt: skip
    tell_frames(result, json_output=json_output)


@app.command(
    epilog="Example: magbend vision ring release.mp4 --calibration calibration.json "
    "--rod-height-mm 0.9 --fps 240"
)
def ring(
    film: Path = typer.Argument(..., help="A film from before the rod is let go."),
    calibration: Path = typer.Option(
        ..., "--calibration", help="From `vision calibrate`, at the film's size."
    ),
    rod_height_mm: float = typer.Option(
        None, "--rod-height-mm", help="Height of the rod's axis above the board."
    ),
    fps: float = typer.Option(
        None, "--fps", help="Frames per second as taken, if the file says another."
    ),
    settle_mm: float = typer.Option(
        0.05, "--settle-mm", help="Amplitude of the tip that counts as settled."
    ),
    specimen: Path = typer.Option(None, "--specimen", help="The rod (TOML)."),
    json_output: bool = JSON,
) -> None:
    """Measure frequency, damping and settling time of a rod's vibration."""
    from dataclasses import asdict

    from ..core.checks import positive
    from ..vision import ring_of_film, with_specimen

    positive(settle_mm, "--settle-mm", "mm")
    setting = setting_of(calibration, None, {"rod_height_mm": rod_height_mm})
    if (rod := specimen_of(specimen, None)) is not None:
        setting = with_specimen(setting, rod)
    with progress("frames") as report:
        found = ring_of_film(
            film, setting, fps=fps, settle_mm=settle_mm, progress=report
        )
    if json_output:
        print_json({"film": str(film), **asdict(found)})
    else:
        tell_ringing(found, settle_mm)


def _numbers(text: str) -> tuple[float, ...]:
    try:
        values = tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError:
        values = (math.nan,)
    if not all(
        math.isfinite(value) and value > before
        for before, value in zip((0.0, *values), values, strict=False)
    ):
        raise InputError(
            "--joints-mm must be lengths in mm from the clamp, rising, such as 10,20; "
            f"instead received {text!r}"
        )
    return values


def _check_joints(setting: Setting, given: str) -> None:
    """Refuse joints that were given and have no scale, or lie beyond a known length.

    A specimen's own joints lie within it.
    """
    length_mm, joints_mm = setting.length_mm, setting.joints_mm
    if not given or not joints_mm:
        return
    if setting.calibration is None and length_mm is None:
        raise InputError(
            f"--joints-mm {given} are in mm, and nothing says how many pixels that is: "
            "give --calibration, or the rod's --length-mm"
        )
    if length_mm and joints_mm[-1] >= length_mm:
        raise InputError(
            f"--joints-mm must lie within the rod's {length_mm:g} mm; "
            f"instead received {joints_mm[-1]:g} mm"
        )


def _only_run(images: list[Path]) -> Path | None:
    if len(images) == 1 and (images[0] / "run.json").exists():
        return images[0]
    return None


def _workers(pictures: int) -> int:
    """Return how many processes are worth their start (about a second each)."""
    import os

    return 1 if pictures < 60 else max(1, os.cpu_count() or 1)
