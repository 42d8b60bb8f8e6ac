"""``magbend sim``."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import (
    sim_equilibria,
    sim_magnet,
    sim_navigate,
    sim_path,
    sim_pull_in,
    sim_steer,
    sim_sweep,
)
from .console import group, print_json, say
from .sim_case import Gmc, Json, SourceFile, SpecimenFile, field_of, only_with, rod_of

if TYPE_CHECKING:
    from ..core.specimen import Specimen
    from ..sim import Field, Solution

app = group(
    "sim",
    "Predict shapes: rods, magnets, equilibria, sweeps.",
    "magbend sim shape --gmc 2 --field-mT 50 --angle-deg 90",
)
app.command("equilibria", epilog=sim_equilibria.EXAMPLE)(sim_equilibria.equilibria)
app.command("magnet", epilog=sim_magnet.EXAMPLE)(sim_magnet.magnet)
app.command("navigate", epilog=sim_navigate.EXAMPLE)(sim_navigate.navigate)
app.command("path", epilog=sim_path.EXAMPLE)(sim_path.path)
app.command("pull-in", epilog=sim_pull_in.EXAMPLE)(sim_pull_in.pull_in)
app.command("steer", epilog=sim_steer.EXAMPLE)(sim_steer.steer)
app.command("sweep", epilog=sim_sweep.EXAMPLE)(sim_sweep.sweep)

SHAPE_EXAMPLE = (
    "Example: magbend sim shape --gmc 2 --field-mT 50 --angle-deg 90 --out shape.csv"
)


@app.command("shape", epilog=SHAPE_EXAMPLE)
def shape(
    context: typer.Context,
    gmc: Gmc = None,
    specimen: SpecimenFile = None,
    remeasured: Annotated[
        bool, typer.Option("--remeasured", help="With --gmc: the sides as remeasured.")
    ] = False,
    field_mT: Annotated[
        float | None, typer.Option("--field-mT", help="Uniform flux density in mT.")
    ] = None,
    angle_deg: Annotated[
        float, typer.Option(help="Direction of the uniform field from +x, in deg.")
    ] = 90.0,
    magnet: SourceFile = None,
    gap_mm: Annotated[
        float | None, typer.Option(help="From the N face to the undeformed tip, in mm.")
    ] = None,
    model: Annotated[str, typer.Option(help="rod, or solid (shear, clamp).")] = "rod",
    poisson: Annotated[
        float | None,
        typer.Option(help="Poisson's ratio, for --model solid, if not the specimen's."),
    ] = None,
    gravity_m_s2: Annotated[
        tuple[float, float, float],
        typer.Option(help="Free fall (x y z) in m/s2; seen from above: 0 0 -9.80665."),
    ] = (0.0, 0.0, 0.0),
    density_kg_m3: Annotated[
        float | None, typer.Option(help="Density in kg/m3, for the weight.")
    ] = None,
    clamp_angle_deg: Annotated[
        float, typer.Option(help="Direction of the clamp from +x, in deg.")
    ] = 0.0,
    load_factor: Annotated[float, typer.Option(help="Factor on the magnetism.")] = 1.0,
    points: Annotated[int, typer.Option(min=61, help="Points of the shape.")] = 61,
    verify: Annotated[
        bool, typer.Option("--verify", help="Solve again by energy, and compare.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Write the shape as CSV.")] = None,
    as_json: Json = False,
) -> None:
    """Predict the shape of a rod in a uniform field or before a magnet."""
    from ..core.files import output_file
    from ..core.jit import once
    from ..sim import Support, solve
    from ..sim import verify as check

    rod = _specimen(gmc, specimen, remeasured, density_kg_m3)
    support = Support(
        clamp_angle_deg=clamp_angle_deg,
        gravity_m_s2=gravity_m_s2,
        load_factor=load_factor,
    )
    only_with(context, "--angle-deg", owner="--field-mT", holds=field_mT is not None)
    only_with(
        context, "--density-kg-m3", owner="--gravity-m-s2", holds=any(gravity_m_s2)
    )
    only_with(
        context, "--points", owner="--out or --json", holds=as_json or out is not None
    )
    only_with(context, "--verify", owner="--model rod", holds=model == "rod")
    only_with(
        context, "--poisson",
        owner="--model solid; a plain rod twists with the poisson_ratio of its "
        "specimen file",
        holds=model != "rod",
    )  # fmt: skip
    field = _field(field_mT, angle_deg, magnet, gap_mm)
    if out is not None:
        output_file(out)
    solution = once(
        lambda: solve(
            rod,
            field,
            support=support,
            model=model,
            poisson_ratio=poisson,
            points=points,
        )
    )
    data = _summary(rod, model, solution)
    if verify:
        data["check_mm"] = (
            check(rod, field, solution, support=support)
            if solution.centreline is not None
            else None
        )
    if out is not None:
        _write(solution, rod, out)
    if as_json:
        print_json(data | solution.columns)
    else:
        _print(data)


def _specimen(
    gmc: int | None, file: Path | None, remeasured: bool, density_kg_m3: float | None
) -> Specimen:
    rod = rod_of(gmc, file, remeasured)
    if density_kg_m3 is not None:
        from dataclasses import replace

        rod = replace(rod, density_kg_m3=density_kg_m3)
    return rod


def _field(
    flux_mT: float | None, angle_deg: float, file: Path | None, gap_mm: float | None
) -> Field:
    field = field_of(file, gap_mm, flux_mT, angle_deg)
    if field.follows_gap:
        raise typer.BadParameter("--magnet needs --gap-mm D")
    return field


def _summary(rod: Specimen, model: str, solution: Solution) -> dict[str, Any]:
    data: dict[str, Any] = {
        "specimen": rod.name,
        "model": model,
        "status": solution.status,
        "morse_index": solution.morse_index,
        "stable_in_space": solution.stable_in_space,
        "load_limit": solution.load_limit,
    }
    line = solution.centreline
    if line is not None:
        data["tip_mm"] = line.tip_mm
        if solution.z_mm is not None:
            data["tip_z_mm"] = float(solution.z_mm[-1])
        data["tip_angle_deg"] = line.tip_angle_deg
        data["length_mm"] = line.length_mm
        data["root_moment_Nm"] = solution.root_moment_Nm
        data["error_mm"] = solution.error_mm
        data["sag_mm"] = solution.sag_mm
        if solution.buckled_tips_mm:
            data["buckled_tips_mm"] = solution.buckled_tips_mm
    elif solution.ending is not None:
        data["ending"] = asdict(solution.ending)
    data["flux_tip_mT"] = solution.flux_tip_mT
    return data


def _write(solution: Solution, rod: Specimen, out: Path) -> None:
    from ..core.errors import SolverError

    if solution.centreline is None:
        raise SolverError(
            f"{rod.name} is {solution.status}: its branch ends at "
            f"{solution.load_limit:.4g} of the load, so there is no shape to write"
        )
    solution.centreline.to_csv(out, z_mm=solution.z_mm)


def _print_ending(end: dict[str, Any]) -> None:
    place = ", ".join(f"{value:.3f}" for value in end["place_mm"])
    way = ", ".join(f"{value:.2f}" for value in end["turning"])
    say(f"  ends at      {end['load']:.5g} of the load")
    if end["kind"] == "contact":
        say(f"  by contact   at ({place}) mm, s = {end['s_mm']:.3f} mm")
    else:
        say(f"  in a fold    tip ({place}) mm, going ({way})")


def _print(data: dict[str, Any]) -> None:
    say(f"{data['specimen']}, model {data['model']}: {data['status']}")
    if "tip_mm" in data:
        tip = *data["tip_mm"], *([data["tip_z_mm"]] if "tip_z_mm" in data else [])
        shown = ", ".join(f"{round(value, 5) + 0.0:.5f}" for value in tip)
        say(f"  tip          ({shown}) mm")
        say(f"  tip angle    {data['tip_angle_deg']:.5f} deg")
        about = " about z" if "tip_z_mm" in data else ""
        say(f"  root moment  {data['root_moment_Nm']:.6g} N m{about}")
        say(f"  Morse index  {data['morse_index']}")
        if data["sag_mm"] >= 5e-6:
            say(f"  sag          {data['sag_mm']:.5f} mm below the clamp")
        for x, y in data.get("buckled_tips_mm", ()):
            say(f"  buckles to   a stable shape with its tip at ({x:.5f}, {y:.5f}) mm")
        if data["status"] == "stable" and data["stable_in_space"] is False:
            say("  in space     unstable: left free, it swings out of the plane")
        say(f"  error        below {data['error_mm']:.1e} mm")
    elif "ending" in data:
        _print_ending(data["ending"])
    elif data["load_limit"] < 1.0:
        say(f"  branch ends  at {data['load_limit']:.4g} of the load")
    else:
        say("  touches the magnet at full load")
    bx, by = (round(value, 4) + 0.0 for value in data["flux_tip_mT"])
    within = " in x and y" if "tip_z_mm" in data else ""
    straight = "" if "tip_mm" in data else ", where the tip of the straight rod is"
    say(f"  flux at tip  ({bx:.4f}, {by:.4f}) mT{within}{straight}")
    if "check_mm" in data:
        _print_check(data["check_mm"], data.get("error_mm"))


def _print_check(check_mm: float | None, error_mm: float | None) -> None:
    if check_mm is None or error_mm is None:
        say("  check        none: there is no shape to solve again")
    elif check_mm <= error_mm:
        say(f"  check        least energy agrees to {check_mm:.1e} mm")
    else:
        say(f"  check        least energy is {check_mm:.1e} mm away, beyond the error")
