"""``magbend demo`` and ``magbend doctor``."""

from __future__ import annotations

from pathlib import Path

import typer

DEMO_EXAMPLE = "Example: magbend demo --out demo"
DOCTOR_EXAMPLE = "Example: magbend doctor"


def demo(
    out: Path = typer.Option(Path("demo"), "--out", help="Folder for the run."),
) -> None:
    """Run the whole loop on the built-in twin bench and write a report."""


def doctor() -> None:
    """Say what is installed, which ports and cameras answer, and what is missing."""
