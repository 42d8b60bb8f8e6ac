"""``magbend vision``."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..core.errors import InputError
from . import vision_points
from .console import JSON, group, print_json, progress, say
from .vision_show import (
    calibration_facts,
    tell_calibration,
    tell_frames,
    tell_ringing,
)

if TYPE_CHECKING:
    from ..core import Specimen
    from ..vision import Board, Calibration, Setting

app = group(
    "vision",
    "Photographs to calibrated centrelines in mm.",
    "magbend vision extract photo.png --calibration calibration.json --out measured",
)
vision_points.register(app)

LINEAR = typer.Option(
    None, "--linear/--no-linear",
    help="Values of the files are proportional to light; default: the curve of sRGB.",
)  # fmt: skip
_BOARD = typer.Option("7x5", "--board", help="Squares across and down.")
_SQUARE = typer.Option(10.0, "--square-mm", help="Side of a square, as designed.")
_MARKER = typer.Option(7.5, "--marker-mm", help="Side of a marker, as designed.")
_DICTIONARY = typer.Option("DICT_4X4_50", "--dictionary", help="OpenCV's name of it.")


@app.command(epilog="Example: magbend vision board --out board.pdf")
def board(
    out: Path = typer.Option(..., "--out", help="The file: .pdf or .png."),
    squares: str = _BOARD,
    square_mm: float = _SQUARE,
    marker_mm: float = _MARKER,
    dictionary: str = _DICTIONARY,
    dpi: int = typer.Option(600, "--dpi", help="Resolution of a .png."),
) -> None:
    """Write the ChArUco board to print."""
    from ..core.files import output_file
    from ..vision import Board, write_board

    columns, rows = _two_numbers(squares, "--board")
    output_file(out)
    design = Board(
        columns=columns,
        rows=rows,
        square_mm=square_mm,
        marker_mm=marker_mm,
        dictionary=dictionary,
    )
    write_board(design, out, dpi=dpi)
    width, height = design.size_mm
    say(
        f"{out}: {design.describe().split(', printed')[0]}; {width:g} x {height:g} mm. "
        "Print at 100 %, then measure it with a calliper for --print-scale."
    )


@app.command(
    epilog="Example: magbend vision calibrate plane.png tilted1.png tilted2.png "
    "--out calibration.json --rod-height-mm 0.9"
)
def calibrate(
    plane: Path = typer.Argument(..., help="The board in the measuring plane."),
    lens: list[Path] = typer.Argument(
        None, help="The board tilted in different ways, for the lens."
    ),
    out: Path = typer.Option(..., "--out", help="The calibration file (JSON)."),
    squares: str = _BOARD,
    square_mm: float = _SQUARE,
    marker_mm: float = _MARKER,
    dictionary: str = _DICTIONARY,
    chessboard: str = typer.Option(
        None, "--chessboard", help="A plain chessboard: inner corners, such as 9x6."
    ),
    legacy: bool = typer.Option(
        False, "--legacy-pattern", help="A board with even rows made before OpenCV 4.6."
    ),
    print_scale: float = typer.Option(
        1.0, "--print-scale", help="Measured over nominal length of the print."
    ),
    rod_height_mm: float = typer.Option(
        0.0, "--rod-height-mm", help="Height of the rod's axis above the board's plane."
    ),
    camera_height_mm: float = typer.Option(
        None, "--camera-height-mm", help="Lens to plane, if you measured it (2 %)."
    ),
    focal_px: float = typer.Option(
        None, "--focal-px", help="Focal length in pixels, if you know it."
    ),
    known_length: str = typer.Option(
        None, "--known-length",
        help="No board: 'X1,Y1 X2,Y2 MM', two pixels and the length between them.",
    ),
    scale_mm_per_px: float = typer.Option(
        None, "--scale-mm-per-px", help="No board: the scale itself."
    ),
    linear: bool = LINEAR,
    json_output: bool = JSON,
) -> None:  # fmt: skip
    """Calibrate a camera from photographs of the board."""
    from ..core.derived import note_derived
    from ..core.files import output_file
    from ..vision import calibrate as calibrate_photos
    from ..vision import read_photo, write_calibration

    output_file(out)
    if known_length or scale_mm_per_px is not None:
        if known_length and scale_mm_per_px is not None:
            raise typer.BadParameter("give --known-length or --scale-mm-per-px")
        result = _without_board(
            plane, known_length, scale_mm_per_px, camera_height_mm, rod_height_mm
        )
    else:
        columns, rows = _two_numbers(
            chessboard or squares, "--chessboard" if chessboard else "--board"
        )
        design = _design(
            columns, rows, square_mm, marker_mm, dictionary, print_scale,
            legacy=legacy, plain=bool(chessboard),
        )  # fmt: skip
        result = calibrate_photos(
            read_photo(plane, linear=linear),
            [read_photo(path, linear=linear) for path in lens or []],
            board=design,
            rod_height_mm=rod_height_mm,
            camera_height_mm=camera_height_mm,
            focal_px=focal_px,
        )
    write_calibration(result, out)
    note_derived([out], sources=[plane, *(lens or [])], command="vision calibrate")
    facts = calibration_facts(result)
    if json_output:
        print_json({"calibration": str(out), **facts})
        return
    tell_calibration(result, facts, out)


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
    setting = _setting(
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
    )
    rod = _specimen(specimen, run)
    if rod is not None:
        setting = with_specimen(setting, rod)
    _refuse_joints_beyond(setting, joints_mm)
    made_with = [path for path in (calibration, bare) if path is not None]
    kept = f"{folder} holds what was measured; --resume goes on from there"
    with owning_folder(folder, "extraction", "vision extract", ours=is_made_by_us):
        for path in (edges, figure_steps):
            if path is not None:
                output_file(path)
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
    setting = _setting(calibration, None, {"rod_height_mm": rod_height_mm})
    if (rod := _specimen(specimen, None)) is not None:
        setting = with_specimen(setting, rod)
    with progress("frames") as report:
        found = ring_of_film(
            film, setting, fps=fps, settle_mm=settle_mm, progress=report
        )
    if json_output:
        print_json({"film": str(film), **asdict(found)})
    else:
        tell_ringing(found, settle_mm)


def _two_numbers(text: str, option: str) -> tuple[int, int]:
    match = re.fullmatch(r"\s*(\d{1,3})\s*[xX*]\s*(\d{1,3})\s*", text)
    if match is None:
        raise InputError(
            f"{option} must be two numbers such as 7x5; instead received {text!r}"
        )
    return int(match.group(1)), int(match.group(2))


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


def _refuse_joints_beyond(setting: Setting, given: str) -> None:
    """Refuse joints that were given and lie beyond the rod, where its length is known.

    A specimen's own joints lie within it.
    """
    length_mm, joints_mm = setting.length_mm, setting.joints_mm
    if given and length_mm and joints_mm and joints_mm[-1] >= length_mm:
        raise InputError(
            f"--joints-mm must lie within the rod's {length_mm:g} mm; "
            f"instead received {joints_mm[-1]:g} mm"
        )


def _design(
    columns: int, rows: int, square_mm: float, marker_mm: float, dictionary: str,
    print_scale: float, *, legacy: bool, plain: bool,
) -> Board:  # fmt: skip
    from ..vision import Board

    return Board(
        kind="chessboard" if plain else "charuco",
        columns=columns,
        rows=rows,
        square_mm=square_mm,
        marker_mm=marker_mm,
        dictionary=dictionary,
        print_scale=print_scale,
        legacy=legacy,
    )


def _without_board(
    plane: Path,
    known_length: str | None,
    scale_mm_per_px: float | None,
    camera_height_mm: float | None,
    rod_height_mm: float,
) -> Calibration:
    from ..core.checks import positive
    from ..vision import calibrate_known_length, read_photo, scale_calibration

    size_px = read_photo(plane).size_px
    if scale_mm_per_px is not None:
        return scale_calibration(
            mm_per_px=positive(scale_mm_per_px, "--scale-mm-per-px", "mm/px"),
            image_size_px=size_px,
            camera_height_mm=camera_height_mm,
            rod_height_mm=rod_height_mm,
        )
    try:
        x1, y1, x2, y2, length_mm = (
            float(part) for part in re.split(r"[,\s]+", (known_length or "").strip())
        )
    except ValueError:
        raise InputError(
            "--known-length must be 'X1,Y1 X2,Y2 MM', such as '120,300 1320,305 60'; "
            f"instead received {known_length!r}"
        ) from None
    return calibrate_known_length(
        size_px,
        from_px=(x1, y1),
        to_px=(x2, y2),
        length_mm=length_mm,
        camera_height_mm=camera_height_mm,
        rod_height_mm=rod_height_mm,
    )


def _only_run(images: list[Path]) -> Path | None:
    if len(images) == 1 and (images[0] / "run.json").exists():
        return images[0]
    return None


def _specimen(path: Path | None, run: Path | None) -> Specimen | None:
    """Return the rod of a file, else of a run; None where neither tells."""
    from ..core import read_specimen
    from ..core.specimen_file import SpecimenModel

    if path is not None:
        return read_specimen(path)
    if run is None:
        return None
    try:
        record = json.loads((run / "run.json").read_text(encoding="utf-8"))
        return SpecimenModel.model_validate(record["specimen"]).specimen()
    except (OSError, ValueError, KeyError, TypeError, InputError):
        return None  # the run says so itself, to whoever reads it as a run


def _setting(
    calibration: Path | None,
    bare: Path | None,
    lengths: dict[str, float | None],
    **others: Any,
) -> Setting:
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
    if known is not None:
        height_mm = given.get("rod_height_mm", known.rod_height_mm)
        _below_the_camera(height_mm, known.camera_height_mm)
    return Setting(
        calibration=known,
        bare=None if bare is None else read_bare(bare, linear=others.get("linear")),
        **given,
        **others,
    )


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


def _workers(pictures: int) -> int:
    """Return how many processes are worth their start (about a second each)."""
    import os

    return 1 if pictures < 60 else max(1, os.cpu_count() or 1)
