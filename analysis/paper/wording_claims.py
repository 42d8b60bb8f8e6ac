"""Words and counts of the paper that do not agree with each other."""

from __future__ import annotations

import math

from ... import sim
from ...sim import axis_flux_by_integral_mT
from .finding import CUBE, Finding

EARLIER_RANGE_MPA = (8.0, 50.0)
"""The range of moduli that the paper takes from its own earlier work."""

MSE = 2.089e-7


def wording() -> list[Finding]:
    """Check words, counts and equations against each other."""
    return [_range(), _section(), _counts(), _equations(), _mse(), _table_head()]


def _range() -> Finding:
    moduli = [section.E_MPa for n in range(1, 8) for section in sim.gmc(n).sections]
    low, high = EARLIER_RANGE_MPA
    return Finding(
        claim=f"moduli of the material lie within {low:g} to {high:g} MPa",
        evidence=f"those fitted go from {min(moduli):g} to {max(moduli):g} MPa",
        verdict="differs" if min(moduli) < low else "reproduced",
        value=min(moduli),
    )


def _section() -> Finding:
    # E I / A is what a field shows: a^2 / 12 for a square, d^2 / 16 for a circle.
    change = 100.0 * (16.0 / 12.0 - 1.0)
    return Finding(
        claim="'outer diameters' of the moulds in the text, 'side length' in the table",
        evidence=f"a round rod taken for a square one of the same size has "
        f"{change:.0f} % more modulus in truth than is fitted; the paper does not "
        "settle which it is",
        verdict="matters",
        value=change,
    )


def _counts() -> Finding:
    rods, fields, panels = 7, 3, 3
    shapes = rods * fields
    shown = panels * 3 * fields
    return Finding(
        claim="'ten sets of comparison results', 'all 27 sets'",
        evidence=f"{rods} rods at {fields} fields are {shapes} shapes; three panels of "
        f"three rods show {shown} because GMC 2 is in each. Nothing makes ten",
        verdict="differs",
        value=float(shapes),
    )


def _equations() -> Finding:
    per_T = axis_flux_by_integral_mT(1.0, 60.0)
    closed = _axis_mT(60.0)
    return Finding(
        claim="Eqs. 1 to 4",
        evidence="both integrals of Eq. 1 run from the upper to the lower limit, which "
        "cancels; Eq. 3 has (Y0 + y) for (Y0 - y), which by symmetry changes nothing "
        f"on the axis ({per_T:.4f} mT per T at 60 mm, closed form {closed:.4f}), but "
        "would off it; B_r is called a flux density",
        verdict="negligible" if abs(per_T / closed - 1.0) < 1e-6 else "matters",
        value=per_T,
    )


def _axis_mT(gap_mm: float) -> float:
    """Flux density on the axis of the paper's cube per T of remanence."""
    a = CUBE.sides_mm[0]

    def face(z: float) -> float:
        return math.atan2(a * a, 2.0 * z * math.sqrt(4.0 * z * z + 2.0 * a * a))

    return 1e3 * (face(gap_mm) - face(gap_mm + a)) / math.pi


def _mse() -> Finding:
    line = sim.solve(sim.gmc(2), sim.UniformField(flux_mT=66.0)).centreline
    x_mm = line.tip_mm[0] if line else math.nan
    tip_mm = math.sqrt(MSE) * x_mm**2
    return Finding(
        claim=f"a mean squared error of {MSE:g} (no unit)",
        evidence=f"of a in y = a x^2, so in 1/mm^2 at best: its root is {tip_mm:.2f} "
        f"mm at the tip of a rod bent to x = {x_mm:.1f} mm",
        verdict="matters" if tip_mm > 0.1 else "negligible",
        value=tip_mm,
    )


def _table_head() -> Finding:
    return Finding(
        claim="Table 1, first column: 'Cross-section Unit Length'",
        evidence="it holds sides of 0.75 to 1.25 mm; unit lengths are the next column",
        verdict="differs",
        value=math.nan,
    )
