"""The paper's own numbers, checked: a claim, what we compute, and a verdict.

Verdicts are computed when asked for, from the packaged Table 1 and readings, never
pasted. What they mean says `finding`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from ...core.files import write_text
from . import field_claims, material_claims, rod_claims, wording_claims
from .finding import Finding

CHECKS: tuple[Callable[[], list[Finding]], ...] = (
    rod_claims.circular_bending,
    field_claims.printed_remanences,
    field_claims.contradiction,
    material_claims.standoff,
    material_claims.one_recipe,
    material_claims.filler,
    material_claims.mixing,
    rod_claims.remeasured_sides,
    field_claims.uniform_field,
    rod_claims.weight,
    field_claims.end_face,
    rod_claims.degeneracy,
    rod_claims.parabola,
    wording_claims.wording,
)
"""The paper's first claim first, then the magnet, the material, the rods, the words."""


def audit_paper() -> tuple[Finding, ...]:
    """Check the paper's numbers one by one."""
    return tuple(finding for check in CHECKS for finding in check())


def audit_html(findings: Sequence[Finding]) -> str:
    """Return the findings as an HTML table, for a section of a report."""
    from html import escape

    rows = "".join(
        f"<tr{' class=failed' if f.verdict in ('differs', 'matters') else ''}>"
        f"<td>{escape(f.claim)}</td><td>{escape(f.evidence)}</td>"
        f"<td><strong>{escape(f.verdict)}</strong></td></tr>"
        for f in findings
    )
    return (
        '<div class="wide"><table><thead><tr><th>the paper</th><th>computed here</th>'
        f"<th>verdict</th></tr></thead><tbody>{rows}</tbody></table></div>"
    )


def write_audit(out: Path, findings: Sequence[Finding]) -> None:
    """Write the findings as a page of their own, whole or not at all."""
    css = (Path(__file__).parents[1] / "report" / "report.css").read_text(
        encoding="utf-8"
    )
    write_text(
        out,
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<link rel="icon" href="data:,"><title>The paper, audited</title>'
        f"<style>{css}</style></head><body><h1>The paper, audited</h1>"
        f"{audit_html(findings)}</body></html>\n",
    )
