"""The options that commands of ``magbend sim`` share, and what they name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ..core.specimen import Specimen
    from ..sim import Field

Gmc = Annotated[int | None, typer.Option(help="Rod of the paper's Table 1, 1 to 7.")]
SpecimenFile = Annotated[Path | None, typer.Option(help="Specimen file (TOML).")]
SourceFile = Annotated[Path | None, typer.Option(help="Magnet or source file (TOML).")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def only_with(context: typer.Context, option: str, *, owner: str, holds: bool) -> None:
    """Refuse an option that was typed where it would change nothing.

    Raises
    ------
    BadParameter
        If it was, and not `holds`: it belongs to `owner`, which is missing.
    """
    source = context.get_parameter_source(option.strip("-").replace("-", "_"))
    if not holds and source is not None and source.name == "COMMANDLINE":
        raise typer.BadParameter(f"{option} belongs to {owner}")


def rod_of(gmc: int | None, file: Path | None, remeasured: bool = False) -> Specimen:
    """Return a rod of Table 1 or of a specimen file.

    Raises
    ------
    BadParameter
        If not exactly one is named.
    """
    if (gmc is None) == (file is None):
        raise typer.BadParameter("give either --gmc 1..7 or --specimen FILE")
    if gmc is not None:
        from ..sim import gmc as table1

        return table1(gmc, remeasured=remeasured)
    if remeasured:
        raise typer.BadParameter("--remeasured belongs to --gmc")
    from ..core.specimen_file import read_specimen

    return read_specimen(Path(str(file)))


def field_of(
    file: Path | None, gap_mm: float | None, flux_mT: float | None, angle_deg: float
) -> Field:
    """Return a uniform field or that of a magnet or source file.

    Raises
    ------
    BadParameter
        If not exactly one is named, or a gap does not belong to it.
    """
    if (flux_mT is None) == (file is None):
        raise typer.BadParameter("give either --field-mT B or --magnet FILE")
    if flux_mT is not None:
        if gap_mm is not None:
            raise typer.BadParameter("--gap-mm belongs to --magnet")
        from ..sim import UniformField

        return UniformField(flux_mT=flux_mT, angle_deg=angle_deg)
    from ..sim import read_field

    field = read_field(Path(str(file)))
    if gap_mm is None:
        return field
    if not field.follows_gap:
        raise typer.BadParameter("--gap-mm: all sources of the file have their place")
    return field.at_gap(gap_mm)
