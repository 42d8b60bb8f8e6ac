"""Tell from the magnet in which unit the readings and gaps of a table are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.errors import ConfigError
from ...core.magnet import Magnet
from ...sim import axis_share
from .steps import StepRow

Array = NDArray[np.float64]

FARTHEST = 4.0
"""Factor between readings and magnet beyond which no magnet or probe is so far off."""

ALIKE, EVEN = 1.6, 1.3
"""Factors within which another unit explains them: of the middle, of all rows to it."""

HEADS = {
    "flux (G)": (1.0, 0.1), "flux (T)": (1.0, 1e3), "flux (uT)": (1.0, 1e-3),
    "gap (cm)": (10.0, 1.0), "gap (in)": (25.4, 1.0), "gap (m)": (1e3, 1.0),
    "gap (um)": (1e-3, 1.0),
}  # fmt: skip
"""By the head it should have: factors of gap and flux."""


def check_field_unit(table: Path, rows: Sequence[StepRow], magnet: Magnet) -> None:
    """Refuse readings that the magnet cannot give at these gaps.

    Raises
    ------
    ConfigError
        It names the head with which they would fit, if there is one.
    """
    both = np.array([(row.gap_mm, abs(row.flux_mT)) for row in rows]).reshape(-1, 2)
    gaps, flux = both[np.all(np.isfinite(both), axis=1) & (both[:, 1] > 0.0)].T
    if not len(gaps):
        return
    ratio = float(np.exp(np.median(_log_ratios(gaps, flux, magnet))))
    if 1.0 / FARTHEST < ratio < FARTHEST:
        return
    fits = {}
    for head, (of_gap, of_flux) in HEADS.items():
        logs = _log_ratios(of_gap * gaps, of_flux * flux, magnet)
        middle = float(np.median(logs))
        uneven = float(np.max(np.abs(logs - middle)))
        if abs(middle) < np.log(ALIKE) and uneven < np.log(EVEN):
            fits[head] = abs(middle) + uneven
    said = (
        f"{table}: its readings are {ratio:.3g} times what the magnet gives at these "
        "gaps"
    )
    if fits:
        head = min(fits, key=fits.__getitem__)
        raise ConfigError(f"{said}, and fit as {head}: if it is so, head the column so")
    raise ConfigError(
        f"{said}: look at the magnet, at the gaps (from its N face to the tip) and at "
        "the units in the heads"
    )


def _log_ratios(gaps_mm: Array, flux_mT: Array, magnet: Magnet) -> Array:
    """Return log of readings over what the magnet gives on its axis."""
    share = np.array([float(axis_share(gap, magnet.sides_mm)) for gap in gaps_mm])
    return np.asarray(np.log(flux_mT / np.abs(1e3 * magnet.remanence_T * share)))
