"""Look at what the demo wrote: whole, self-contained, plausible."""

from __future__ import annotations

import csv
import json
import re
import sys
from pathlib import Path


def check(out: Path) -> None:
    """Raise SystemExit with a sentence if something is missing or implausible."""
    reports = sorted(out.rglob("report.html"))
    demand(reports, f"no report.html below {out}")
    run = reports[0].parent
    html = reports[0].read_text(encoding="utf-8")
    outside = re.findall(r"""(?:src|href)\s*=\s*["'](?:https?:)?//[^"']+""", html)
    demand(not outside, f"the report asks for {outside[:3]}")
    demand("<svg" in html and "data:image/" in html, "no figure or photograph inside")

    end = json.loads((run / "end.json").read_text(encoding="utf-8"))
    demand(end["status"] == "success", f"the run ended with {end}")
    steps = (run / "steps.jsonl").read_text(encoding="utf-8").splitlines()
    demand(len(steps) == 3, f"{len(steps)} steps instead of 3")

    with (run / "comparison.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    demand(len(rows) == 6, f"{len(rows)} comparisons instead of 6")
    for row in rows:
        demand(row["status"] == "ok", f"step {row['step']}: {row['status']}")
        rms_mm = float(row["rms_mm"])
        # The twin's rod differs from the nominal one, so a perfect match is a defect
        # too: it would mean that the simulation was compared with itself.
        demand(0.005 < rms_mm < 2.0, f"step {row['step']}: RMS {rms_mm} mm")
    print(f"demo: {len(steps)} steps, {len(rows)} comparisons, report {reports[0]}")


def demand(condition: object, sentence: str) -> None:
    """Stop with the sentence if the condition does not hold."""
    if not condition:
        raise SystemExit(f"demo check: {sentence}")


if __name__ == "__main__":
    check(Path(sys.argv[1]))
