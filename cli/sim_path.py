"""``magbend sim path``: a rod while a gap, a pose, an angle or a flux returns."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import print_json, say
from .sim_case import Gmc, Json, SourceFile, SpecimenFile, field_of, only_with, rod_of

if TYPE_CHECKING:
    from ..sim import Path as Followed

EXAMPLE = (
    "Example: magbend sim path --specimen S.toml --magnet M.toml --gap-mm 120:30:120"
)
_HOW = "from:to[:back...]"


def path(
    context: typer.Context,
    gmc: Gmc = None,
    specimen: SpecimenFile = None,
    magnet: SourceFile = None,
    field_mT: Annotated[
        str | None, typer.Option("--field-mT", help=f"Uniform flux, or {_HOW}.")
    ] = None,
    angle_deg: Annotated[
        str, typer.Option(help=f"Direction of the uniform field, or {_HOW}.")
    ] = "90",
    gap_mm: Annotated[
        str | None, typer.Option(help=f"Gap of the magnet, or {_HOW}.")
    ] = None,
    axis_angle_deg: Annotated[
        str | None, typer.Option(help=f"Direction of the sources' axis: {_HOW}.")
    ] = None,
    offset_x_mm: Annotated[
        str | None, typer.Option(help=f"Shift of the sources along x: {_HOW}.")
    ] = None,
    offset_y_mm: Annotated[
        str | None, typer.Option(help=f"Shift of the sources along y: {_HOW}.")
    ] = None,
    clamp_angle_deg: Annotated[
        str | None, typer.Option(help=f"Direction of the clamp: {_HOW}.")
    ] = None,
    insertion_mm: Annotated[
        str | None, typer.Option(help=f"Length of the root's section: {_HOW}.")
    ] = None,
    gravity_m_s2: Annotated[
        tuple[float, float, float],
        typer.Option(help="Free fall (x y z) in m/s2, within the plane."),
    ] = (0.0, 0.0, 0.0),
    steps: Annotated[int, typer.Option(min=1, help="Points on each leg.")] = 60,
    out: Annotated[Path | None, typer.Option(help="Write the points as CSV.")] = None,
    figure: Annotated[
        Path | None, typer.Option(help="Draw the path: .svg, .pdf, .png.")
    ] = None,
    animation: Annotated[
        Path | None, typer.Option(help="Draw the shapes one by one: .gif.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Follow a rod quasi-statically through folds, snaps and back."""
    from ..core.files import output_file
    from ..sim import Support, follow_path

    given = {
        "gap_mm": gap_mm, "flux_mT": field_mT, "angle_deg": angle_deg,
        "axis_angle_deg": axis_angle_deg, "offset_x_mm": offset_x_mm,
        "offset_y_mm": offset_y_mm, "clamp_angle_deg": clamp_angle_deg,
        "insertion_mm": insertion_mm,
    }  # fmt: skip
    only_with(
        context, "--angle-deg", holds=field_mT is not None or ":" in angle_deg,
        owner="--field-mT; a source file has its own directions",
    )  # fmt: skip
    legs = {name: text for name, text in given.items() if text and ":" in text}
    if not legs:
        raise typer.BadParameter(f"give one option {_HOW}, such as --gap-mm 120:30:120")
    if len(legs) > 1:
        both = " and ".join(f"{_option(name)} {text}" for name, text in legs.items())
        raise typer.BadParameter(
            f"one quantity at a time runs along a path, but {both} were given; leave "
            f"one of them {_HOW} and give the others as one number, or not at all"
        )
    quantity, text = next(iter(legs.items()))
    waypoints = [_number(quantity, part) for part in text.split(":")]
    kept = {
        name: _number(name, text)
        for name, text in given.items()
        if name not in legs and text
    }
    rod = rod_of(gmc, specimen)
    angle = kept.pop("angle_deg", 90.0)
    gap, flux = kept.pop("gap_mm", None), kept.pop("flux_mT", None)
    field = field_of(
        magnet, gap, waypoints[0] if quantity == "flux_mT" else flux, angle
    )
    if field.follows_gap and quantity != "gap_mm":
        raise typer.BadParameter("--magnet needs --gap-mm D")
    for file in (out, figure, animation):
        if file is not None:
            output_file(file)
    support = Support(gravity_m_s2=gravity_m_s2)
    along: dict[str, Any] = kept | {quantity: waypoints}
    found = follow_path(rod, field, support=support, steps=steps, **along)
    _write(found, rod.name, out, figure, animation)
    if as_json:
        print_json(_data(rod.name, found))
    else:
        _print(rod.name, found, [out, figure, animation])


def _option(name: str) -> str:
    return "--field-mT" if name == "flux_mT" else f"--{name.replace('_', '-')}"


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(
            f"{_option(name)} must be a number or, as 120:30:120, several; instead "
            f"received {text!r}"
        ) from None


def _write(
    found: Followed,
    name: str,
    out: Path | None,
    figure: Path | None,
    animation: Path | None,
) -> None:
    if out is not None:
        from ..core.files import write_text
        from ..sim import path_csv

        write_text(out, path_csv(found))
    if figure is not None:
        from ..sim import draw_path

        draw_path(figure, found, title=name)
    if animation is not None:
        from ..sim import animate_path

        animate_path(animation, found, title=name)


def _data(name: str, found: Followed) -> dict[str, Any]:
    quantity = found.quantity
    return {
        "specimen": name,
        "quantity": quantity,
        "points": [
            {
                quantity: one.value,
                "tip_mm": one.centreline.tip_mm if one.centreline else None,
                "status": one.status,
                "morse_index": one.morse_index,
                "energy_uJ": one.energy_uJ,
                "work_uJ": one.work_uJ,
                "snapped": one.snapped,
            }
            for one in found.points
        ],
        "folds": [
            {
                quantity: one.value,
                "direction": one.direction,
                "kind": one.kind,
                "tip_mm": one.tip_mm,
                "turning": one.turning,
                "branches_mm": one.branches_mm,
            }
            for one in found.folds
        ],
        "dissipated_uJ": found.dissipated_uJ,
    }


def _print(name: str, found: Followed, files: list[Path | None]) -> None:
    quantity, unit = found.quantity.rsplit("_", 1)
    say(f"{name}: {len(found.points)} points of {found.quantity}")
    for one in found.folds:
        x, y = one.tip_mm
        say(
            f"  {one.kind:8} at {one.value:.6g} {unit}, {quantity} {one.direction}, "
            f"tip ({x:.4f}, {y:.4f}) mm"
        )
        for x, y in one.branches_mm:
            say(
                f"           beside the straight rod: stable, tip ({x:.4f}, {y:.4f}) mm"
            )
    lost = sum(one.centreline is None for one in found.points)
    if not found.folds and not lost:
        say("  no fold: it would go back the way it came")
    if lost:
        say(f"  pulled in at {lost} points")
    if found.dissipated_uJ > 0.0:
        say(f"  snaps dissipate {found.dissipated_uJ:.4g} microjoules")
    work_uJ = found.points[-1].work_uJ
    if math.isfinite(work_uJ):
        say(f"  work done on the rod {work_uJ:.4g} microjoules")
    for file in files:
        if file is not None:
            say(f"wrote {file}")
