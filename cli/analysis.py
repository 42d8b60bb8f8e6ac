"""``magbend analysis``."""

from __future__ import annotations

from .console import group

app = group(
    "analysis",
    "Compare, fit, report, train, search and design.",
    "magbend analysis report runs/gmc2",
)
