"""``magbend sim steer``: the field's path that leads a rod through a gate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .console import print_json, say
from .sim_case import rod_of
from .sim_navigate import write_passage

EXAMPLE = (
    'Example: magbend sim steer fork.toml --gate "left branch" --gmc 2 '
    "--most-mT 60 --change-mT 20 --out steered"
)


def steer(
    lumen: Annotated[Path, typer.Argument(help="Lumen file (TOML).")],
    gate: Annotated[str, typer.Option(help="Gate that the tip is to pass.")],
    gmc: Annotated[
        int | None, typer.Option(help="Rod of the paper's Table 1, 1 to 7.")
    ] = None,
    specimen: Annotated[Path | None, typer.Option(help="Specimen file (TOML).")] = None,
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
    change_mm: Annotated[
        float, typer.Option(help="Approach of the magnet from pose to pose, in mm.")
    ] = 10.0,
    every_mm: Annotated[float, typer.Option(help="Insertion between poses, mm.")] = 3.0,
    friction: Annotated[float, typer.Option(help="Coefficient of friction.")] = 0.0,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for poses.toml, plan.toml, tables and film."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Find the field's path, pose by pose, that leads a rod through a gate.

    A magnet only approaches, as the stage does; its path is written as a plan too.
    """
    from ..core.files import output_folder
    from ..sim import navigate as navigation

    if (most_mT is None) == (magnet is None):
        raise typer.BadParameter("give either --most-mT B or --magnet FILE")
    rod = rod_of(gmc, specimen)
    place = navigation.read_lumen(lumen)
    if out is not None:
        output_folder(out)
    field, reach, start = _means(most_mT, change_mT, magnet, gaps_mm, change_mm)
    steered = navigation.steer(
        rod, place, field, reach, gate=gate, start=start, every_mm=every_mm,
        friction=friction, angle_deg=angle_deg,
    )  # fmt: skip
    if out is not None:
        from ..core.files import write_text

        write_passage(out, place, steered.passage, rod)
        write_text(out / "poses.toml", navigation.poses_text(steered))
        if magnet is not None:
            plan = navigation.plan_of(
                steered,
                name=f"steer through {gate}",
                specimen_file=str(specimen or f"gmc{gmc}.toml"),
                rig_file="rig.toml",
            )
            write_text(out / "plan.toml", plan)
    if as_json:
        print_json({"poses": steered.poses, "gates": steered.passage.gates})
        return
    _print(steered, rod.name, gate)


def _means(
    most_mT: float | None,
    change_mT: float,
    magnet: Path | None,
    gaps_mm: tuple[float, float],
    change_mm: float,
) -> tuple[Any, dict[str, Any], dict[str, float]]:
    """Return the field, what can be done with it, and the first pose."""
    from ..core.checks import positive
    from ..sim.navigate import Reach

    if most_mT is not None:
        most = positive(most_mT, "most_mT", "mT")
        change = positive(change_mT, "change_mT", "mT")
        reach = {"flux_mT": Reach(low=-most, high=most, change=change)}
        return None, reach, {"flux_mT": 0.0}
    from ..sim import read_field

    near, far = sorted(positive(gap, "gaps_mm", "mm") for gap in gaps_mm)
    change = positive(change_mm, "change_mm", "mm")
    field = read_field(Path(str(magnet))).at_gap(far)
    reach = {"gap_mm": Reach(low=near, high=far, change=change, falls=True)}
    return field, reach, {"gap_mm": far}


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
