"""``magbend sim magnet``: the remanence from Tesla-meter readings, and field maps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import print_json, say
from .sim_case import Json

if TYPE_CHECKING:
    from ..sim import MagnetFit

EXAMPLE = "Example: magbend sim magnet readings.csv --map field.svg"
STRONGEST_T = 1.5


def magnet(
    readings: Annotated[
        Path | None,
        typer.Argument(help="CSV: gap_mm,flux_mT[,sd_mT]. Without: the paper's three."),
    ] = None,
    side_mm: Annotated[
        float | None, typer.Option(help="Side of the cube, in mm; 55 by default.")
    ] = None,
    sides_mm: Annotated[
        tuple[float, float, float] | None,
        typer.Option(help="Three sides instead, the last along the polarisation."),
    ] = None,
    free_offset: Annotated[
        bool, typer.Option("--free-offset", help="Fit the probe's offset too.")
    ] = False,
    tolerance_percent: Annotated[
        float, typer.Option(help="How far a reading may be off, in percent.")
    ] = 1.0,
    field_map: Annotated[
        Path | None, typer.Option("--map", help="Draw the field (SVG, PDF, PNG).")
    ] = None,
    as_json: Json = False,
) -> None:
    """Fit a magnet's remanence to readings on its axis, and judge each reading."""
    from ..sim import fit_magnet, paper_readings, read_readings

    if side_mm is not None and sides_mm is not None:
        raise typer.BadParameter("give either --side-mm of a cube or --sides-mm")
    sides = sides_mm or (55.0 if side_mm is None else side_mm,) * 3
    printed: list[dict[str, float]] = []
    if readings is None:
        paper = paper_readings()
        gaps_mm = [reading.gap_mm for reading in paper]
        flux_mT = [reading.flux_mT for reading in paper]
        sd_mT = None
        if sides == (55.0, 55.0, 55.0):
            printed = [
                {
                    "printed_T": reading.printed_T,
                    "flux_needed_mT": reading.flux_needed_mT,
                    "remanence_T": reading.remanence_T,
                }
                for reading in paper
            ]
    else:
        gaps_mm, flux_mT, sd_mT = read_readings(readings)
    fit = fit_magnet(
        gaps_mm,
        flux_mT,
        sides_mm=sides,
        sd_mT=sd_mT,
        free_offset=free_offset,
        tolerance_percent=tolerance_percent,
    )
    if field_map is not None:
        from ..core.files import output_file
        from ..sim import draw_field_map

        output_file(field_map)
        draw_field_map(field_map, sides_mm=sides, remanence_T=fit.remanence_T)
    if as_json:
        print_json(_plain(fit) | ({"paper": printed} if printed else {}))
    else:
        _print(fit, printed)


def _plain(fit: MagnetFit) -> dict[str, Any]:
    from dataclasses import asdict

    return asdict(fit)


def _print(fit: MagnetFit, printed: list[dict[str, float]]) -> None:
    say("gap_mm  flux_mT  remanence_T  predicted_mT  residual_%  verdict")
    for reading in fit.readings:
        say(
            f"{reading.gap_mm:6.2f}  {reading.flux_mT:7.2f}  "
            f"{reading.remanence_T:11.4f}  "
            f"{reading.predicted_mT:12.2f}  {reading.residual_percent:+10.1f}  "
            f"{reading.verdict}"
        )
    spread = ""
    if fit.remanence_sd_T == fit.remanence_sd_T:
        spread = f" +- {fit.remanence_sd_T:.4f}"
    chi2 = " (no reading left over to say how well they agree)"
    if fit.chi2_reduced == fit.chi2_reduced:
        low_T, high_T = fit.remanence_95_T
        chi2 = f", 95 % from {low_T:.4f} to {high_T:.4f} T "
        chi2 += f"(reduced chi2 {fit.chi2_reduced:.3g})"
    say(f"one remanence for all: {fit.remanence_T:.4f}{spread} T{chi2}")
    if fit.birge_ratio > 1.0:
        say(
            f"the readings scatter {fit.birge_ratio:.2g} times as much as their sd_mT "
            "says: the uncertainty is widened by that (Birge ratio)"
        )
    if fit.offset_sd_mm:
        say(f"probe offset: {fit.offset_mm:.2f} +- {fit.offset_sd_mm:.2f} mm")
    if abs(fit.remanence_T) > STRONGEST_T:
        say(
            f"{fit.remanence_T:.2f} T is more than any NdFeB magnet has "
            f"({STRONGEST_T:g} T): the readings, the gaps or the sides are wrong"
        )
    for reading, row in zip(fit.readings, printed, strict=False):
        agrees = round(row["remanence_T"], 4) == row["printed_T"]
        say(
            f"paper at {reading.gap_mm:g} mm: prints {row['printed_T']:.4f} T, "
            + (
                "which its reading gives"
                if agrees
                else f"but {reading.flux_mT:g} mT gives {row['remanence_T']:.4f} T; "
                f"{row['flux_needed_mT']:.2f} mT would be needed"
            )
        )
