"""``magbend sim navigate``: a rod pushed through a lumen."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import print_json, say
from .sim_case import Gmc, Json, SourceFile, SpecimenFile, field_of, only_with, rod_of

if TYPE_CHECKING:
    from ..core.specimen import Specimen
    from ..sim.navigate import Branch, Lumen, Passage
    from ..sim.tube import Tube

EXAMPLE = (
    "Example: magbend sim navigate bend90.toml --gmc 2 --field-mT 20 --angle-deg 90 "
    "--friction 0.1 --out passage"
)


def navigate(
    context: typer.Context,
    lumen: Annotated[Path, typer.Argument(help="Lumen file (TOML).")],
    gmc: Gmc = None,
    specimen: SpecimenFile = None,
    field_mT: Annotated[
        float | None, typer.Option("--field-mT", help="Uniform flux density in mT.")
    ] = None,
    angle_deg: Annotated[
        float, typer.Option(help="Direction of the uniform field from +x, in deg.")
    ] = 90.0,
    elevation_deg: Annotated[
        float, typer.Option(help="Angle of the uniform field above the xy plane.")
    ] = 0.0,
    magnet: SourceFile = None,
    gap_mm: Annotated[
        float | None,
        typer.Option(help="From the N face to the point (rod's length, 0), in mm."),
    ] = None,
    poses: Annotated[
        Path | None, typer.Option(help="Poses of the field over the insertion (TOML).")
    ] = None,
    way_mm: Annotated[
        list[float] | None,
        typer.Option(help="Insertion to go to, in mm; again for forth and back."),
    ] = None,
    step_mm: Annotated[float, typer.Option(help="Step of the insertion, in mm.")] = 0.5,
    friction: Annotated[float, typer.Option(help="Coefficient of friction.")] = 0.0,
    gravity_m_s2: Annotated[
        tuple[float, float, float],
        typer.Option(help="Free fall (x y z) in m/s2; z only in a tube."),
    ] = (0.0, 0.0, 0.0),
    push_limit_N: Annotated[
        float | None, typer.Option("--push-limit-N", help="Give up above this, in N.")
    ] = None,
    elements: Annotated[int, typer.Option(help="Elements of the whole rod.")] = 24,
    branches: Annotated[
        bool,
        typer.Option("--branches", help="Follow, through folds, what snaps leave."),
    ] = False,
    out: Annotated[
        Path | None, typer.Option(help="Folder for tables, figure and film.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Push a rod through a lumen: planar, or a tube in space.

    With contact, friction, push force and snaps.

    Without --field-mT, --magnet or --poses there is no field.
    """
    from ..core.files import output_folder
    from ..sim import Support
    from ..sim import navigate as navigation

    rod = rod_of(gmc, specimen)
    table = navigation.read_poses(poses) if poses is not None else []
    known = set(table[0]) if table else set()
    for option, key in (
        ("--angle-deg", "angle_deg"), ("--elevation-deg", "elevation_deg")
    ):  # fmt: skip
        only_with(
            context, option, owner=f"--field-mT, or poses with flux_mT but no {key}",
            holds=(field_mT is not None or "flux_mT" in known) and key not in known,
        )  # fmt: skip
    field = _field(field_mT, (angle_deg, elevation_deg), magnet, gap_mm, table)
    place = navigation.read_lumen(lumen)
    if out is not None:
        output_folder(out)
    passage = navigation.navigate(
        rod,
        place,
        field,
        way_mm=way_mm or None,
        step_mm=step_mm,
        friction=friction,
        support=Support(gravity_m_s2=gravity_m_s2),
        push_limit_N=float("inf") if push_limit_N is None else push_limit_N,
        elements=elements,
        branches=branches,
    )
    data = _summary(passage)
    if out is not None:
        write_passage(out, place, passage, rod)
    if as_json:
        for told, branch in zip(data["branches"], passage.branches, strict=True):
            told["steps"] = _rows(branch)
        print_json(data | {"steps": [_row(step) for step in passage.steps]})
    else:
        _print(data, passage)
        if branches and not passage.branches:
            say("  branches        none: the rod did not snap")


def _field(
    field_mT: float | None,
    angles_deg: tuple[float, float],
    file: Path | None,
    gap_mm: float | None,
    table: list[dict[str, float]],
) -> Any:
    from ..sim import Field, Uniform
    from ..sim.navigate import moving

    if table and field_mT is not None and "flux_mT" in table[0]:
        raise typer.BadParameter("give either --field-mT or flux_mT in the poses")
    if table and gap_mm is not None and "gap_mm" in table[0]:
        raise typer.BadParameter("give either --gap-mm or gap_mm in the poses")
    angle_deg, elevation_deg = angles_deg
    field = Field(
        Uniform(
            flux_mT=field_mT or 0.0, angle_deg=angle_deg, elevation_deg=elevation_deg
        )
    )
    if file is not None or gap_mm is not None:
        field = field_of(file, gap_mm, field_mT, angle_deg)
    if field.follows_gap and "gap_mm" not in (table or [{}])[0]:
        raise typer.BadParameter("--magnet needs --gap-mm D, or poses with gap_mm")
    return moving(field, table) if table else field


def _summary(passage: Passage) -> dict[str, Any]:
    last = passage.steps[-1]
    in_tube = {name: passage.most(name) for name in IN_TUBE[1:] if hasattr(last, name)}
    return {
        "lumen": passage.lumen,
        "specimen": passage.specimen,
        "outcome": passage.outcome,
        "reached_mm": passage.reached_mm,
        "gates": list(passage.gates),
        "snaps": len(passage.snaps),
        "most_push_N": passage.most("push_N"),
        "most_root_curvature_per_mm": passage.most("root_curvature_per_mm"),
        "most_wall_N": passage.most("wall_N"),
        "tip_mm": last.tip_mm,
        "tip_angle_deg": last.tip_angle_deg,
        "rubbed_Nmm": last.rubbed_Nmm,
        "overlap_mm": passage.most("overlap_mm"),
        "error_mm": passage.error_mm,
        "events": [
            {name: getattr(event, name) for name in event.__slots__}
            for event in passage.events
        ],
        "branches": [
            {
                "from_mm": branch.from_mm,
                "end": branch.end,
                "folds_mm": branch.folds_mm,
                "stable_mm": branch.stable_mm,
                "work_Nmm": branch.work_Nmm,
            }
            for branch in passage.branches
        ],
    } | in_tube


COLUMNS = (
    "insertion_mm", "push_N", "root_curvature_per_mm", "root_moment_Nm",
    "most_curvature_per_mm", "wall_N", "most_wall_N", "energy_Nmm", "rubbed_Nmm",
    "tip_angle_deg", "overlap_mm",
)  # fmt: skip

IN_TUBE = ("along_mm", "residual_Nmm")
"""What a step in a tube has besides."""


def _row(step: Any) -> dict[str, Any]:
    row = {name: getattr(step, name) for name in COLUMNS}
    row |= {f"tip_{axis}_mm": at for axis, at in zip("xyz", step.tip_mm, strict=False)}
    row |= {name: getattr(step, name) for name in IN_TUBE if hasattr(step, name)}
    row["contacts"] = [
        {field.name: getattr(contact, field.name) for field in fields(contact)}
        for contact in step.contacts
    ]
    return row


def _rows(branch: Branch) -> list[dict[str, Any]]:
    return [
        {"index": index} | _row(step)
        for step, index in zip(branch.steps, branch.indices, strict=True)
    ]


def write_passage(
    folder: Path, lumen: Lumen | Tube, passage: Passage, rod: Specimen
) -> None:
    """Write tables, figure and film of a passage into a folder."""
    import pandas as pd

    from ..core.files import write_text
    from ..core.json import write_json
    from ..sim.navigate import SpatialStep, draw_passage, film

    rows = [_row(step) for step in passage.steps]
    contacts = [
        {"insertion_mm": row["insertion_mm"]} | contact
        for row in rows
        for contact in row.pop("contacts")
    ]
    steps = pd.DataFrame(rows).to_csv(index=False)
    write_text(folder / "steps.csv", steps)
    if passage.branches:
        states = [
            {"from_mm": branch.from_mm} | row | {"contacts": len(row["contacts"])}
            for branch in passage.branches
            for row in _rows(branch)
        ]
        table = pd.DataFrame(states).to_csv(index=False)
        write_text(folder / "branches.csv", table)
    heads = ["insertion_mm", "wall", "s_mm", "x_mm", "y_mm", "force_N", "friction_N"]
    last = passage.steps[-1]
    if isinstance(last, SpatialStep):
        heads += ["z_mm", "along_mm"]
        write_text(folder / "shape.csv", last.to_csv())
    else:
        last.centreline.to_csv(folder / "shape.csv")
    pressed = pd.DataFrame(contacts, columns=heads)
    write_text(folder / "contacts.csv", pressed.to_csv(index=False))
    write_json(folder / "passage.json", _summary(passage))
    side_mm = max(rod.sides_mm)
    draw_passage(folder / "passage.png", lumen, passage, side_mm=side_mm)
    film(folder / "passage.gif", lumen, passage, side_mm=side_mm)
    say(f"wrote {folder}", err=True)


def _print(data: dict[str, Any], passage: Passage) -> None:
    say(f"{data['specimen']} in {data['lumen']}: {data['outcome']}")
    say(f"  reached         {data['reached_mm']:.3f} mm")
    say(f"  gates           {', '.join(data['gates']) or 'none'}")
    tip = ", ".join(f"{at:.4f}" for at in data["tip_mm"])
    from_curve = " from the curve" if len(data["tip_mm"]) == 3 else ""
    say(f"  tip             ({tip}) mm, {data['tip_angle_deg']:.3f} deg{from_curve}")
    say(f"  greatest push   {1e3 * data['most_push_N']:.4g} mN")
    say(f"  root curvature  {data['most_root_curvature_per_mm']:.4g} 1/mm")
    say(f"  on the walls    {1e3 * data['most_wall_N']:.4g} mN")
    for event in passage.snaps:
        say(
            f"  snap            at {event.insertion_mm:.3f} mm: the rod moves "
            f"{event.moved_mm:.2f} mm and "
            f"{'gains' if event.released_Nmm < 0.0 else 'loses'} "
            f"{abs(event.released_Nmm):.3g} N mm"
        )
    for branch in passage.branches:
        folds = ", ".join(f"{at:.3f}" for at in branch.folds_mm) or "none"
        again = ", ".join(f"{a:.3f} to {b:.3f}" for a, b in branch.stable_mm)
        say(
            f"  branch left     at {branch.from_mm:.3f} mm: folds at {folds}; stable "
            f"again {again or 'nowhere'}; {len(branch.steps)} states, {branch.end}"
        )
    for event in passage.events:
        if event.kind == "coarse":
            say(f"  too coarse      at {event.insertion_mm:.3f} mm: {event.what}")
        if event.kind == "self-contact":
            say(
                f"  self-contact    at {event.insertion_mm:.3f} mm: {event.what}; "
                "do not trust the way from there on"
            )
    say(f"  overlap         {data['overlap_mm']:.1e} mm at most, between contacts")
    if "residual_Nmm" in data:
        say(f"  out of balance  {data['residual_Nmm']:.1e} N mm at most")
    if data["error_mm"] == data["error_mm"]:
        say(f"  error           {data['error_mm']:.1e} mm, of the last shape")
