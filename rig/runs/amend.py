"""Correct a reading that was typed wrong, and keep what it had been.

The records of a run are hashed and stay as they are: what was wrong with them is told
beside them, a line a correction, and whoever reads the run gets the last one.
"""

from __future__ import annotations

import getpass
import os
from collections.abc import Sequence
from pathlib import Path

from ...core.checks import finite
from ...core.errors import StoreError
from ...core.seal import seal_of, sealed
from .read import Run, read_lines, read_run
from .records import AMENDMENTS_FILE, RUN_FILE, Record, utc_now
from .witness import Reading, Witness


def amend_flux(
    path: Path, index: int, flux_mT: float, *, reason: str, witness: Witness
) -> Record:
    """Correct the flux density of one step; return what was written.

    Parameters
    ----------
    path : Path
        The run folder.
    index : int
        Which step, from 0.
    flux_mT : float
        What the meter truly showed.
    reason : str
        Why, for whoever reads it later.
    witness : Witness
        Judges it beside the other readings.

    Raises
    ------
    StoreError
        If there is no such step, or the folder cannot be written.
    """
    finite(flux_mT, "flux_mT", "mT")
    run = read_run(path)
    step = next((s for s in run.steps if s["index"] == index), None)
    if step is None:
        raise StoreError(
            f"{path}: has no step {index + 1}; recorded are {_numbers(run)}"
        )
    said = witness.judge(float(step["gap_mm"]), flux_mT, None, _others(run, index))
    record: Record = {
        "time_utc": utc_now(),
        "index": index,
        "was_mT": step.get("flux_mT"),
        "flux_mT": flux_mT,
        "reason": reason,
        "by": getpass.getuser(),
        "field": said.as_dict(),
    }
    _append(path, record)
    return record


def _append(path: Path, record: Record) -> None:
    """Append a line that is chained to the one before, or to ``run.json``."""
    file = path / AMENDMENTS_FILE
    lines = read_lines(file).lines
    try:
        before = lines[-1] if lines else (path / RUN_FILE).read_bytes()
        line = sealed({**record, "after": seal_of(before) or ""})
        with file.open("ab") as opened:
            opened.write(line.encode("utf-8") + b"\n")
            opened.flush()
            os.fsync(opened.fileno())
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from None


def _numbers(run: Run) -> str:
    return ", ".join(str(step["index"] + 1) for step in run.steps) or "none"


def _others(run: Run, index: int) -> Sequence[Reading]:
    return [
        (float(step["gap_mm"]), float(step["flux_mT"]))
        for step in run.steps
        if step["index"] != index and step.get("flux_mT") is not None
    ]
