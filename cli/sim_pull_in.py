"""``magbend sim pull-in``: the gap at which a magnet takes rods, over their design."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .console import print_json, progress, say
from .sim_case import Gmc, Json, SpecimenFile, field_of, rod_of

EXAMPLE = (
    "Example: magbend sim pull-in --gmc 2 --magnet M.toml "
    "--over remanence_mT=-400:-20:12 --over E_MPa=5:30:10 --figure pull_in.png"
)


def pull_in(
    over: Annotated[
        list[str],
        typer.Option(
            help="Twice NAME=LOW:HIGH:COUNT; names: remanence_mT, length_mm, E_MPa (of "
            "the root, others in proportion), side_mm or what the shape has."
        ),
    ],
    magnet: Annotated[Path, typer.Option(help="Magnet or source file (TOML).")],
    gmc: Gmc = None,
    specimen: SpecimenFile = None,
    range_mm: Annotated[
        tuple[float, float], typer.Option(help="Smallest and largest gap to look at.")
    ] = (5.0, 200.0),
    out: Annotated[Path | None, typer.Option(help="Write the map as CSV.")] = None,
    figure: Annotated[
        Path | None, typer.Option(help="Draw the map: .svg, .pdf, .png.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Find at which gap an approaching magnet pulls a rod in, over two properties."""
    from ..core.files import output_file, write_text
    from ..sim import draw_pull_in, pull_in_csv, pull_in_gaps

    rod = rod_of(gmc, specimen)
    field = field_of(magnet, None, None, 90.0)
    for file in (out, figure):
        if file is not None:
            output_file(file)
    properties = dict(_values(text) for text in over)
    with progress("gaps") as tell:
        found = pull_in_gaps(rod, field, properties, range_mm=range_mm, progress=tell)
    if out is not None:
        write_text(out, pull_in_csv(found))
    if figure is not None:
        draw_pull_in(figure, found, title=f"{rod.name}: pull-in")
    if as_json:
        first, second = found.names
        gaps = [
            [gap if gap < float("inf") else None for gap in row]
            for row in found.gap_mm.tolist()
        ]
        print_json(
            {"specimen": rod.name, first: found.x.tolist(), second: found.y.tolist(),
             "pull_in_gap_mm": gaps}
        )  # fmt: skip
        return
    known = found.gap_mm[abs(found.gap_mm) < float("inf")]
    say(f"{rod.name}: {len(known)} of {found.gap_mm.size} rods are pulled in")
    if len(known):
        say(f"  at gaps from {known.min():.4g} to {known.max():.4g} mm")
    for file in (out, figure):
        if file is not None:
            say(f"wrote {file}")


def _values(text: str) -> tuple[str, list[float]]:
    name, _, rest = text.partition("=")
    try:
        low, high, count = rest.split(":")
        first, last, n = float(low), float(high), int(count)
    except ValueError:
        n = 0
    if not 1 <= n <= 1000:
        raise typer.BadParameter(
            "--over must be NAME=LOW:HIGH:COUNT with up to 1000 values, as "
            f"E_MPa=5:30:6 is; instead received {text!r}"
        )
    return name, [first + (last - first) * k / max(n - 1, 1) for k in range(n)]
