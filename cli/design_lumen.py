"""``magbend analysis design --lumen``: rods that pass a lumen."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .console import print_json, progress, say

if TYPE_CHECKING:
    from ..analysis import Makeable, Through
    from ..sim import Field


def design_lumen(
    path: Path,
    field: Field,
    makeable: Makeable,
    *,
    stiffness_N_mm: float | None,
    friction: float,
    gate: str | None,
    count: int,
    seed: int,
    out: Path | None,
    as_json: bool,
) -> None:
    """Find rods that pass the lumen of a file, print them, write them."""
    from ..analysis import design_through
    from ..core.errors import InputError
    from ..sim.navigate import read_lumen

    if stiffness_N_mm is None:
        raise InputError(
            "--lumen needs --tip-stiffness-N-mm, the force across the tip that bends "
            "it by 1 mm (GMC 2 has 1.65e-4): the softest rod always presses least"
        )
    lumen = read_lumen(path)
    names = [one.name for one in lumen.gates]
    if gate is not None and gate not in names:
        raise InputError(
            f"--gate must be one of the lumen's gates, {', '.join(names) or 'none'}; "
            f"instead received {gate!r}"
        )
    with progress("rods tried") as tell:
        found = design_through(
            lumen, field, makeable, stiffness_N_mm=stiffness_N_mm, friction=friction,
            gate=gate, count=count, seed=seed, progress=tell,
        )  # fmt: skip
    if out is not None:
        _write(found, out)
    if as_json:
        print_json([_data(one) for one in found])
        return
    for one in found:
        rod = one.specimen
        moduli = "-".join(f"{s.E_MPa:.4g}" for s in rod.sections)
        lengths = "-".join(f"{s.length_mm:.4g}" for s in rod.sections)
        say(
            f"{rod.name}: side {rod.side_mm:.4g} mm, {moduli} MPa, {lengths} mm: "
            f"presses {1e3 * one.passage.most('wall_N'):.4g} mN on the walls, needs "
            f"{1e3 * one.passage.most('push_N'):.4g} mN"
        )


def _data(one: Through) -> dict[str, object]:
    from ..core.specimen_file import specimen_dict

    return {
        "specimen": specimen_dict(one.specimen),
        "most_wall_N": one.passage.most("wall_N"),
        "most_push_N": one.passage.most("push_N"),
        "most_root_curvature_per_mm": one.passage.most("root_curvature_per_mm"),
        "tip_stiffness_N_mm": one.tip_stiffness_N_mm,
        "gates": list(one.passage.gates),
    }


def _write(found: list[Through], out: Path) -> None:
    from ..core.json import write_json
    from ..core.specimen_file import specimen_dict

    for number, one in enumerate(found, start=1):
        write_json(out / f"design_{number}.json", specimen_dict(one.specimen))
