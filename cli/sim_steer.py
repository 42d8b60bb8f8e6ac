"""``magbend sim steer``: the field's path that leads a rod through a gate."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import print_json, say
from .sim_case import Gmc, Json, SpecimenFile, rod_of
from .sim_navigate import write_passage

if TYPE_CHECKING:
    from ..rig import RigModel
    from ..sim import Field
    from ..sim.navigate import Reach

EXAMPLE = (
    'Example: magbend sim steer fork.toml --gate "left branch" '
    "--specimen specimen.toml --rig rig.toml --out steered"
)


def steer(
    lumen: Annotated[Path, typer.Argument(help="Lumen file (TOML).")],
    gate: Annotated[str, typer.Option(help="Gate that the tip is to pass.")],
    gmc: Gmc = None,
    specimen: SpecimenFile = None,
    most_mT: Annotated[
        float | None,
        typer.Option("--most-mT", help="Uniform field: strongest, either way, in mT."),
    ] = None,
    change_mT: Annotated[
        float, typer.Option("--change-mT", help="Its change from pose to pose, in mT.")
    ] = 20.0,
    angle_deg: Annotated[
        float, typer.Option(help="Its direction from +x, in deg.")
    ] = 90.0,
    magnet: Annotated[Path | None, typer.Option(help="Magnet file (TOML).")] = None,
    gaps_mm: Annotated[
        tuple[float, float],
        typer.Option(help="Nearest and furthest gap of the magnet, in mm."),
    ] = (40.0, 100.0),
    rig: Annotated[
        Path | None,
        typer.Option(help="Rig file: its magnet, and the limits of its axes."),
    ] = None,
    change_mm: Annotated[
        float, typer.Option(help="Way of the magnet from pose to pose, in mm.")
    ] = 10.0,
    change_deg: Annotated[
        float, typer.Option(help="Turn of the magnet from pose to pose, in deg.")
    ] = 20.0,
    wall_height_mm: Annotated[
        float | None, typer.Option(help="Of the channel, for the plan.")
    ] = None,
    every_mm: Annotated[float, typer.Option(help="Insertion between poses, mm.")] = 3.0,
    friction: Annotated[float, typer.Option(help="Coefficient of friction.")] = 0.0,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for poses.toml, plan.toml, tables and film."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Find the field's path, pose by pose, that leads a rod through a gate.

    With --rig the magnet moves within the rig's limits, and turns if the rig has an
    axis axis_angle_deg; if it has an axis insertion_mm the plan feeds the rod.
    With --magnet alone it only approaches, while a hand feeds.
    """
    from ..core.checks import positive
    from ..core.files import output_folder, write_text
    from ..rig import read_rig
    from ..sim import navigate as navigation

    if sum(one is not None for one in (most_mT, magnet, rig)) != 1:
        raise typer.BadParameter("give one of --most-mT B, --magnet FILE, --rig FILE")
    rod = rod_of(gmc, specimen)
    place = navigation.read_lumen(lumen)
    if out is not None:
        output_folder(out)
    bench = None if rig is None else read_rig(rig)
    if most_mT is not None:
        field, reach, start = _uniform(most_mT, change_mT)
    elif bench is not None:
        field, reach, start = _bench(bench, change_mm, change_deg)
    else:
        field, reach, start = _magnet(Path(str(magnet)), gaps_mm, change_mm)
    steered = navigation.steer(
        rod, place, field, reach, gate=gate, start=start,
        every_mm=positive(every_mm, "every_mm", "mm"), friction=friction,
        angle_deg=angle_deg,
    )  # fmt: skip
    if out is not None:
        write_passage(out, place, steered.passage, rod)
        write_text(out / "poses.toml", navigation.poses_text(steered))
        if field is not None:
            height_mm = 0.4 + rod.side_mm if wall_height_mm is None else wall_height_mm
            plan = navigation.plan_of(
                steered,
                name=f"steer through {gate}",
                specimen_file=_from(out, specimen) or f"gmc{gmc}.toml",
                rig_file=_from(out, rig) or "rig.toml",
                axes=[axis.name for axis in bench.axis] if bench else (),
                lumen_file=_from(out, lumen),
                wall_height_mm=positive(height_mm, "wall_height_mm", "mm"),
            )
            write_text(out / "plan.toml", plan)
    if as_json:
        print_json({"poses": steered.poses, "gates": steered.passage.gates})
        return
    _print(steered, rod.name, gate)


def _from(folder: Path, path: Path | None) -> str:
    """Return a path as a file in a folder names it."""
    if path is None:
        return ""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


Means = tuple["Field | None", dict[str, "Reach"], dict[str, float] | None]
"""The field, what can be done with it, and the first pose; None if that may be any."""


def _uniform(most_mT: float, change_mT: float) -> Means:
    from ..core.checks import positive
    from ..sim.navigate import Reach

    most = positive(most_mT, "most_mT", "mT")
    change = positive(change_mT, "change_mT", "mT")
    return (
        None, {"flux_mT": Reach(low=-most, high=most, change=change)}, {"flux_mT": 0.0}
    )  # fmt: skip


def _magnet(file: Path, gaps_mm: tuple[float, float], change_mm: float) -> Means:
    from ..core.checks import positive
    from ..sim import read_field
    from ..sim.navigate import Reach

    near, far = sorted(positive(gap, "gaps_mm", "mm") for gap in gaps_mm)
    change = positive(change_mm, "change_mm", "mm")
    reach = {"gap_mm": Reach(low=near, high=far, change=change, falls=True)}
    return read_field(file).at_gap(far), reach, {"gap_mm": far}


def _bench(rig: RigModel, change_mm: float, change_deg: float) -> Means:
    """Return what the stage and the axes of a rig can do with its magnet."""
    from ..core.checks import positive
    from ..core.errors import InputError
    from ..sim import MagnetField
    from ..sim.navigate import Reach

    if rig.magnet is None:
        raise InputError(f"the rig {rig.name!r} must have a [magnet] to steer with")
    magnet = rig.magnet.magnet()
    near, far = rig.limits.min_gap_mm, rig.limits.max_gap_mm
    axes = {axis.name: axis for axis in rig.axis}
    change = positive(change_mm, "change_mm", "mm")
    fed = "insertion_mm" in axes
    reach = {"gap_mm": Reach(low=near, high=far, change=change, falls=not fed)}
    turning = axes.get("axis_angle_deg")
    if turning is not None:
        reach["axis_angle_deg"] = Reach(
            low=turning.min, high=turning.max,
            change=positive(change_deg, "change_deg", "deg"),
        )  # fmt: skip
    return (
        MagnetField(magnet=magnet, gap_mm=far),
        reach,
        None if fed else {"gap_mm": far},
    )


def _print(steered: Any, rod: str, gate: str) -> None:
    say(f"{rod} passes {gate!r}:")
    for pose in steered.poses:
        rest = ", ".join(
            f"{name} {value:g}"
            for name, value in pose.items()
            if name != "insertion_mm"
        )
        say(f"  {pose['insertion_mm']:6.2f} mm in: {rest}")
    say(f"  on the walls  {1e3 * steered.passage.most('wall_N'):.4g} mN at most")
