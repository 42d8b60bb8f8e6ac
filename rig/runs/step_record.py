"""What is written down of one step, and what is said of it."""

from __future__ import annotations

from dataclasses import asdict

from ..meter.protocol import Flux
from ..stage.gap_records import MoveRecord
from .records import Record
from .settle import Settled
from .witness import FLAG, FieldDoubt


def step_flags(
    move: MoveRecord, settled: Settled, flux: Flux, said: FieldDoubt
) -> list[str]:
    """Return a word for every doubt of a step."""
    flags = [FLAG] if said.sentence else []
    if settled.status == "timeout":
        flags.append("settle_timeout")
    if move.approach != "far side":
        flags.append("approach_clipped")
    if flux.status == "none":
        flags.append("no_flux")
    elif flux.status not in ("ok", "manual"):
        flags.append(f"flux_{flux.status}")
    return flags


def flux_record(flux: Flux) -> Record:
    """Return a flux density as a step keeps it."""
    record = asdict(flux)
    return {
        "flux_mT": record["flux_mT"],
        "flux_sd_mT": record["sd_mT"],
        "flux_samples": record["samples"],
        "flux_status": record["status"],
        "flux_raw": list(record["raw"]),
    }


def step_line(record: Record, total: int) -> str:
    """Return a step in one line for the person at the bench."""
    flux_mT = record["flux_mT"]
    flux = f"{flux_mT:.2f} mT" if flux_mT is not None else record["flux_status"]
    doubts = f", {', '.join(record['flags'])}" if record["flags"] else ""
    return (
        f"step {record['index'] + 1} of {total}: gap {record['gap_mm']:g} mm, "
        f"flux {flux}, {record['settle']['status']} after "
        f"{record['settle']['time_s']:.1f} s{doubts}"
    )
