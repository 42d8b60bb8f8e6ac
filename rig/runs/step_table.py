"""``steps.csv``: the steps of a run as a table for people."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

from ...core.text import defused
from .records import Record

COLUMNS = (
    "step", "gap_mm", "stage_mm", "flux_mT", "flux_sd_mT", "flux_samples",
    "flux_status", "settle_status", "settle_s", "flags", "image", "time_utc",
)  # fmt: skip


def step_table(steps: Sequence[Record]) -> str:
    """Return the steps as CSV, one row each; a missing number is an empty cell."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(COLUMNS)
    for step in steps:
        settle = step.get("settle", {})
        files = step.get("files") or [{}]
        writer.writerow(
            defused(cell)
            for cell in (
                step["index"],
                step.get("gap_mm"),
                step.get("stage_mm"),
                step.get("flux_mT"),
                step.get("flux_sd_mT"),
                step.get("flux_samples"),
                step.get("flux_status"),
                settle.get("status"),
                settle.get("time_s"),
                " ".join(step.get("flags", [])),
                files[0].get("path"),
                step.get("time_utc"),
            )
        )
    return buffer.getvalue()
