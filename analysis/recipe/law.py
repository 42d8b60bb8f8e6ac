"""The law of mixing: from ratios to modulus and remanence, with intervals.

    log E = a + b w + c v            w: rigid PCL by weight of all PCL
    log B_r = d + e log v            v: powder by volume

Rods of one recipe differ: a scatter of a whole rod, of each section by itself, and of
the remanence, is estimated along (marginal likelihood). Coefficients have wide
priors where physics gives one: c of a filled polymer, e = 1 of a diluted powder.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass as checked
from scipy.optimize import minimize

from ...core.errors import StoreError
from ...core.files import write_text
from .material import Mixture
from .rods import Rods

Array = NDArray[np.float64]

PRIOR = ((2.0, 3.0), (1.5, 3.0), (4.0, 3.0), (4.0, 3.0), (1.0, 0.5))
"""Mean and standard deviation of each. c: Guth's 1 + 2.5 v + 14.1 v^2 rises by 2.5 v at
first and 6 v at v = 0.2. b: rigid PCL is stiffer, by a factor nobody stated. e: diluted
powder is 1, the paper's readings ask for 0.4."""

SCATTER = 0.05
"""Scale of the prior of each scatter: a hand-mixed batch."""


@checked(frozen=True, kw_only=True, config=ConfigDict(extra="forbid"))
class Law:
    """A fitted law of mixing, as its file keeps it.

    Attributes
    ----------
    coefficients : list of float
        a to e (module docstring).
    covariance : list of list of float
        Of the coefficients.
    rod_scatter, section_scatter, remanence_scatter : float
        Relative standard deviations between rods, between sections of a rod, and of the
        remanence between rods.
    rigid_share, ndfeb_percent : tuple of float
        Range of the mixtures that were fitted.
    rods : list of str
        Their names.
    """

    coefficients: list[float] = Field(min_length=5, max_length=5)
    covariance: list[list[float]]
    rod_scatter: float = Field(ge=0.0)
    section_scatter: float = Field(ge=0.0)
    remanence_scatter: float = Field(ge=0.0)
    rigid_share: tuple[float, float]
    ndfeb_percent: tuple[float, float]
    rods: list[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """What a mixture will be.

    Attributes
    ----------
    E_MPa, remanence_mT : float
        Medians.
    E_interval_MPa, remanence_interval_mT : tuple of float
        In which 95 % of new rods lie.
    density_kg_m3 : float
        Without voids.
    inside : bool
        Whether the mixture lies within those that were fitted.
    """

    E_MPa: float
    E_interval_MPa: tuple[float, float]
    remanence_mT: float
    remanence_interval_mT: tuple[float, float]
    density_kg_m3: float
    inside: bool

    def as_dict(self) -> dict[str, Any]:
        """Return the prediction for a machine."""
        return {
            "E_MPa": self.E_MPa,
            "E_interval_MPa": list(self.E_interval_MPa),
            "remanence_mT": self.remanence_mT,
            "remanence_interval_mT": list(self.remanence_interval_mT),
            "density_kg_m3": self.density_kg_m3,
            "inside": self.inside,
        }


def fit_law(rods: Rods) -> Law:
    """Fit the law of mixing to the moduli and remanences of rods."""
    sections = len(rods.log_E)
    design = np.zeros((sections + len(rods.first), 5))
    design[:sections, :3] = [_modulus_row(part) for part in rods.mixtures]
    design[sections:, 3:] = [_remanence_row(rods.mixtures[i]) for i in rods.first]
    data = np.concatenate([rods.log_E, rods.log_remanence])
    of_rod = (rods.rod[:, None] == rods.rod[None, :]).astype(float)
    blocks = np.zeros((3, len(data), len(data)))
    blocks[0, :sections, :sections] = of_rod
    blocks[1, :sections, :sections] = np.eye(sections)
    blocks[2, sections:, sections:] = np.eye(len(rods.first))
    mean, sd = np.array(PRIOR).T
    off = data - design @ mean
    spread = (design * sd**2) @ design.T + rods.covariance

    def cost(logs: Array) -> float:
        """Negative log marginal likelihood of the scatters, with their prior."""
        squares = np.exp(2.0 * logs)
        whole = spread + np.tensordot(squares, blocks, axes=1)
        sign, size = np.linalg.slogdet(whole)
        if sign <= 0.0:
            return math.inf
        prior = float(np.sum(squares / (2.0 * SCATTER**2) - logs))
        return 0.5 * float(size + off @ np.linalg.solve(whole, off)) + prior

    start = np.full(3, math.log(0.5 * SCATTER))
    found = minimize(cost, start, method="Nelder-Mead", options={"maxiter": 600})
    scatter = np.exp(found.x)
    noise = rods.covariance + np.tensordot(scatter**2, blocks, axes=1)
    inverse = np.linalg.inv(noise)
    covariance = np.linalg.inv(design.T @ inverse @ design + np.diag(sd**-2.0))
    coefficients = covariance @ (design.T @ inverse @ data + mean / sd**2)
    shares = [part.rigid_share for part in rods.mixtures]
    powders = [part.ndfeb_percent for part in rods.mixtures]
    return Law(
        coefficients=coefficients.tolist(),
        covariance=covariance.tolist(),
        rod_scatter=float(scatter[0]),
        section_scatter=float(scatter[1]),
        remanence_scatter=float(scatter[2]),
        rigid_share=(min(shares), max(shares)),
        ndfeb_percent=(min(powders), max(powders)),
        rods=list(rods.names),
    )


def predict_mixture(law: Law, mixture: Mixture) -> Prediction:
    """Return what a new rod of a mixture will be."""
    covariance = np.array(law.covariance)
    rows = np.zeros((2, 5))
    rows[0, :3] = _modulus_row(mixture)
    rows[1, 3:] = _remanence_row(mixture)
    middle = rows @ np.array(law.coefficients)
    variance = np.einsum("ij,jk,ik->i", rows, covariance, rows)
    variance[0] += law.rod_scatter**2 + law.section_scatter**2
    variance[1] += law.remanence_scatter**2
    ends = np.exp(middle[:, None] + 1.96 * np.sqrt(variance)[:, None] * [-1.0, 1.0])
    return Prediction(
        E_MPa=math.exp(middle[0]),
        E_interval_MPa=(float(ends[0, 0]), float(ends[0, 1])),
        remanence_mT=math.exp(middle[1]),
        remanence_interval_mT=(float(ends[1, 0]), float(ends[1, 1])),
        density_kg_m3=mixture.density_kg_m3,
        inside=_within(mixture.rigid_share, law.rigid_share)
        and _within(mixture.ndfeb_percent, law.ndfeb_percent),
    )


def _modulus_row(mixture: Mixture) -> list[float]:
    return [1.0, mixture.rigid_share, mixture.volume_share]


def _remanence_row(mixture: Mixture) -> list[float]:
    return [1.0, math.log(mixture.volume_share)]


def _within(value: float, ends: tuple[float, float]) -> bool:
    return ends[0] * (1.0 - 1e-9) <= value <= ends[1] * (1.0 + 1e-9)


def write_law(path: Path, law: Law) -> None:
    """Write the file of a law, whole or not at all."""
    data = TypeAdapter(Law).dump_python(law, mode="json")
    write_text(path, json.dumps(data, indent=2, allow_nan=False) + "\n")


def read_law(path: Path) -> Law:
    """Read the file of a law.

    Raises
    ------
    StoreError
        If there is none, or it is no law of mixing.
    """
    try:
        return TypeAdapter(Law).validate_json(path.read_bytes())
    except OSError:
        raise StoreError(
            f"{path}: there is no such law of mixing; magbend analysis recipe fit "
            f"RUN... --out {path} makes one"
        ) from None
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise StoreError(
            f"{path}: is no law of mixing as magbend analysis recipe fit writes it: "
            f"{where}: {first['msg']}"
        ) from None
