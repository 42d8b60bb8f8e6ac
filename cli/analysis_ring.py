"""``magbend analysis ring``: the moduli from a film of a rod that rings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from .console import JSON, print_json, progress, say
from .vision_setting import setting_of
from .vision_show import tell_ringing

if TYPE_CHECKING:
    from ..analysis import Factor


def register(app: typer.Typer) -> None:
    """Add the command to the group."""
    app.command(
        epilog="Example: magbend analysis ring release.mp4 --calibration "
        "calibration.json --specimen gmc2.toml --fit runs/gmc2/fit.json"
    )(ring)


def ring(
    film: Path = typer.Argument(..., help="A film from before the rod is let go."),
    calibration: Path = typer.Option(
        ..., "--calibration", help="From `vision calibrate`, at the film's size."
    ),
    specimen: Path = typer.Option(
        ..., "--specimen", help="The rod (TOML), with its density_kg_m3."
    ),
    fit: Path = typer.Option(
        None, "--fit", help="fit.json of the same rod, to be compared."
    ),
    rod_height_mm: float = typer.Option(
        None, "--rod-height-mm", help="Height of the rod's axis above the board."
    ),
    fps: float = typer.Option(
        None, "--fps", help="Frames per second as taken, if the file says another."
    ),
    json_output: bool = JSON,
) -> None:
    """Tell E from how a rod rings without a field, and whether a fit agrees."""
    from dataclasses import asdict

    from ..analysis import AGREE, apart, fit_factor, ring_factor
    from ..core import read_specimen
    from ..sim import first_mode
    from ..vision import ring_of_film, with_specimen

    rod = read_specimen(specimen)
    first_mode(rod)  # says what is missing before the film is measured
    fitted = None if fit is None else fit_factor(rod, fit)
    setting = setting_of(calibration, None, {"rod_height_mm": rod_height_mm})
    with progress("frames") as report:
        found = ring_of_film(
            film, with_specimen(setting, rod), fps=fps, progress=report
        )
    rung = ring_factor(
        rod, found.frequency_Hz, frequency_sd_Hz=found.frequency_sd_Hz,
        damping_ratio=found.damping_ratio,
    )  # fmt: skip
    data: dict[str, Any] = {
        "film": str(film), "ringing": asdict(found), "E_ring": asdict(rung),
    }  # fmt: skip
    if fitted is not None:
        off = apart(rung, fitted)
        data |= {"E_fit": asdict(fitted), "apart_sd": off, "agree": off <= AGREE}
    if json_output:
        print_json(data)
        return
    tell_ringing(found, 0.05)
    _tell("E_ring", rung)
    if fitted is not None:
        _tell("E_fit", fitted)
        verdict = "they agree" if data["agree"] else "THEY DISAGREE"
        say(
            f"{verdict}: {rung.value / fitted.value:.4f} of one another, "
            f"{data['apart_sd']:.1f} deviations apart"
        )


def _tell(name: str, factor: Factor) -> None:
    moduli = ", ".join(f"{value:.4g}" for value in factor.E_MPa)
    say(
        f"{name}: {moduli} MPa, all known to {100.0 * factor.relative_sd:.2g} %: "
        f"{factor.value:.4f} of the specimen's, seen from its first vibration"
    )
    if factor.not_stated:
        say(
            f"not in that: {', '.join(factor.not_stated)}, which the specimen does not "
            "state",
            err=True,
        )
