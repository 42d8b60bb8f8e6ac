"""Claims on the material: what was mixed, and what it should give."""

from __future__ import annotations

import numpy as np

from ... import sim
from ..recipe.material import POWDER_T, Mixture
from .finding import Finding
from .probe import fit_standoff, read_probe_csv

RIGID_SHARES = {"2:1": 1.0 / 3.0, "5:1": 1.0 / 6.0, "6:1": 1.0 / 7.0}
"""Weight of the rigid PCL in the mixture of soft and rigid, from root to tip."""


def standoff() -> list[Finding]:
    """Compare the magnetisations of rods of one material and three sides."""
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


def one_recipe() -> list[Finding]:
    """Compare the magnetisations of the rods that were mixed alike."""
    values = np.array([sim.gmc(number).remanence_mT for number in (2, 6, 7)])
    scatter = 100.0 * float(np.std(values, ddof=1) / np.mean(values))
    return [
        Finding(
            claim="GMC 2, 6 and 7 are of one recipe and one side",
            evidence=f"they read {', '.join(f'{value:g}' for value in values)} mT: "
            f"{scatter:.1f} % scatter. Moduli follow the remanence one to one, so each "
            "is unsure by as much, which is stated nowhere",
            verdict="matters" if scatter > 2.0 else "negligible",
            value=scatter,
        )
    ]


def filler() -> list[Finding]:
    """Compare magnetisations with the volume of magnetic powder."""
    powders = (200.0, 150.0, 100.0)
    shares = np.array([
        Mixture(soft_per_rigid=5.0, ndfeb_percent=powder).volume_share
        for powder in powders
    ])  # fmt: skip
    read = np.array([sim.gmc(number).remanence_mT for number in (2, 4, 5)])
    off = 100.0 * float(np.max(np.abs(read / read[0] / (shares / shares[0]) - 1.0)))
    expected_mT = 1e3 * POWDER_T * shares[0]
    listed = "/".join
    return [
        Finding(
            claim="200, 150 and 100 % NdFeB by weight read 20.07, 19.71 and 16.18 mT",
            evidence=f"by volume that is {listed(f'{s:.3f}' for s in shares)}, so "
            f"remanences of {listed(f'{s / shares[0]:.2f}' for s in shares)}; the "
            f"paper reads {listed(f'{r / read[0]:.2f}' for r in read)}. With a powder "
            f"of {POWDER_T:g} T the first would have about {expected_mT:.0f} mT, "
            f"{expected_mT / read[0]:.0f} times what is read: the readings are rather "
            "flux densities of a probe beside the rod than remanences",
            verdict="supports" if off > 10.0 else "reproduced",
            value=expected_mT,
        )
    ]


def mixing() -> list[Finding]:
    """Fit a linear and a logarithmic law of mixing to the moduli of the sections."""
    E_MPa = np.array([section.E_MPa for section in sim.gmc(2).sections])
    share = np.array(list(RIGID_SHARES.values()))
    columns = np.column_stack([1.0 - share, share])
    linear = columns @ np.linalg.lstsq(columns, E_MPa, rcond=None)[0]
    logs = columns @ np.linalg.lstsq(columns, np.log(E_MPa), rcond=None)[0]
    off = float(np.max(np.abs(linear / E_MPa - 1.0)))
    listed = "/".join
    return [
        Finding(
            claim="2:1, 5:1 and 6:1 of soft and rigid PCL have 20, 15 and 10 MPa",
            evidence="the share of rigid PCL is "
            f"{listed(f'{s:.3f}' for s in share)}: 5:1 and 6:1 are nearly one "
            "material. The best linear law of mixing, any soft and any rigid PCL "
            "allowed, gives "
            f"{listed(f'{e:.0f}' for e in linear)} MPa, the best logarithmic one "
            f"{listed(f'{e:.0f}' for e in np.exp(logs))} MPa",
            verdict="differs" if off > 0.1 else "reproduced",
            value=100.0 * off,
        )
    ]
