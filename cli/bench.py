"""``magbend demo`` and ``magbend doctor``."""

from __future__ import annotations

from pathlib import Path

import typer

from .console import print_json, say

DEMO_EXAMPLE = "Example: magbend demo --out demo"
DOCTOR_EXAMPLE = "Example: magbend doctor --json"
EXAMPLES_EXAMPLE = "Example: magbend examples --out magbend-examples"
SCHEMA_EXAMPLE = (
    "Example: magbend schema --out schemas; then write '#:schema "
    "schemas/plan.schema.json' into the first line of plan.toml"
)


def demo(
    out: Path = typer.Option(Path("demo"), "--out", help="Folder for the run."),
    seed: int = typer.Option(
        2, "--seed", min=0, help="Which hidden truth the twin bench gets."
    ),
    panel: bool = typer.Option(
        False, "--panel", help="Play the loop on the control panel instead."
    ),
    port: int = typer.Option(8765, "--port", help="Port of the panel; 0: any."),
    no_browser: bool = typer.Option(
        False, "--no-browser", help="Print the panel's address; open no browser."
    ),
) -> None:
    """Run the whole loop on the built-in twin bench and write a report.

    A simulated board, camera and Tesla-meter stand in for the bench; their rod differs
    from the nominal one by a hidden amount, which the report has to find.
    """
    if panel:
        from .panel import open_demo

        open_demo(out, seed=seed, port=port, browser=not no_browser)
        return
    from ..analysis import run_demo

    report = run_demo(out, seed=seed, tell=say)
    say(str(report))


def doctor(
    as_json: bool = typer.Option(False, "--json", help="Print JSON for machines."),
) -> None:
    """Say what is installed, which ports and cameras answer, and what is missing."""
    from ..analysis import as_dicts, examine

    findings = examine()
    if as_json:
        print_json(as_dicts(findings))
    else:
        width = max(len(finding.subject) for finding in findings)
        for finding in findings:
            say(f"{finding.status:7} {finding.subject:{width}}  {finding.detail}")
    if any(finding.status == "broken" for finding in findings):
        raise typer.Exit(1)


def examples(
    out: Path = typer.Option(Path("magbend-examples"), "--out", help="Folder to fill."),
) -> None:
    """Copy the examples that come with the package: scripts, plans, rods, a library."""
    from ..analysis import copy_examples

    for path in copy_examples(out):
        say(str(path))


def schema(
    kind: str = typer.Argument(
        "",
        help="specimen, magnet, rig, plan, meter, space, calibration or makeable; "
        "of records run, step, fit or comparison.",
    ),
    out: Path | None = typer.Option(
        None, "--out", help="Write every schema into this folder."
    ),
) -> None:
    """Print the JSON Schema of a TOML file, for editors that check while one types."""
    from ..analysis import toml_schema, write_toml_schemas

    if out is not None:
        for path in write_toml_schemas(out):
            say(str(path))
        return
    print_json(toml_schema(kind))
