"""``magbend rig export``: a run for other people's tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..core.errors import InputError, StoreError
from .console import say

EXAMPLE = "Example: magbend rig export runs/gmc2 --to nexus --out gmc2.nxs"


def register(app: typer.Typer) -> None:
    """Add the command of this module to the group ``rig``."""
    app.command("export", epilog=EXAMPLE)(export)


def export(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    to: Annotated[
        str,
        typer.Option(help="bluesky: event-model documents, JSON lines; nexus: HDF5."),
    ],
    out: Annotated[Path, typer.Option(help="The file to write.")],
) -> None:
    """Write a run as bluesky documents or as a NeXus file; the run stays as it is.

    The documents name the photographs by their path in the run folder; the NeXus file
    holds them. NeXus needs the extra hdf5.
    """
    from ..rig import read_run, write_documents, write_nexus

    writers = {"bluesky": write_documents, "nexus": write_nexus}
    if to not in writers:
        raise InputError(f"--to must be bluesky or nexus; instead received {to!r}")
    if out.exists():
        raise StoreError(f"{out}: is there already; name another file")
    try:
        count = writers[to](read_run(run), out)
    except OSError as error:
        raise StoreError(f"{out}: cannot be written: {error.strerror}") from None
    what = "documents" if to == "bluesky" else "photographs"
    say(f"{out}: {count} {what}")
