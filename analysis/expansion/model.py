"""The expansion model of the paper, ready to predict: numpy only, no pickle.

A multi-branch network takes flux density, three moduli, three unit lengths and the side
of the cross-section, and answers a of y = a x^2 (the paper's Trajectory equation,
section V). Each branch is one fully connected layer with ReLU, then normalised over its
units; the four are concatenated, go through a fusion layer with ReLU, and the output
layer gives a in units of `target_scale_per_mm`.

The remanence is *not* an input, as in the paper: the network has silently learnt the
remanence of each trained specimen. `outside` says when a question leaves what it knows.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import positive
from ...core.errors import InputError
from .model_file import DAMAGE, damaged, read_model, write_model

Array = NDArray[np.float64]

INPUTS = (
    "flux_mT",
    "E_MPa[0]", "E_MPa[1]", "E_MPa[2]",
    "length_mm[0]", "length_mm[1]", "length_mm[2]",
    "side_mm",
)  # fmt: skip
"""The eight inputs, in this order; sections root first."""

BRANCHES = {
    "field": slice(0, 1),
    "moduli": slice(1, 4),
    "lengths": slice(4, 7),
    "side": slice(7, 8),
}
"""The four branches and the inputs they take."""

NORM_EPSILON = 1e-5
_SCHEMA = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpansionModel:
    """A trained expansion model with the card that says where it may be used.

    Parameters
    ----------
    weights : dict of ndarray
        ``<branch>.weight (i, h)``, ``.bias``, ``.gain``, ``.shift (h,)`` for the four
        branches; ``fusion.weight (4 h, f)``, ``fusion.bias``, ``output.weight (f, 1)``,
        ``output.bias (1,)``.
    mean, scale : ndarray, shape (8,)
        Inputs are standardised as (input - mean) / scale.
    target_scale_per_mm : float
        The network's output is a in this unit.
    card : dict
        The model card: data, units, splits, errors, domain.
    """

    weights: dict[str, Array]
    mean: Array
    scale: Array
    target_scale_per_mm: float
    card: dict[str, Any]


def predict(model: ExpansionModel, inputs: ArrayLike) -> Array:
    """Return a of y = a x^2, in 1/mm.

    Parameters
    ----------
    model : ExpansionModel
    inputs : array_like, shape (n, 8) or (8,)
        In the order of `INPUTS`.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    InputError
        If the shape is wrong, or a value is not a finite number above zero.
    """
    rows = _rows(inputs)
    z = (rows - model.mean) / model.scale
    w = model.weights
    parts = []
    for name, columns in BRANCHES.items():
        h = np.maximum(z[:, columns] @ w[f"{name}.weight"] + w[f"{name}.bias"], 0.0)
        h = (h - h.mean(axis=1, keepdims=True)) / np.sqrt(
            h.var(axis=1, keepdims=True) + NORM_EPSILON
        )
        parts.append(h * w[f"{name}.gain"] + w[f"{name}.shift"])
    fused = np.concatenate(parts, axis=1) @ w["fusion.weight"] + w["fusion.bias"]
    out = np.maximum(fused, 0.0) @ w["output.weight"] + w["output.bias"]
    answer: Array = out[:, 0] * model.target_scale_per_mm
    return answer


def outside(model: ExpansionModel, inputs: ArrayLike) -> list[str]:
    """Return one sentence for each way in which a design leaves the trained domain.

    Parameters
    ----------
    model : ExpansionModel
    inputs : array_like, shape (8,)

    Returns
    -------
    list of str
        Empty where the design is one of the trained specimens, within the range of
        trained fields.
    """
    row = _rows(inputs)[0]
    domain = model.card["domain"]
    sentences = []
    for name, value in zip(INPUTS, row, strict=True):
        low, high = domain["range"][name]
        if not low - 1e-9 <= value <= high + 1e-9:
            sentences.append(
                f"{name} = {value:g} is outside the trained range {low:g} to {high:g}: "
                "the answer is an extrapolation"
            )
    trained = np.array(domain["designs"])
    if not np.any(np.all(np.isclose(trained, row[1:], rtol=1e-6), axis=1)):
        error = model.card["errors"]["specimen"]["median_tip_error_mm"]
        sentences.append(
            "this is none of the trained specimens: on a specimen it had not seen the "
            f"network missed the tip by {error:.2g} mm (median), and it does not know "
            "the remanence; prefer `magbend sim shape`"
        )
    return sentences


def _rows(inputs: ArrayLike) -> Array:
    rows = np.atleast_2d(np.asarray(inputs, dtype=np.float64))
    if rows.ndim != 2 or rows.shape[1] != len(INPUTS):
        raise InputError(
            f"inputs must have {len(INPUTS)} columns ({', '.join(INPUTS)}); "
            f"instead received shape {np.shape(inputs)}"
        )
    for name, column in zip(INPUTS, rows.T, strict=True):
        for value in column[~(np.isfinite(column) & (column > 0.0))][:1]:
            positive(float(value), name)
    return rows


def save(model: ExpansionModel, path: Path) -> None:
    """Write a model to one ``.npz`` file (arrays and a JSON card, no pickle)."""
    arrays: dict[str, Any] = {
        f"weights/{name}": value for name, value in model.weights.items()
    }
    arrays |= {"mean": model.mean, "scale": model.scale, "schema": np.int64(_SCHEMA)}
    arrays["target_scale_per_mm"] = np.float64(model.target_scale_per_mm)
    write_model(path, arrays, model.card)


def load(path: Path | None = None) -> ExpansionModel:
    """Read a model; the packaged one, trained on the seven GMCs, without a path.

    Raises
    ------
    StoreError
        If the file is missing, damaged, or no expansion model.
    """
    source = path or Path(str(files("magbend.analysis") / "data" / "expansion.npz"))
    try:
        arrays, card = read_model(source)
        if int(arrays["schema"]) != _SCHEMA or "domain" not in card:
            raise ValueError("unknown schema")
        weights = {
            name.removeprefix("weights/"): np.asarray(value, dtype=np.float64)
            for name, value in arrays.items()
            if name.startswith("weights/")
        }
        model = ExpansionModel(
            weights=weights,
            mean=np.asarray(arrays["mean"], dtype=np.float64),
            scale=np.asarray(arrays["scale"], dtype=np.float64),
            target_scale_per_mm=float(arrays["target_scale_per_mm"]),
            card=card,
        )
        predict(model, model.mean)  # the arrays fit each other
    except DAMAGE as error:
        way_out = "magbend analysis train --out FILE"
        raise damaged(source, "expansion model", error, way_out) from None
    return model
