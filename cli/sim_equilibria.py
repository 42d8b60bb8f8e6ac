"""``magbend sim equilibria``: every planar equilibrium in a uniform field."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import print_json, say
from .sim_case import Gmc, Json, SpecimenFile, field_of, only_with, rod_of

if TYPE_CHECKING:
    from ..core.specimen import Specimen
    from ..sim.equilibria import Branch, Equilibrium, Fold

EXAMPLE = (
    "Example: magbend sim equilibria --gmc 2 --field-mT 500 --angle-deg 150 --fold"
)


def equilibria(
    context: typer.Context,
    gmc: Gmc = None,
    specimen: SpecimenFile = None,
    remeasured: Annotated[
        bool, typer.Option("--remeasured", help="With --gmc: the sides as remeasured.")
    ] = False,
    field_mT: Annotated[
        float | None,
        typer.Option("--field-mT", help="Uniform flux density in mT; 50 by default."),
    ] = None,
    angle_deg: Annotated[
        float, typer.Option(help="Direction of the field from +x, in deg.")
    ] = 90.0,
    magnet: Annotated[
        Path | None, typer.Option(help="Magnet or source file (TOML), instead.")
    ] = None,
    gap_mm: Annotated[
        float | None, typer.Option(help="From the N face to the undeformed tip, in mm.")
    ] = None,
    clamp_angle_deg: Annotated[
        float, typer.Option(help="Direction of the clamp from +x, in deg.")
    ] = 0.0,
    load_factor: Annotated[float, typer.Option(help="Factor on the magnetism.")] = 1.0,
    fold: Annotated[
        bool, typer.Option("--fold", help="Also the loads at which pairs appear.")
    ] = False,
    figure: Annotated[
        Path | None, typer.Option(help="Draw shapes and branches: .svg, .pdf, .png.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Find every planar equilibrium of a weightless rod, stable or not."""
    from ..core.files import output_file
    from ..core.jit import once
    from ..sim import Support
    from ..sim.equilibria import find_equilibria, trace_branches

    rod = rod_of(gmc, specimen, remeasured)
    only_with(
        context, "--angle-deg", owner="a uniform field, not to --magnet",
        holds=magnet is None,
    )  # fmt: skip
    if magnet is None and field_mT is None:
        field_mT = 50.0
    field = field_of(magnet, gap_mm, field_mT, angle_deg)
    if field.follows_gap:
        raise typer.BadParameter("--magnet needs --gap-mm D")
    if field_mT is None and (fold or figure is not None):
        raise typer.BadParameter("--fold and --figure belong to --field-mT")
    support = Support(clamp_angle_deg=clamp_angle_deg, load_factor=load_factor)
    if figure is not None:
        output_file(figure)
    found = once(lambda: find_equilibria(rod, field, support=support))
    branches: tuple[Branch, ...] = ()
    uniform = field.uniform
    if uniform is not None and (fold or figure is not None):
        branches = once(lambda: trace_branches(rod, uniform, support=support))
    if figure is not None:
        from ..sim import draw_equilibria

        title = f"{rod.name}, {field_mT or 0.0:g} mT at {angle_deg:g} deg"
        draw_equilibria(figure, found, branches, title=title)
    folds = sorted(
        (one for branch in branches for one in branch.folds),
        key=lambda one: abs(one.flux_mT),
    )
    if as_json:
        where = {"flux_mT": field_mT, "angle_deg": angle_deg}
        if field_mT is None:
            where = {"gap_mm": gap_mm}
        print_json(_data(rod, where, found, folds if fold else None))
        return
    said = f"{field_mT:g} mT at {angle_deg:g} deg" if field_mT is not None else magnet
    _print(f"{rod.name}, {said}", found)
    if fold:
        _print_folds(folds, field_mT or 0.0)
    if figure is not None:
        say(f"wrote {figure}")


def _data(
    rod: Specimen,
    where: dict[str, float | None],
    found: tuple[Equilibrium, ...],
    folds: list[Fold] | None,
) -> dict[str, Any]:
    data: dict[str, Any] = {
        "specimen": rod.name,
        **where,
        "count": len(found),
        "equilibria": [
            {
                "theta_tip_rad": one.theta_tip_rad,
                "tip_mm": one.tip_mm,
                "morse_index": one.morse_index,
                "status": one.status,
                "root_moment_Nm": one.root_moment_Nm,
            }
            for one in found
        ],
    }
    if folds is not None:
        data["folds"] = [
            {
                "flux_mT": one.flux_mT,
                "theta_tip_rad": one.theta_tip_rad,
                "kind": one.kind,
            }
            for one in folds
        ]
    return data


def _print(case: str, found: tuple[Equilibrium, ...]) -> None:
    count = "1 equilibrium" if len(found) == 1 else f"{len(found)} equilibria"
    say(f"{case}: {count}")
    say("  tip angle deg       tip x mm     tip y mm  Morse index")
    for one in found:
        x, y = one.tip_mm
        say(
            f"  {one.theta_tip_rad * 57.29577951308232:13.5f}  {x:13.5f}{y:13.5f}"
            f"  {one.morse_index} ({one.status})"
        )


def _print_folds(folds: list[Fold], field_mT: float) -> None:
    if not folds:
        say(f"  no fold up to {field_mT:g} mT")
    for one in folds:
        what = (
            "a pair begins or ends"
            if one.kind == "fold"
            else "a pair leaves the straight rod"
        )
        say(
            f"  {one.kind} at {one.flux_mT:.8g} mT, tip angle "
            f"{one.theta_tip_rad * 57.29577951308232:.5f} deg: {what}"
        )
