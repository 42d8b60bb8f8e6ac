"""The paper's own numbers, checked: a claim, what we compute, and a verdict.

Verdicts are computed when asked for, from the packaged Table 1 and readings, never
pasted. ``reproduced``: the number comes out. ``differs``: it does not. ``matters``: an
effect that was left out is not small. ``supports``: evidence for a reading of a number
that the paper does not give.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ... import sim
from ...core.files import write_text
from ...core.magnet import Magnet
from ...core.units import GRAVITY_M_PER_S2, MU0
from ...sim.magnet.fit import axis_flux_by_integral_mT
from .probe import fit_standoff, read_probe_csv

READINGS = ((70.0, 38.0, 1.3578), (60.0, 50.0, 1.3050), (50.0, 66.0, 1.2938))
"""Gap in mm, flux density in mT and the remanence in T that the paper prints for it."""

DENSITY_KG_M3 = 2640.0
"""Of NdFeB (7500) and PCL (1145) mixed 2:1 by weight without voids; the paper gives
none: 3 / (2 / 7500 + 1 / 1145) = 2632."""

CUBE = Magnet.cube(55.0, 1.305)


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One number of the paper and what became of it.

    Attributes
    ----------
    claim : str
        What the paper says or assumes.
    evidence : str
        What we compute, with numbers and units.
    verdict : {"reproduced", "differs", "matters", "negligible", "supports"}
    value : float
        The number that decides.
    """

    claim: str
    evidence: str
    verdict: str
    value: float

    def as_dict(self) -> dict[str, Any]:
        """Return the finding for a machine."""
        return asdict(self)


def audit_paper() -> tuple[Finding, ...]:
    """Check the paper's numbers one by one."""
    checks: Sequence[Callable[[], Sequence[Finding]]] = (
        _remanence, _standoff, _uniform_field, _weight, _end_face, _degeneracy,
        _parabola,
    )  # fmt: skip
    return tuple(finding for check in checks for finding in check())


def _remanence() -> list[Finding]:
    """Invert the paper's Eqs. 1-4, integrated numerically, for each reading."""
    findings = []
    for gap_mm, flux_mT, printed_T in READINGS:
        per_T = axis_flux_by_integral_mT(1.0, gap_mm)
        remanence_T = flux_mT / per_T
        same = abs(remanence_T - printed_T) < 0.5e-4 + 1e-12
        needed = (
            "" if same else f"; {printed_T} T would need {printed_T * per_T:.2f} mT"
        )
        findings.append(
            Finding(
                claim=f"{flux_mT:g} mT at {gap_mm:g} mm means {printed_T:.4f} T",
                evidence="Eqs. 1-4 for a cube of 55 mm give "
                f"{remanence_T:.4f} T{needed}",
                verdict="reproduced" if same else "differs",
                value=remanence_T,
            )
        )
    return findings


def _standoff() -> list[Finding]:
    found = fit_standoff(*read_probe_csv(None))
    worst = float(np.abs(found.residual_percent).max())
    better = found.rms_percent < 0.2 * found.constant_percent
    return [
        Finding(
            claim="25.07, 20.07 and 14.59 mT are the magnetisation of GMC 1, 2 and 3, "
            "rods of one material",
            evidence=f"they grow as side^{found.power:.2f}, and one remanence misses "
            f"them by {found.constant_percent:.0f} % (RMS); a probe "
            f"{found.standoff_mm:.2f} mm from the face of a rod of "
            f"{found.remanence_mT:.0f} mT reads them within {worst:.1f} %. Two "
            "unknowns for three readings are no proof; if they are probe readings, "
            "remanence and moduli are both about "
            f"{found.remanence_mT / 20.07:.1f} times larger",
            verdict="supports" if better else "differs",
            value=found.remanence_mT,
        )
    ]


def _tip(specimen: Any, field: Any, support: sim.Support | None = None) -> float:
    solution = sim.solve(specimen, field, support=support or sim.Support())
    return solution.centreline.tip_mm[1] if solution.centreline else math.nan


def _uniform_field() -> list[Finding]:
    """Compare the uniform field with the cube's, both signs of the magnetisation."""
    rod = sim.gmc(2)
    worst: list[float] = []
    parts = []
    for gap_mm, _, _ in READINGS:
        tip = np.array([[rod.length_mm, 0.0, 0.0]])
        flux = sim.magnet_flux_mT(CUBE, tip, length_mm=rod.length_mm, gap_mm=gap_mm)[0]
        flux_mT = float(np.linalg.norm(flux))
        uniform = _tip(rod, sim.UniformField(flux_mT=flux_mT))
        true = _tip(rod, sim.MagnetField(magnet=CUBE, gap_mm=gap_mm))
        turned = Magnet.cube(55.0, -1.305)
        toward = -_tip(rod, sim.MagnetField(magnet=turned, gap_mm=gap_mm))
        away, to = 100.0 * (true / uniform - 1.0), 100.0 * (toward / uniform - 1.0)
        worst += [away, to]
        parts.append(f"{gap_mm:g} mm: {away:+.1f} % and {to:+.1f} %")
    largest = max(worst, key=abs)
    return [
        Finding(
            claim="a uniform field is a reasonable hypothesis for the simulation",
            evidence="deflection of GMC 2's tip before a cube of 55 mm against that in "
            "the uniform field of the same flux at the undeformed tip, bending away "
            f"from and toward the magnet: {'; '.join(parts)}",
            verdict="matters" if abs(largest) > 5.0 else "negligible",
            value=largest,
        )
    ]


def _weight() -> list[Finding]:
    from dataclasses import replace

    rod = replace(sim.gmc(2), density_kg_m3=DENSITY_KG_M3)
    area_m2 = (rod.side_mm * 1e-3) ** 2
    weight_N = DENSITY_KG_M3 * area_m2 * GRAVITY_M_PER_S2 * rod.length_mm * 1e-3
    magnetic_N = area_m2 * rod.remanence_mT * 1e-3 / MU0 * 50e-3
    field = sim.UniformField(flux_mT=50.0)
    bare = _tip(rod, field)
    down = sim.Support(gravity_m_s2=(0.0, -GRAVITY_M_PER_S2, 0.0))
    change = 100.0 * (_tip(rod, field, down) / bare - 1.0)
    return [
        Finding(
            claim="the rod's weight is left out",
            evidence=f"weight {weight_N * 1e3:.2f} mN against a magnetic load of "
            f"{magnetic_N * 1e3:.2f} mN at 50 mT (density {DENSITY_KG_M3:g} kg/m3, "
            f"estimated); if it acts in the plane of bending, which the paper does not "
            f"say, it moves the tip by {change:+.0f} %",
            verdict="matters" if abs(change) > 5.0 else "negligible",
            value=change,
        )
    ]


def end_face_share(
    *, side_mm: float = 1.0, length_mm: float = 30.0, nodes: int = 48
) -> float:
    """Return the Maxwell traction's force on the tip face over the whole M A B.

    Notes
    -----
    A bar magnetised along x in a uniform field B across it. On the face the traction is
    t = [(B.n) B - B^2 n / 2] / mu0 with B the sum of the bar's own field and B; the
    part across the bar that is linear in B is B_n B / mu0. The own normal field comes
    from the two charged faces, whose surface charge also makes it jump by the remanence
    across the face; outside it is B_r / 2 from the face itself plus the far face's
    share. Its average over the face times A B / mu0 over M A B = B_r A B / mu0 is the
    share. The far face's share is integrated by Gauss-Legendre rules.
    """
    t, w = np.polynomial.legendre.leggauss(nodes)
    y, weight = 0.5 * side_mm * t, 0.5 * w
    dy = y[:, None] - y[None, :]
    pair = weight[:, None] * weight[None, :]
    # Average over the tip face of the far face's normal flux density over B_r: the
    # charge -1 on the far face at distance L, points and sources both on the nodes.
    square = dy**2
    r2 = square[:, :, None, None] + square[None, None, :, :] + length_mm**2
    kernel = length_mm / (4.0 * math.pi * r2**1.5)
    both = pair[:, :, None, None] * pair[None, None, :, :]
    far = float(np.sum(both * kernel)) * side_mm**2
    return 0.5 - far


def _end_face() -> list[Finding]:
    share = end_face_share()
    return [
        Finding(
            claim="the Maxwell tensor is applied at the end of the top section",
            evidence=f"the traction on the end face alone carries {share:.4f} of the "
            "load M A B on a bar of 1 x 1 x 30 mm; the rest acts on the sides near the "
            "tip. If it was applied to the face only, which the paper does not settle, "
            "the load and the moduli fitted with it are half",
            verdict="matters" if share < 0.9 else "negligible",
            value=share,
        )
    ]


def _degeneracy() -> list[Finding]:
    from dataclasses import replace

    rod = sim.gmc(2)
    factor = 5.0
    sections = tuple(replace(s, E_MPa=factor * s.E_MPa) for s in rod.sections)
    other = replace(rod, remanence_mT=factor * rod.remanence_mT, sections=sections)
    field = sim.UniformField(flux_mT=50.0)
    a, b = (sim.solve(r, field).centreline for r in (rod, other))
    difference_mm = (
        float(np.max(np.abs(a.points_mm - b.points_mm))) if a and b else math.nan
    )
    return [
        Finding(
            claim="moduli of 20-15-10 MPa follow from fitting the bent shapes",
            evidence=f"{factor:g} times the moduli with {factor:g} times the remanence "
            f"give the same shapes within {difference_mm:.1g} mm: only the ratio "
            "follows, so the moduli are as good as the remanence",
            verdict="matters" if difference_mm < 1e-6 else "negligible",
            value=difference_mm,
        )
    ]


def _parabola() -> list[Finding]:
    from ..compare.metrics import quadratic_fit

    worst = 0.0
    for number in range(1, 8):
        line = sim.solve(sim.gmc(number), sim.UniformField(flux_mT=66.0)).centreline
        if line is None:
            continue
        a, _ = quadratic_fit(line.points_mm)
        worst = max(worst, float(np.max(np.abs(line.y_mm - a * line.x_mm**2))))
    return [
        Finding(
            claim="the bent shape follows y = a x^2",
            evidence="the best parabola misses the solved shapes of GMC 1 to 7 at "
            f"66 mT by up to {worst:.2f} mm",
            verdict="matters" if worst > 0.05 else "negligible",
            value=worst,
        )
    ]


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
