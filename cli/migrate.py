"""``magbend migrate``: a run of an older format."""

from __future__ import annotations

from pathlib import Path

import typer

from .console import print_json, say

EXAMPLE = "Example: magbend migrate runs/gmc2"


def migrate(
    run: Path = typer.Argument(..., help="Run folder of an older format."),
    as_json: bool = typer.Option(False, "--json", help="Print JSON for machines."),
) -> None:
    """Bring a run to the present format, in which it accounts for every file.

    The old records stay, byte for byte, in .magbend/format_1 of the run. A run whose
    files do not hold is left as it is; one of the present format too.
    """
    from ..rig import migrate_run

    names = migrate_run(run)
    if as_json:
        print_json({"run": str(run), "rewritten": names})
    elif names:
        say(f"{run}: migrated; written anew: {', '.join(names)}")
    else:
        say(f"{run}: is of the present format already")
