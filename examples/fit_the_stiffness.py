"""Moduli from photographs, each with its interval.

python examples/fit_the_stiffness.py [folder]
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
from run_the_twin_bench import run

from magbend.analysis import FitResult, fit_runs, load_run


def main(folder: Path) -> FitResult:
    """Draw what the fit leaves over; return the fit."""
    fit = fit_runs([load_run(run(folder))])
    figure, axes = plt.subplots(figsize=(6.0, 2.6), layout="constrained")
    for label, s_mm, residual_mm, _ in fit.residual_mm:
        axes.plot(s_mm, 1e3 * residual_mm, label=label)
    axes.set(xlabel="s (mm)", ylabel="left across the rod (µm)")
    axes.legend(frameon=False)
    figure.savefig(folder / "fit_the_stiffness.svg")
    plt.close(figure)
    return fit


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "gallery")
    out.mkdir(parents=True, exist_ok=True)
    found = main(out)
    for i, modulus in enumerate(found.E_MPa):
        low, high = found.interval_MPa(i)
        print(f"section {i + 1}: {modulus:.2f} MPa (95 %: {low:.2f} to {high:.2f})")
