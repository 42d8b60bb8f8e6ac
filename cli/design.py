"""``magbend analysis design``: from a wanted shape to rods that give it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from .analysis_import import ALIGN, FLIP, UNIT
from .console import JSON, print_json, say

if TYPE_CHECKING:
    from ..analysis import Design, Goal, Makeable, Reading, Task
    from ..core.specimen import Specimen
    from ..sim import Field

EXAMPLE = "Example: magbend analysis design --radius-mm 100 --field-mT 50 --count 5"


def design(
    radius_mm: float | None = typer.Option(
        None, "--radius-mm", help="Wanted bending radius: circle through the whole rod."
    ),
    tip_mm: tuple[float, float] | None = typer.Option(
        None, "--tip", help="Wanted tip X Y, mm, clamp at the origin."
    ),
    tip_angle_deg: float | None = typer.Option(
        None, "--tip-angle-deg", "--angle-deg", help="Wanted tangent angle at the tip."
    ),
    curve: Path | None = typer.Option(
        None, "--curve", help="Wanted curve from the clamp on: CSV, DXF, SVG, ..."
    ),
    unit: str = UNIT,
    flip: bool = FLIP,
    align: bool = ALIGN,
    polyline: Path | None = typer.Option(
        None, "--polyline", help="Curve drawn on a photograph: CSV with x_px,y_px."
    ),
    calibration: Path | None = typer.Option(
        None, "--calibration", help="calibration.json of that photograph."
    ),
    rod_height_mm: float = typer.Option(
        0.0, "--rod-height-mm", help="Height of the curve above the board."
    ),
    lumen: Path | None = typer.Option(
        None, "--lumen", help="Lumen to pass with the least force on its walls (TOML)."
    ),
    gate: str | None = typer.Option(None, "--gate", help="Gate of the lumen to pass."),
    friction: float = typer.Option(0.0, "--friction", help="On the lumen's walls."),
    tip_stiffness_N_mm: float | None = typer.Option(
        None, "--tip-stiffness-N-mm", help="With --lumen: of every rod, at its tip."
    ),
    path: Path | None = typer.Option(
        None, "--path", help="Tips in several fields: CSV with flux_mT,x_mm,y_mm."
    ),
    fluxes_mT: list[float] = typer.Option(
        [], "--field-mT", help="Uniform field, mT; several fields go into --path."
    ),
    field_angle_deg: float = typer.Option(
        90.0, "--field-angle-deg", help="Direction of the uniform field from +x."
    ),
    magnet: Path | None = typer.Option(None, "--magnet", help="Magnet or source file."),
    gap_mm: float | None = typer.Option(None, "--gap-mm", help="Gap of the magnet."),
    count: int = typer.Option(5, "--count", help="How many distinct designs."),
    makeable: Path | None = typer.Option(
        None, "--makeable", help="What can be made, TOML (docs/library.md)."
    ),
    length_mm: str | None = typer.Option(
        None, "--length-mm", help="Total length, mm: 30 or 25:40 (default 30)."
    ),
    side_mm: str | None = typer.Option(
        None, "--side-mm", help="Side, mm: 1 or 0.75:1.35 (the default)."
    ),
    E_MPa: str | None = typer.Option(
        None, "--E-MPa", help="Moduli, MPa, falling: 8:50 (the default)."
    ),
    unit_length_mm: str | None = typer.Option(
        None, "--unit-length-mm", help="Each section, mm: 5:20 (the default)."
    ),
    remanence_mT: float | None = typer.Option(
        None, "--remanence-mT", help="Remanence (default 20.07, GMC 2)."
    ),
    recipes: bool = typer.Option(
        False, "--recipes", help="Only the paper's materials and moulds."
    ),
    recipe: Path | None = typer.Option(
        None, "--recipe", help="Only what a law of mixing can mix: recipe.json."
    ),
    seed: int = typer.Option(0, "--seed", min=0, help="Seed of the search."),
    figure: Path | None = typer.Option(
        None, "--figure", help="Draw the expected shapes with bands (.svg .pdf .png)."
    ),
    out: Path | None = typer.Option(
        None, "--out", help="Folder for the specimen files design_1.json, ..."
    ),
    as_json: bool = JSON,
) -> None:
    """Find distinct rods that give a wanted shape, ranked by error and tolerance."""
    from ..analysis import Reading
    from ..analysis.design import search as designing
    from ..analysis.surrogate import figures as model_figures
    from ..core.files import output_folder
    from ..core.slips import refuse_slip

    options: dict[str, object] = {
        "total_length_mm": _range(length_mm, "--length-mm"),
        "side_mm": _range(side_mm, "--side-mm"),
        "E_MPa": _range(E_MPa, "--E-MPa"),
        "unit_length_mm": _range(unit_length_mm, "--unit-length-mm"),
        "remanence_mT": remanence_mT,
    }
    flux_mT = _one(fluxes_mT)
    for name, value in (
        ("flux_mT", flux_mT), ("gap_mm", gap_mm), ("remanence_mT", remanence_mT),
    ):  # fmt: skip
        refuse_slip(name, value)
    if lumen is not None:
        from ..sim import UniformField
        from .design_lumen import design_lumen

        no_field = flux_mT is None and magnet is None
        design_lumen(
            lumen,
            UniformField(flux_mT=0.0)
            if no_field
            else _field(flux_mT, field_angle_deg, magnet, gap_mm),
            _makeable(makeable, options, recipes, recipe, None),
            stiffness_N_mm=tip_stiffness_N_mm,
            friction=friction,
            gate=gate,
            count=count,
            seed=seed,
            out=output_folder(out) if out is not None else None,
            as_json=as_json,
        )
        return
    if figure is not None:
        model_figures.check_path(figure)
    if path is not None:
        given = (radius_mm, tip_mm, tip_angle_deg, curve, polyline, flux_mT, gap_mm)
        tasks = _path(path, field_angle_deg, magnet, given)
    else:
        goal = _goal(
            radius_mm, tip_mm, tip_angle_deg, curve, polyline, calibration,
            rod_height_mm, Reading(unit=unit, flip=flip, align=align),
        )  # fmt: skip
        tasks = [(goal, _field(flux_mT, field_angle_deg, magnet, gap_mm))]
    goal = tasks[0][0]
    limits = _makeable(makeable, options, recipes, recipe, goal)
    if out is not None:
        output_folder(out)
    found = designing.design_all(tasks, limits, count=count, seed=seed)
    if figure is not None:
        drawing = model_figures.design_figure(found, goal)
        model_figures.save_figure(drawing, figure)
    if out is not None:
        _write(found, out)
    if as_json:
        print_json([designing.as_dict(one, goal) for one in found])
        return
    _print(found, goal)
    if len(found) < count:
        say(f"only {len(found)} distinct designs were found", err=True)


def _one(fluxes_mT: list[float]) -> float | None:
    from ..core.errors import InputError

    if len(fluxes_mT) > 1:
        raise InputError(
            f"--field-mT is one field; instead received {len(fluxes_mT)}: a table of "
            "fields and the tips wanted in them goes into --path"
        )
    return fluxes_mT[0] if fluxes_mT else None


def _path(
    path: Path, angle_deg: float, magnet: Path | None, given: tuple[object, ...]
) -> list[Task]:
    from ..analysis import read_path
    from ..core.errors import InputError
    from ..sim import read_field

    if any(value is not None for value in given):
        raise InputError("--path has its own goals and fields; give no other")
    return read_path(
        path, angle_deg=angle_deg, magnet=read_field(magnet) if magnet else None
    )


def _goal(
    radius_mm: float | None,
    tip_mm: tuple[float, float] | None,
    tip_angle_deg: float | None,
    curve: Path | None,
    polyline: Path | None,
    calibration: Path | None,
    rod_height_mm: float,
    how: Reading,
) -> Goal:
    from ..analysis import read_shape
    from ..analysis.design import goals
    from ..core.errors import InputError

    given = [radius_mm, tip_mm, tip_angle_deg, curve, polyline]
    if sum(value is not None for value in given) != 1:
        raise InputError(
            "give exactly one of --radius-mm, --tip, --tip-angle-deg, --curve, "
            "--polyline and --lumen"
        )
    if radius_mm is not None:
        return goals.radius_goal(radius_mm)
    if tip_mm is not None:
        return goals.tip_goal(*tip_mm)
    if tip_angle_deg is not None:
        return goals.angle_goal(tip_angle_deg)
    if curve is not None:
        return goals.curve_goal(read_shape(str(curve), Path(), how).line.points_mm)
    if polyline is None or calibration is None:
        raise InputError("--polyline needs the --calibration of its photograph")

    from ..vision import read_calibration

    points_px = goals.read_points(polyline, ("x_px", "y_px"))
    camera = read_calibration(calibration)
    points_mm = camera.to_mm(points_px, height_mm=rod_height_mm)
    return goals.curve_goal(points_mm, align=True)


def _field(
    flux_mT: float | None, angle_deg: float, magnet: Path | None, gap_mm: float | None
) -> Field:
    from ..core.errors import InputError
    from ..sim import UniformField, read_field

    if flux_mT == 0.0 and magnet is None:
        raise InputError(
            "--field-mT must not be zero: without a field no rod bends; "
            f"instead received {flux_mT:g} mT"
        )
    if flux_mT is not None and magnet is None and gap_mm is None:
        return UniformField(flux_mT=flux_mT, angle_deg=angle_deg)
    field = read_field(magnet) if magnet is not None and flux_mT is None else None
    if field is None or field.follows_gap != (gap_mm is not None):
        raise InputError(
            "give either --field-mT, or --magnet and --gap-mm; no gap where all "
            "sources of the file have their place"
        )
    return field if gap_mm is None else field.at_gap(gap_mm)


def _range(text: str | None, option: str) -> tuple[float, float] | None:
    from ..core.errors import InputError
    from ..core.slips import refuse_slip

    if text is None:
        return None
    try:
        ends = [float(part) for part in text.split(":")]
    except ValueError:
        ends = []
    if len(ends) not in (1, 2):
        raise InputError(f"{option} must be a number or LOW:HIGH; received {text!r}")
    for end in ends:
        refuse_slip(option.removeprefix("--").replace("-", "_"), end)
    return ends[0], ends[-1]


def _makeable(
    path: Path | None,
    options: dict[str, object],
    recipes: bool,
    law: Path | None,
    goal: Goal | None,
) -> Makeable:
    from pydantic import ValidationError

    from ..analysis import read_law
    from ..analysis.design import goals, makeable, mixtures
    from ..core.errors import InputError
    from ..core.toml import read_toml

    data: dict[str, object] = {}
    if path is not None:
        data = read_toml(path, makeable.Makeable).model_dump(exclude_unset=True)
    data |= {key: value for key, value in options.items() if value is not None}
    length_mm = goals.curve_length_mm(goal) if goal is not None else None
    if length_mm is not None:
        data["total_length_mm"] = (length_mm, length_mm)
    if recipes and law is not None:
        raise InputError("give --recipes (the paper's) or --recipe (yours), not both")
    if law is not None:
        sections = makeable.Makeable.model_validate(data).sections
        data["recipe"] = [
            dict(one) for one in mixtures.mixed_recipes(read_law(law), sections)
        ]
    if recipes:
        data["recipe"] = [dict(recipe) for recipe in makeable.PAPER_RECIPES]
        data["sides_mm"] = list(makeable.PAPER_SIDES_MM)
    try:
        return makeable.Makeable.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        message = first["msg"].removeprefix("Value error, ")
        if "instead received" not in message and first["type"] != "value_error":
            message = f"{message[0].lower()}{message[1:]}; instead received "
            message += repr(first["input"])
        raise InputError(f"{key}: {message}" if key else message) from None


def _write(found: list[Design], out: Path) -> None:
    import json

    from ..core.files import write_text
    from ..core.specimen_file import specimen_dict

    for number, one in enumerate(found, start=1):
        text = json.dumps(specimen_dict(one.specimen), indent=2) + "\n"
        write_text(out / f"design_{number}.json", text)


def _mixed(rod: Specimen) -> str:
    recipe = dict(rod.recipe)
    if not recipe:
        return ""
    return f" (PCL {recipe['pcl']}, NdFeB {recipe['ndfeb']:g} %)"


def _print(found: list[Design], goal: Goal) -> None:
    unit = {"radius": "mm", "angle": "deg"}.get(goal.kind, "mm")
    share = "%" if goal.kind in ("radius", "angle") else "mm"
    say(f"{goal.words}:")
    for number, one in enumerate(found, start=1):
        rod = one.specimen
        moduli = "-".join(f"{s.E_MPa:.4g}" for s in rod.sections)
        lengths = "-".join(f"{s.length_mm:.4g}" for s in rod.sections)
        say(
            f"{number}. side {rod.side_mm:.4g} mm, {moduli} MPa, {lengths} mm, "
            f"{rod.remanence_mT:g} mT{_mixed(rod)}: {one.achieved:.5g} {unit}, "
            f"error {one.error:.2g} {share}, tolerance {one.tolerance:.2g} {unit}"
        )
        for other in one.more:
            x_mm, y_mm = other.tip_mm
            say(
                f"   and ({x_mm:.4g}, {y_mm:.4g}) mm, error {other.error:.2g} mm, "
                f"tolerance {other.tolerance:.2g} mm"
            )
