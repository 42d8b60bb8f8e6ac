"""Which parameter matters where: Sobol indices of the bend over the design domain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import positive, within
from ...core.progress import Progress, silent
from ...sim import Designs, solve_shapes
from ..shapes import descriptors

Array = NDArray[np.float64]

PARAMETERS = {
    "E root": (8.0, 50.0),
    "E middle / root": (0.4, 1.0),
    "E tip / middle": (0.4, 1.0),
    "length root": (5.0, 20.0),
    "length middle": (5.0, 20.0),
    "length tip": (5.0, 20.0),
    "side": (0.75, 1.35),
    "remanence": (14.0, 26.0),
}
"""What varies, evenly and independently: MPa, ratios, mm, mm, mT. Moduli fall by
ratios, since three moduli that must fall are not independent."""

OUTPUTS = ("tip_y_mm", "tip_angle_deg", "radius_mm", "circularity")
FIELDS_MT = (10.0, 60.0, 120.0)
_RESAMPLES = 49


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity:
    """Sobol indices.

    Parameters
    ----------
    fields_mT : tuple of float
    first, total, total_sd : ndarray, shape (fields, outputs, parameters)
        Share of the variance that a parameter explains alone, and with all its
        interactions; standard deviation of the latter by bootstrap.
    samples : int
        Base samples; the number of solves is this times parameters + 2.
    """

    fields_mT: tuple[float, ...]
    first: Array
    total: Array
    total_sd: Array
    samples: int

    def rows(self) -> list[dict[str, float | str]]:
        """Return a table, one row a field, output and parameter."""
        return [
            {
                "flux_mT": flux,
                "output": output,
                "parameter": parameter,
                "first_order": float(self.first[i, j, k]),
                "total_order": float(self.total[i, j, k]),
                "total_order_sd": float(self.total_sd[i, j, k]),
            }
            for i, flux in enumerate(self.fields_mT)
            for j, output in enumerate(OUTPUTS)
            for k, parameter in enumerate(PARAMETERS)
        ]


def sensitivity(
    *,
    fields_mT: Sequence[float] = FIELDS_MT,
    samples: int = 2048,
    seed: int = 0,
    progress: Progress = silent,
) -> Sensitivity:
    """Return Sobol indices of tip, angle, radius and circularity at several fields.

    Parameters
    ----------
    fields_mT : sequence of float
        Uniform, at 90 deg.
    samples : int
        A power of two from 64 on (Saltelli's scheme in `scipy.stats.sobol_indices`).
    seed : int
    progress : Progress

    Raises
    ------
    InputError
        If a field is not above zero or `samples` is no such power.
    """
    from scipy.stats import sobol_indices, uniform

    for flux in fields_mT:
        positive(flux, "flux_mT", "mT")
    samples = int(within(samples, 64, 2**20, "samples", ""))
    samples = 1 << (samples - 1).bit_length()
    dists: Any = [uniform(low, high - low) for low, high in PARAMETERS.values()]
    first, total, sd = [], [], []
    for done, flux in enumerate(fields_mT, start=1):
        rng = np.random.default_rng(seed)
        found = sobol_indices(
            func=partial(_outputs, flux_mT=flux), n=samples, dists=dists, rng=rng
        )
        spread = found.bootstrap(
            confidence_level=0.95, n_resamples=_RESAMPLES
        ).total_order
        interval = spread.confidence_interval
        first.append(found.first_order)
        total.append(found.total_order)
        sd.append((interval.high - interval.low) / (2.0 * 1.96))
        progress(done, len(fields_mT))
    return Sensitivity(
        fields_mT=tuple(fields_mT),
        first=np.array(first),
        total=np.array(total),
        total_sd=np.array(sd),
        samples=samples,
    )


def _outputs(p: Array, flux_mT: float) -> Array:
    """Return outputs (4, n) of parameters (8, n), as scipy asks."""
    root = p[0]
    n = len(root)
    designs = Designs(
        E_MPa=np.stack([root, root * p[1], root * p[1] * p[2]], axis=1),
        length_mm=p[3:6].T,
        side_mm=p[6],
        remanence_mT=p[7],
        flux_mT=np.full(n, flux_mT),
        angle_deg=np.full(n, 90.0),
    )
    table = descriptors.describe(solve_shapes(designs).points)
    chosen = [descriptors.COLUMNS.index(name) for name in OUTPUTS]
    return table[:, chosen].T
