"""``magbend vision board``, ``calibrate`` and ``clamp-tag``: before photographs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ..core.errors import InputError
from .console import JSON, print_json, progress, say
from .vision_setting import setting_of, specimen_of
from .vision_show import calibration_facts, tell_calibration, tell_tag

if TYPE_CHECKING:
    from ..vision import Board, Calibration

MOST_WIDE_MM = 3000.0
"""Width of a picture that no bench fills."""

LINEAR = typer.Option(
    None, "--linear/--no-linear",
    help="Values of the files are proportional to light; default: the curve of sRGB.",
)  # fmt: skip
_BOARD = typer.Option("7x5", "--board", help="Squares across and down.")
_SQUARE = typer.Option(10.0, "--square-mm", help="Side of a square, as designed.")
_MARKER = typer.Option(7.5, "--marker-mm", help="Side of a marker, as designed.")
_TAG = typer.Option(6.0, "--tag-mm", help="Side of the clamp's tag.")
_DICTIONARY = typer.Option("DICT_4X4_50", "--dictionary", help="OpenCV's name of it.")


def register(app: typer.Typer) -> None:
    """Add the commands to the group."""
    app.command(epilog="Example: magbend vision board --out board.pdf")(board)
    app.command(
        epilog="Example: magbend vision calibrate plane.png tilted1.png tilted2.png "
        "--out calibration.json --rod-height-mm 0.9"
    )(calibrate)
    app.command(
        "clamp-tag",
        epilog="Example: magbend vision clamp-tag straight_1.png straight_2.png "
        "--calibration calibration.json --height-mm 5.1 --rod-height-mm 0.9",
    )(clamp_tag)


def board(
    out: Path = typer.Option(..., "--out", help="The file: .pdf or .png."),
    squares: str = _BOARD,
    square_mm: float = _SQUARE,
    marker_mm: float = _MARKER,
    dictionary: str = _DICTIONARY,
    dpi: int = typer.Option(600, "--dpi", help="Resolution of a .png."),
    clamp_tag: bool = typer.Option(
        False, "--clamp-tag", help="A tag to cut out and glue on the clamp, too."
    ),
    tag_mm: float = _TAG,
) -> None:
    """Write the ChArUco board to print."""
    from ..core.files import output_file
    from ..vision import Board, tag_number, write_board

    columns, rows = _two_numbers(squares, "--board")
    output_file(out)
    design = Board(
        columns=columns,
        rows=rows,
        square_mm=square_mm,
        marker_mm=marker_mm,
        dictionary=dictionary,
    )
    write_board(design, out, dpi=dpi, tag_mm=tag_mm if clamp_tag else None)
    width, height = design.size_mm
    say(
        f"{out}: {design.describe().split(', printed')[0]}; {width:g} x {height:g} mm. "
        "Print at 100 %, then measure it with a calliper for --print-scale."
    )
    if clamp_tag:
        say(
            f"Beside it is tag {tag_number(design)}, {tag_mm:g} mm: cut it out with a "
            f"white margin of {tag_mm / 6.0:.2g} mm, glue it flat on the clamp's top, "
            "a few mm behind its front, and have `vision clamp-tag` find where the rod "
            "is from there."
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
        None, "--rod-height-mm",
        help="Height of the rod's axis above the board's plane.",
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

    output_file(out, kind=".json", taken=[plane, *(lens or [])])
    if known_length or scale_mm_per_px is not None:
        if known_length and scale_mm_per_px is not None:
            raise typer.BadParameter("give --known-length or --scale-mm-per-px")
        _refuse_what_only_boards_have(
            {
                "--print-scale": print_scale != 1.0, "--focal-px": focal_px is not None,
                "--chessboard": bool(chessboard), "--legacy-pattern": legacy,
                "photographs for the lens": bool(lens),
            }
        )  # fmt: skip
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


def clamp_tag(
    images: list[Path] = typer.Argument(
        ..., help="Photographs of rod, clamp and tag; the rod best straight."
    ),
    calibration: Path = typer.Option(
        ..., "--calibration", help="From `vision calibrate`; the tag is added to it."
    ),
    height_mm: float = typer.Option(
        ..., "--height-mm", help="Height of the tag's face above the board's plane."
    ),
    tag_mm: float = _TAG,
    number: int = typer.Option(49, "--number", help="As printed below the board."),
    dictionary: str = _DICTIONARY,
    rod_height_mm: float = typer.Option(
        None, "--rod-height-mm", help="Height of the rod's axis above the board."
    ),
    clamp_height_mm: float = typer.Option(
        None, "--clamp-height-mm", help="Height of the clamp's top, as for `extract`."
    ),
    specimen: Path = typer.Option(None, "--specimen", help="The rod (TOML)."),
    out: Path = typer.Option(
        None, "--out", help="The calibration with the tag; default: the same file."
    ),
    json_output: bool = JSON,
) -> None:
    """Learn where the rod leaves the clamp, seen from the tag on it."""
    from dataclasses import asdict, replace

    from ..core.derived import note_derived
    from ..core.files import output_file
    from ..vision import (
        ClampTag,
        read_calibration,
        tag_place,
        with_specimen,
        write_calibration,
    )

    target = out or calibration
    output_file(target, kind=calibration.suffix.lower(), taken=images)
    known: dict[str, float | None] = {
        "rod_height_mm": rod_height_mm, "clamp_height_mm": clamp_height_mm,
    }  # fmt: skip
    setting = setting_of(calibration, None, known)
    if (rod := specimen_of(specimen, None)) is not None:
        setting = with_specimen(setting, rod)
    tag = ClampTag(
        dictionary=dictionary, number=number, side_mm=tag_mm, height_mm=height_mm
    )
    with progress("photographs") as report:
        placed = tag_place(images, setting, tag, progress=report)
    camera = replace(read_calibration(calibration), clamp_tag=placed.tag)
    write_calibration(camera, target)
    note_derived([target], sources=images, command="vision clamp-tag")
    if json_output:
        print_json(
            {
                "calibration": str(target), "clamp_tag": asdict(placed.tag),
                "used": placed.used, "left_out": placed.left_out,
            }
        )  # fmt: skip
    else:
        tell_tag(placed, target)


def _two_numbers(text: str, option: str) -> tuple[int, int]:
    match = re.fullmatch(r"\s*(\d{1,3})\s*[xX*]\s*(\d{1,3})\s*", text)
    if match is None:
        raise InputError(
            f"{option} must be two numbers such as 7x5; instead received {text!r}"
        )
    return int(match.group(1)), int(match.group(2))


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


def _refuse_what_only_boards_have(given: dict[str, bool]) -> None:
    """Refuse what would change nothing where a scale is told and no board is sought."""
    idle = [name for name, is_given in given.items() if is_given]
    if idle:
        raise InputError(
            f"{', '.join(idle)}: only a photographed board has use for that, and "
            "--known-length and --scale-mm-per-px take none; leave out one or the other"
        )


def _refuse_pixels_per_mm(mm_per_px: float, width_px: int) -> None:
    """Refuse a scale that makes a bench a hall, where its inverse makes it a bench."""
    wide_mm, else_mm = width_px * mm_per_px, width_px / mm_per_px
    if wide_mm > MOST_WIDE_MM and else_mm < MOST_WIDE_MM:
        raise InputError(
            f"--scale-mm-per-px {mm_per_px:g} makes the picture {wide_mm / 1e3:.3g} m "
            f"wide; is it in px/mm? then write {1.0 / mm_per_px:.6g}"
        )


def _without_board(
    plane: Path,
    known_length: str | None,
    scale_mm_per_px: float | None,
    camera_height_mm: float | None,
    rod_height_mm: float | None,
) -> Calibration:
    from ..core.checks import positive
    from ..vision import calibrate_known_length, read_photo, scale_calibration

    size_px = read_photo(plane).size_px
    if scale_mm_per_px is not None:
        positive(scale_mm_per_px, "--scale-mm-per-px", "mm/px")
        _refuse_pixels_per_mm(scale_mm_per_px, size_px[0])
        return scale_calibration(
            mm_per_px=scale_mm_per_px,
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
