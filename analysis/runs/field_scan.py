"""What a field scan says about the magnet: remanence, residuals, verdicts, figure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.files import write_bytes
from ...core.magnet import Magnet
from ...core.units import mT_from_T
from ...sim import MagnetFit, axis_share, fit_magnet
from .field_check import FieldVerdict, check_against_magnet


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedScan:
    """A field scan beside the magnet of the rig file.

    Parameters
    ----------
    fit : MagnetFit
        One remanence for all readings.
    verdicts : tuple of FieldVerdict
        Each reading against the remanence that the rig file states.
    figure : Path
        Readings, fitted field and residuals.
    """

    fit: MagnetFit
    verdicts: tuple[FieldVerdict, ...]
    figure: Path

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers for machines."""
        return {
            "remanence_T": self.fit.remanence_T,
            "remanence_sd_T": self.fit.remanence_sd_T,
            "birge_ratio": self.fit.birge_ratio,
            "chi2_reduced": self.fit.chi2_reduced,
            "figure": str(self.figure),
            "readings": [
                {
                    "gap_mm": reading.gap_mm,
                    "flux_mT": reading.flux_mT,
                    "residual_mT": reading.residual_mT,
                    "beside_the_others": reading.verdict,
                    "beside_the_rig_file": verdict.verdict,
                }
                for reading, verdict in zip(
                    self.fit.readings, self.verdicts, strict=True
                )
            ],
        }

    def lines(self) -> list[str]:
        """Return the same for people."""
        fit = self.fit
        widened, sure = "", f" +- {fit.remanence_sd_T:.4f} T"
        if fit.birge_ratio > 1.0:
            widened = f" (sd widened by their Birge ratio {fit.birge_ratio:.2g})"
        if math.isnan(fit.remanence_sd_T):
            sure = ""
        lines = [
            f"remanence {fit.remanence_T:.4f} T{sure} from {len(fit.readings)} "
            f"readings{widened}; put it into [magnet] of the rig file",
            "gap mm   flux mT  fitted mT  residual",
        ]
        for reading in fit.readings:
            doubt = "" if reading.verdict == "ok" else f"  {reading.verdict}"
            lines.append(
                f"{reading.gap_mm:6.1f} {reading.flux_mT:9.3f} "
                f"{reading.predicted_mT:10.3f} {reading.residual_percent:+8.2f} %"
                f"{doubt}"
            )
        doubts = [v.verdict for v in self.verdicts if v.verdict != "ok"]
        lines += [f"against the rig file: {doubt}" for doubt in doubts]
        return lines


def judge_scan(
    path: Path,
    gaps_mm: Sequence[float],
    flux_mT: Sequence[float],
    sd_mT: Sequence[float | None],
    magnet: Magnet,
    *,
    tolerance_percent: float = 1.0,
) -> JudgedScan:
    """Fit the magnet to a scan, hold each reading against it, and draw both.

    Parameters
    ----------
    path : Path
        The ``field.csv``; the figure goes beside it, as ``field.svg``.
    gaps_mm, flux_mT, sd_mT : sequence of float
        Its rows.
    magnet : Magnet
        The magnet of the rig file: its sides, and the remanence to be checked.
    tolerance_percent : float
        How far a reading may be off.

    Raises
    ------
    InputError
        If the readings cannot be fitted: not of one sign, or zero.
    """
    # The mean of n samples is sharper than one, but the probe's place is not.
    known = [sd for sd in sd_mT if sd]
    floor = [0.002 * abs(flux) for flux in flux_mT]
    sd = None
    if len(known) == len(flux_mT):
        sd = [max(one, least) for one, least in zip(known, floor, strict=True)]
    fit = fit_magnet(
        gaps_mm, flux_mT, sides_mm=magnet.sides_mm, sd_mT=sd,
        tolerance_percent=tolerance_percent,
    )  # fmt: skip
    verdicts = check_against_magnet(
        gaps_mm, flux_mT, magnet, sd_mT=sd, tolerance_percent=tolerance_percent
    )
    figure = path.with_suffix(".svg")
    write_bytes(figure, _draw(gaps_mm, flux_mT, sd, fit, magnet))
    return JudgedScan(fit=fit, verdicts=verdicts, figure=figure)


def _draw(
    gaps_mm: Sequence[float],
    flux_mT: Sequence[float],
    sd_mT: Sequence[float] | None,
    fit: MagnetFit,
    magnet: Magnet,
) -> bytes:
    import io

    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with mpl.rc_context({"svg.hashsalt": "magbend", "font.size": 9.0}):
        figure = Figure(figsize=(5.0, 4.2), layout="constrained")
        FigureCanvasSVG(figure)
        above, below = figure.subplots(
            2, 1, sharex=True, gridspec_kw={"height_ratios": [3, 1]}
        )
        fine = np.linspace(min(gaps_mm), max(gaps_mm), 200)
        share = np.asarray(axis_share(fine, magnet.sides_mm))
        above.plot(
            fine, mT_from_T(fit.remanence_T) * share, color="#0072B2",
            label=f"cuboid, {fit.remanence_T:.4f} T",
        )  # fmt: skip
        above.errorbar(
            gaps_mm, flux_mT, yerr=sd_mT, fmt="o", color="#D55E00", label="readings"
        )
        above.set_ylabel("flux density, mT")
        above.legend(frameon=False)
        below.axhline(0.0, color="0.6", linewidth=0.8)
        residual = [-reading.residual_percent for reading in fit.readings]
        below.plot(gaps_mm, residual, "o", color="#D55E00")
        below.set_ylabel("measured minus\nfitted, %")
        below.set_xlabel("gap from the N face, mm")
        buffer = io.BytesIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()
