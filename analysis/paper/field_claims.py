"""Claims on the magnet, its readings and its field."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import least_squares

from ... import sim
from ...core.magnet import Magnet
from ...sim import axis_flux_by_integral_mT
from .finding import CUBE, READINGS, Finding, tip_y_mm

READING_SD_MT = 0.5
"""Of a reading that is printed in whole mT, by a probe held by hand."""

STRONGEST_T = 1.5
"""No sintered magnet has more remanence."""


def printed_remanences() -> list[Finding]:
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


def contradiction() -> list[Finding]:
    """Look for one cause that lets the three readings come from one magnet."""
    gaps, fluxes, _ = (np.array(column) for column in zip(*READINGS, strict=True))

    def axis_mT(remanence_T: float, farther_mm: float = 0.0) -> np.ndarray:
        tip = np.array([[30.0, 0.0, 0.0]])
        cube = Magnet.cube(55.0, remanence_T)
        return np.array([
            np.linalg.norm(
                sim.magnet_flux_mT(cube, tip, length_mm=30.0, gap_mm=gap + farther_mm)
            )
            for gap in gaps
        ])  # fmt: skip

    def best(free: bool, by_gap: bool) -> tuple[np.ndarray, np.ndarray, float]:
        def rows(u: np.ndarray) -> np.ndarray:
            other = u[1] if free else 0.0
            model = axis_mT(u[0], other) if by_gap else axis_mT(u[0]) + other
            return np.asarray((fluxes - model) / READING_SD_MT)

        found = least_squares(rows, [1.3, 0.0][: 1 + free])
        slopes = np.asarray(found.jac)
        sd = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
        return found.x, sd, float(2.0 * found.cost)

    alone, _, chi2 = best(False, True)
    gap, gap_sd, gap_chi2 = best(True, True)
    zero, zero_sd, zero_chi2 = best(True, False)
    return [
        Finding(
            claim="38, 50 and 66 mT at 70, 60 and 50 mm are readings of one magnet",
            evidence=f"one remanence ({alone[0]:.3f} T) leaves chi2 {chi2:.1f} (2 "
            f"degrees of freedom, {READING_SD_MT:g} mT a reading). A gap that is "
            f"{gap[1]:.1f} +- {gap_sd[1]:.1f} mm longer than stated would explain them "
            f"(chi2 {gap_chi2:.1f}), but with {gap[0]:.2f} T, which no magnet has; a "
            f"Tesla-meter that reads {zero[1]:+.1f} +- {zero_sd[1]:.1f} mT in no field "
            f"would too (chi2 {zero_chi2:.1f}, {zero[0]:.2f} T, a weak magnet). A "
            "probe that saturates or a third reading that is a slip is as likely",
            verdict="differs" if chi2 > 9.2 and gap[0] > STRONGEST_T else "reproduced",
            value=float(gap[1]),
        )
    ]


def uniform_field() -> list[Finding]:
    """Compare the uniform field with the cube's, both signs of the magnetisation."""
    rod = sim.gmc(2)
    worst: list[float] = []
    parts = []
    for gap_mm, _, _ in READINGS:
        tip = np.array([[rod.length_mm, 0.0, 0.0]])
        flux = sim.magnet_flux_mT(CUBE, tip, length_mm=rod.length_mm, gap_mm=gap_mm)[0]
        flux_mT = float(np.linalg.norm(flux))
        uniform = tip_y_mm(rod, sim.UniformField(flux_mT=flux_mT))
        true = tip_y_mm(rod, sim.MagnetField(magnet=CUBE, gap_mm=gap_mm))
        turned = Magnet.cube(55.0, -1.305)
        toward = -tip_y_mm(rod, sim.MagnetField(magnet=turned, gap_mm=gap_mm))
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


def end_face_share(
    *, side_mm: float = 1.0, length_mm: float = 30.0, nodes: int = 16
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


def end_face() -> list[Finding]:
    """Return how much of the load the traction on the end face carries."""
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
