"""Do the fit's intervals hold, and does it know when it is wrong?

    python benchmarks/bench_fit.py --right 100 --wrong 5 --photographs 0 --first 5000

`--right` runs are off in everything, drawn from the fit's own priors; `--wrong` runs of
each wrong model (tests/analysis/wrong_models.py) are off in one thing at the size given
there; both have lines as photographs give them, without painting. `--photographs` runs
are painted, calibrated and measured, off in everything. Seeds count from `--first`:
take others than those a change was made with.

What intervals of moduli hold is mostly how the remanences of the rods were drawn, one
number a run: ten runs may well hold a fifth of their moduli in the 68 % interval. What
lines and photographs do is seen without it, in moduli over the rod's remanence and in
moduli of neighbours over one another.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from magbend.analysis import FitResult, fit_runs, load_run
from magbend.analysis.runs.data import RunData
from magbend.analysis.twin.bench import HiddenTruth
from magbend.analysis.twin.lines import lines_run
from magbend.analysis.twin.run import bench_run

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "analysis"))
from wrong_models import GAPS_MM, WRONG, all_off, wrong_run

Array = NDArray[np.float64]


def right_runs(seeds: Sequence[int]) -> Iterator[tuple[RunData, HiddenTruth]]:
    """Give runs that are off in everything, and their truth."""
    for seed in seeds:
        bench, errors, rng = all_off(seed)
        yield lines_run(bench, GAPS_MM, rng, errors), bench.truth


def photographed(
    seeds: Sequence[int], folder: Path
) -> Iterator[tuple[RunData, HiddenTruth]]:
    """Give the same benches as `right_runs`, photographed."""
    for seed in seeds:
        bench, _, _ = all_off(seed)
        path = folder / f"run_{seed}"
        if not (path / "frames.csv").exists():
            bench_run(path, specimen=bench.specimen, seed=seed, truth=bench.truth)
        yield load_run(path), bench.truth


def z_of(fit: FitResult, moduli: Sequence[float]) -> list[float]:
    """Return errors over their standard deviations, of the identifiable moduli."""
    return [
        (value - true) / sd
        for value, true, sd in zip(fit.E_MPa, moduli, fit.E_sd_MPa, strict=True)
        if np.isfinite(value)
    ]


def z_over_remanence(fit: FitResult, truth: HiddenTruth) -> list[float]:
    """Return z of the moduli over the rod's remanence: what no draw of it moves."""
    off = _off(fit, truth)
    nominal_mT = fit.problem.specimen.remanences_mT[0]
    off += np.log(truth.specimen.remanences_mT[0] / nominal_mT)
    known = np.diag(fit.covariance)[: len(off)] - (
        fit.budget["remanence_percent"][: len(off)] ** 2
    )
    return [float(z) for z in off / np.sqrt(known) if np.isfinite(z)]


def z_of_neighbours(fit: FitResult, truth: HiddenTruth) -> list[float]:
    """Return z of each modulus over that of the section before it."""
    step = np.diff(np.eye(len(fit.E_MPa)), axis=0)
    sections = len(fit.E_MPa)
    covariance = step @ fit.covariance[:sections, :sections] @ step.T
    z = step @ _off(fit, truth) / np.sqrt(np.diag(covariance))
    return [float(value) for value in z if np.isfinite(value)]


def _off(fit: FitResult, truth: HiddenTruth) -> Array:
    """Return the logarithms of the moduli over the true ones."""
    return np.log([
        found / section.E_MPa
        for found, section in zip(fit.E_MPa, truth.specimen.sections, strict=True)
    ])  # fmt: skip


def score(pairs: Iterator[tuple[RunData, HiddenTruth]], what: str) -> None:
    """Print coverage and false alarms of right models."""
    z: list[float] = []
    over: list[float] = []
    neighbours: list[float] = []
    p, words, rms, sds = [], [], [], []
    start = time.process_time()
    for run, truth in pairs:
        fit = fit_runs([run])
        assert fit.verdict is not None
        moduli = [section.E_MPa for section in truth.specimen.sections]
        z += z_of(fit, moduli)
        over += z_over_remanence(fit, truth)
        neighbours += z_of_neighbours(fit, truth)
        rms += [a / b - 1.0 for a, b in zip(fit.E_MPa, moduli, strict=True)]
        sds += [sd / a for a, sd in zip(fit.E_MPa, fit.E_sd_MPa, strict=True)]
        p.append(fit.verdict.p_value)
        words.append(fit.verdict.verdict)
    count = len(words)
    alarms = [word for word in words if word != "supported"]
    print(f"{count} {what}, {len(z)} moduli")
    for name, these in (
        ("moduli", z),
        ("moduli over remanence", over),
        ("neighbours' moduli", neighbours),
    ):
        size = np.abs(these)
        print(
            f"  {name}: {np.mean(size < 1.96):.1%} in their 95 % interval, "
            f"{np.mean(size < 0.994):.1%} in their 68 % one, "
            f"z {np.sqrt(np.mean(size**2)):.2f} RMS, {np.mean(these):+.2f} on average"
        )
    print(f"  error, RMS: {np.sqrt(np.nanmean(np.square(rms))):.1%}")
    print(
        f"  claimed standard deviation, RMS: {np.sqrt(np.nanmean(np.square(sds))):.1%}"
    )
    print(
        f"  false alarms: {len(alarms)} ({alarms.count('contradicted')} contradicted)"
    )
    print(f"  p, quartiles: {np.round(np.quantile(p, [0.25, 0.5, 0.75]), 2)}")
    print(f"  CPU a run: {(time.process_time() - start) / count:.2f} s")


def wrong_models(seeds: Sequence[int]) -> None:
    """Print how each wrong model comes out."""
    print(f"{len(seeds)} runs of each wrong model")
    print("  held: covered or not supported; named: right suspect among the first two")
    for name, wrong in WRONG.items():
        held, named, supported, z = [], [], [], []
        for seed in seeds:
            run, moduli = wrong_run(wrong, seed)
            fit = fit_runs([run])
            assert fit.verdict is not None
            z.append(np.max(np.abs(z_of(fit, moduli))))
            supported.append(fit.verdict.verdict == "supported")
            held.append(z[-1] < 1.96 or not supported[-1])
            first = fit.verdict.suspects[:2]
            named.append(any(s.name.startswith(wrong.right) for s in first))
        print(
            f"  {name:28} held {np.mean(held):4.0%}  named {np.mean(named):4.0%}  "
            f"supported {np.mean(supported):4.0%}  worst z {np.max(z):.1f}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--right", type=int, default=100)
    parser.add_argument("--wrong", type=int, default=5)
    parser.add_argument("--photographs", type=int, default=0)
    parser.add_argument("--first", type=int, default=5000)
    parser.add_argument("--keep", type=Path, help="folder to keep photographed runs in")
    given = parser.parse_args()
    first = given.first
    if given.right:
        score(right_runs(range(first, first + given.right)), "runs off in everything")
    if given.wrong:
        wrong_models(range(first, first + given.wrong))
    if given.photographs:
        seeds = range(first, first + given.photographs)
        with tempfile.TemporaryDirectory() as scratch:
            runs = photographed(seeds, given.keep or Path(scratch))
            score(runs, "photographed runs off in everything")


if __name__ == "__main__":
    main()
