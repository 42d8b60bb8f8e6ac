"""A whole run without hardware: stage, Tesla-meter and camera are simulated.

The twin's rod is not the nominal one, so there is something to find.

python examples/run_the_twin_bench.py [folder]
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt

from magbend.analysis import bench_run, compare_run, load_run
from magbend.sim import gmc

SEED = 2
"""Which hidden truth the bench gets."""


def run(folder: Path) -> Path:
    """Run GMC 2 at the paper's three gaps and measure it; return the run's folder."""
    path = folder / "gmc2"
    if not path.exists():
        bench_run(path, specimen=gmc(2), seed=SEED)
    return path


def main(folder: Path) -> dict[str, float]:
    """Draw measured and predicted shapes; return the worst tip error of each model."""
    done = compare_run(load_run(run(folder)))
    figure, axes = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
    worst = {}
    for model, style in (("uniform", ":"), ("magnet", "--")):
        good = [c for c in done.of(model) if c.ok]
        for c in good:
            axes.plot(*c.solution.centreline.points_mm.T, style, color="tab:blue")
            axes.plot(*c.frame.centreline.points_mm.T, color="black", linewidth=0.8)
        worst[model] = max(c.errors.tip_mm for c in good)
    axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    axes.set_title("measured (black), uniform field (dotted), magnet (dashed)")
    figure.savefig(folder / "run_the_twin_bench.svg")
    plt.close(figure)
    return worst


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "gallery")
    out.mkdir(parents=True, exist_ok=True)
    for name, tip_mm in main(out).items():
        print(f"{name} field: worst tip error {tip_mm:.3f} mm")
