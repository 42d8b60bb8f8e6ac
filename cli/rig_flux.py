"""Readings of a hand meter: asked for, judged at once, and corrected afterwards."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.errors import ConfigError, InputError
from .console import print_json, say
from .keys import answering

if TYPE_CHECKING:
    from ..analysis import FieldWitness
    from ..rig import Plan

EXAMPLE = "Example: magbend rig amend-flux runs/gmc2 --step 2 --flux-mT 38"


def register(app: typer.Typer) -> None:
    """Add the command of this module to the group ``rig``."""
    app.command("amend-flux", epilog=EXAMPLE)(amend)


def asker(plan: Plan) -> Callable[[float], float | None]:
    """Return what asks for the reading at a gap, and doubts it at once."""
    from ..analysis import witness_of

    witness, earlier = witness_of(plan), list[tuple[float, float]]()

    def ask(gap_mm: float) -> float | None:
        flux_mT = ask_flux(gap_mm)
        if flux_mT is None:
            return None
        doubt = witness.judge(gap_mm, flux_mT, None, earlier).sentence
        if doubt:
            say(f"{doubt}; type it again to keep it", err=True)
            flux_mT = ask_flux(gap_mm)
        if flux_mT is not None:
            earlier.append((gap_mm, flux_mT))
        return flux_mT

    return ask


def ask_flux(gap_mm: float) -> float | None:
    """Ask for the reading of a hand meter; Enter means that there is none.

    Raises
    ------
    StoppedError
        On Ctrl-C.
    """
    from ..rig import StoppedError

    while True:
        try:
            with answering():
                text = typer.prompt(
                    f"Tesla-meter at {gap_mm:g} mm, in mT (Enter: none)",
                    default="", show_default=False, err=True,
                )  # fmt: skip
        except typer.Abort:
            raise StoppedError("stopped by Ctrl-C") from None
        if not text.strip():
            return None
        value = _millitesla(text)
        if math.isfinite(value):
            return value
        say(f"a reading must be a number in mT; instead received {text!r}")


def _millitesla(text: str) -> float:
    """Return a typed number, with or without its unit mT; NaN if it is none."""
    number = text.strip()
    if number[-2:].lower() == "mt":
        number = number[:-2]
    try:
        return float(number.strip().replace(",", "."))
    except ValueError:
        return math.nan


def require_plausible(plan: Plan, readings_mT: dict[float, float]) -> None:
    """Refuse typed readings that no magnet gives, before anything moves.

    Raises
    ------
    InputError
        If a unit slipped, two readings were exchanged, or no magnet is so strong.
    """
    from ..analysis import witness_of

    witness, earlier = witness_of(plan), list[tuple[float, float]]()
    for gap_mm, flux_mT in readings_mT.items():
        said = witness.judge(gap_mm, flux_mT, None, earlier)
        if said.is_impossible:
            raise InputError(f"--flux-mT: {said.sentence}; nothing was moved")
        earlier.append((gap_mm, flux_mT))


def amend(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    step: Annotated[int, typer.Option(help="Which step, from 1.")],
    flux_mT: Annotated[
        float, typer.Option("--flux-mT", help="What the meter truly showed, in mT.")
    ],
    reason: Annotated[str, typer.Option(help="Why, for later readers.")] = "",
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON for machines.")
    ] = False,
) -> None:
    """Correct the reading of one step; what it was is kept beside it.

    The records of the run stay as they are; amendments.jsonl says what was corrected,
    when, by whom and why, and every reader takes the corrected value.
    """
    from ..rig import amend_flux

    record = amend_flux(
        run, step - 1, flux_mT, reason=reason, witness=_witness_of_run(run)
    )
    if as_json:
        print_json(record)
        return
    was = record["was_mT"]
    before = "no reading" if was is None else f"{was:g} mT"
    say(f"{run}: step {step} was {before} and is {flux_mT:g} mT")
    if record["field"]["sentence"]:
        say(f"note: {record['field']['sentence']}", err=True)


def _witness_of_run(run: Path) -> FieldWitness:
    from ..analysis import FieldWitness
    from ..core.specimen_file import MagnetModel
    from ..rig import read_run

    table = read_run(run).manifest.get("rig", {}).get("magnet")
    try:
        magnet = MagnetModel.model_validate(table).magnet() if table else None
    except ValueError as error:
        raise ConfigError(f"{run}: its magnet cannot be read: {error}") from None
    return FieldWitness(magnet)
