"""What commands on run folders share: options, reading, refusing before the work."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from .console import say

if TYPE_CHECKING:
    from ..analysis import RunData
    from ..sim import Support

RUNS = typer.Argument(..., help="Run folders, or folders of runs.")
CLAMP = typer.Option(0.0, "--clamp-angle-deg", help="Direction of the clamp.")
GRAVITY = typer.Option(
    None,
    "--gravity-m-s2",
    help="Weight x y z in the specimen frame instead of [bench] of the rig file; "
    "0 0 -9.81 is a bench seen from above.",
)
MAGNET = typer.Option(
    None, "--magnet", help="Source file instead of the magnet of the runs."
)
LOAD = typer.Option(1.0, "--load-factor", help="Factor on the magnetic load.")
MOST_CLAMP_DEG = 45.0
"""A clamp further off +x is none of a measured run, whose rod leaves it along +x."""
UNVERIFIED = typer.Option(
    False, "--unverified", help="Go on with runs whose files were altered; say which."
)


def loaded_runs(
    paths: Sequence[Path], *, unverified: bool
) -> tuple[list[RunData], list[str]]:
    """Return the runs that can be read, and a sentence on each that cannot."""
    from ..analysis import load_runs

    loaded, left_out = load_runs(paths, unverified=unverified)
    for run in loaded:
        for warning in run.warnings:
            say(f"{run.label}: {warning}", err=True)
    return loaded, left_out


def tell_left_out(left_out: Sequence[str], kept: int) -> None:
    """Say what was left out, and how much of how many."""
    for sentence in left_out:
        say(f"left out: {sentence}", err=True)
    if left_out:
        runs = len(left_out) + kept
        say(f"{len(left_out)} of {runs} runs left out", err=True)


def outputs(*paths: Path | None) -> None:
    """Refuse what cannot be written, before the work."""
    from ..core.files import output_file
    from ..core.owned import refuse_links
    from ..rig import is_run

    for path in paths:
        if path is not None:
            output_file(path)
            if is_run(path.parent):
                refuse_links(path.parent)


def support_of(
    told: Support,
    clamp_angle_deg: float,
    gravity_m_s2: tuple[float, float, float] | None,
    load_factor: float,
) -> Support:
    """Return what was asked for; without a word on weight, that of the run."""
    from dataclasses import replace

    from ..core.checks import within

    within(clamp_angle_deg, -MOST_CLAMP_DEG, MOST_CLAMP_DEG, "--clamp-angle-deg", "deg")
    return replace(
        told,
        clamp_angle_deg=clamp_angle_deg,
        gravity_m_s2=gravity_m_s2 or told.gravity_m_s2,
        load_factor=load_factor,
    )


def choice(value: str, allowed: Sequence[str], option: str) -> str:
    """Return the value if it is allowed; else a mistake of usage."""
    if value not in allowed:
        raise typer.BadParameter(
            f"must be {' or '.join(allowed)}; instead received {value!r}",
            param_hint=option,
        )
    return value
