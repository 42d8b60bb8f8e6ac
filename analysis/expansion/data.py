"""What the expansion model is trained and tested on: 84 solved shapes, three splits.

The truth is the rod solver in a uniform field at 90 deg; the target is the best a of
y = a x^2 of each shape, as in the paper. Sides are the remeasured 1.30, 0.97, 0.80 mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.errors import SolverError
from ...core.specimen import Specimen
from ...sim import UniformField, gmc, solve
from ..compare.metrics import quadratic_fit

Array = NDArray[np.float64]

FIELDS_MT = tuple(range(10, 130, 10))
GMC_NUMBERS = tuple(range(1, 8))
SPLITS = ("field", "top_field", "specimen")
"""Random field of each GMC held out (the paper's), 120 mT of all, one whole GMC."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingSet:
    """Solved cases, GMC by GMC, fields rising.

    Parameters
    ----------
    inputs : ndarray, shape (84, 8)
        In the order of `expansion.INPUTS`.
    a_per_mm : ndarray, shape (84,)
        Best a of y = a x^2.
    misfit_mm : ndarray, shape (84,)
        RMS of the solved shape about that parabola.
    tip_x_mm : ndarray, shape (84,)
        x of the solved tip: an error in a costs its square at the tip.
    """

    inputs: Array
    a_per_mm: Array
    misfit_mm: Array
    tip_x_mm: Array


def inputs_of(specimen: Specimen, flux_mT: float) -> list[float]:
    """Return the eight inputs of a specimen of three sections in a field."""
    moduli = [section.E_MPa for section in specimen.sections]
    lengths = [section.length_mm for section in specimen.sections]
    return [flux_mT, *moduli, *lengths, specimen.side_mm]


def training_set() -> TrainingSet:
    """Solve the seven GMCs at the twelve fields of the paper."""
    inputs, targets = [], []
    for number in GMC_NUMBERS:
        specimen = gmc(number, remeasured=True)
        for flux_mT in FIELDS_MT:
            shape = solve(specimen, UniformField(flux_mT=float(flux_mT))).centreline
            if shape is None:
                raise SolverError(
                    f"{specimen.name} at {flux_mT} mT has no solved shape"
                )
            inputs.append(inputs_of(specimen, float(flux_mT)))
            targets.append((*quadratic_fit(shape.points_mm), shape.tip_mm[0]))
    a, misfit, tip_x = np.array(targets).T
    return TrainingSet(
        inputs=np.array(inputs), a_per_mm=a, misfit_mm=misfit, tip_x_mm=tip_x
    )


def held_out(split: str, seed: int) -> NDArray[np.bool_]:
    """Return which of the 84 cases a split keeps for testing.

    Parameters
    ----------
    split : {"field", "top_field", "specimen"}
        ``field``: one random field of each GMC (77 train, 7 test: the paper's split).
        ``top_field``: 120 mT of each GMC. ``specimen``: all fields of one GMC, which
        goes round with the seed, so that seven seeds leave out each GMC once.
    seed : int

    Returns
    -------
    ndarray, shape (84,), bool
    """
    out = np.zeros((len(GMC_NUMBERS), len(FIELDS_MT)), dtype=np.bool_)
    if split == "field":
        chosen = np.random.default_rng(seed).integers(len(FIELDS_MT), size=len(out))
        out[np.arange(len(out)), chosen] = True
    elif split == "top_field":
        out[:, -1] = True
    else:
        out[seed % len(out)] = True
    return out.ravel()
