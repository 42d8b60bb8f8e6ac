"""Do the fit's intervals hold on photographs? Twin runs with hidden truth, measured.

Run by hand: python benchmarks/bench_fit.py [runs] [folder to keep the runs in]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from magbend import sim
from magbend.analysis import fit_runs, load_run
from magbend.analysis.twin.bench import hide
from magbend.analysis.twin.run import bench_run

FIRST_SEED = 1000


def scores(folder: Path, runs: int) -> dict[str, float]:
    """Return how the claimed deviations compare with the truth, over twin runs."""
    z, claimed, error = [], [], []
    for k in range(runs):
        path, seed = folder / f"run_{k:03d}", FIRST_SEED + k
        if not (path / "frames.csv").exists():
            bench_run(path, specimen=sim.gmc(1 + k % 7), seed=seed)
        run = load_run(path)
        assert run.magnet is not None
        truth = hide(run.specimen, run.magnet, seed=seed).specimen
        fit = fit_runs([run])
        for i, section in enumerate(truth.sections):
            if f"E_MPa[{i}]" not in fit.not_identifiable:
                z.append((fit.E_MPa[i] - section.E_MPa) / fit.E_sd_MPa[i])
                claimed.append(fit.E_sd_MPa[i] / fit.E_MPa[i])
                error.append(fit.E_MPa[i] / section.E_MPa - 1.0)
    size = np.abs(z)
    return {
        "moduli": len(z),
        "within_95": float(np.mean(size < 1.96)),
        "within_68": float(np.mean(size < 1.0)),
        "median_sd": float(np.median(claimed)),
        "rms_error": float(np.sqrt(np.mean(np.square(error)))),
        "claimed_over_scatter": float(1.0 / np.sqrt(np.mean(np.square(z)))),
    }


def main(runs: int, folder: Path) -> None:
    found = scores(folder, runs)
    print(f"{runs} runs of the twin bench, {found['moduli']:.0f} moduli")
    print(f"in the 95 % interval: {found['within_95']:.1%}")
    print(f"in the 68 % interval: {found['within_68']:.1%}")
    print(f"claimed standard deviation, median: {found['median_sd']:.2%}")
    print(f"actual error, RMS: {found['rms_error']:.2%}")
    print(f"claimed over actual scatter: {found['claimed_over_scatter']:.2f}")


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 70
    if len(sys.argv) > 2:
        main(count, Path(sys.argv[2]))
    else:
        with tempfile.TemporaryDirectory() as scratch:
            main(count, Path(scratch))
