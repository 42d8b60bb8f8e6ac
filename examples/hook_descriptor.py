"""A descriptor of one's own: how far a rod hooks back, as a column of the library.

A package declares it, and a space file asks for it with ``descriptors = ["hook_mm"]``:

    [project.entry-points."magbend.descriptors"]
    hook_mm = "my_package:hook_mm"

python examples/hook_descriptor.py [folder]
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from magbend.sim import UniformField, gmc, solve

FIELDS_MT = (50.0, 200.0, 800.0)


def hook_mm(shapes: np.ndarray) -> np.ndarray:
    """Return how far behind its foremost point each tip lies, in mm.

    Parameters
    ----------
    shapes : ndarray, shape (n, points, 5)
        s, x, y in mm, theta in rad, kappa in 1/mm.

    Returns
    -------
    ndarray, shape (n,)
    """
    x = shapes[:, :, 1]
    return x.max(axis=1) - x[:, -1]


def main(folder: Path) -> dict[float, float]:
    """Draw GMC 2 in fields against it; return the hook at each, in mm."""
    figure, axes = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
    hooks = {}
    for flux_mT in FIELDS_MT:
        line = solve(gmc(2), UniformField(flux_mT=flux_mT, angle_deg=150.0)).centreline
        columns = (line.s_mm, line.x_mm, line.y_mm, line.theta_rad, line.kappa_per_mm)
        hooks[flux_mT] = float(hook_mm(np.stack(columns, axis=1)[None])[0])
        label = f"{flux_mT:g} mT: hook {hooks[flux_mT]:.1f} mm"
        axes.plot(line.x_mm, line.y_mm, label=label)
    axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    axes.legend(frameon=False)
    figure.savefig(folder / "hook_descriptor.svg")
    plt.close(figure)
    return hooks


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "gallery")
    out.mkdir(parents=True, exist_ok=True)
    for flux, far in main(out).items():
        print(f"{flux:g} mT: the tip lies {far:.2f} mm behind")
