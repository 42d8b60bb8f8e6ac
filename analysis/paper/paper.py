"""The paper's bending experiments on the twin bench: seven GMCs at three fields.

Each rod is run by the twin bench as `magbend demo` runs one: stage, readings,
photographs, centrelines. GMC 2 stands in each of the paper's three panels, so that 21
photographs make its 27 comparisons.
"""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import StoreError
from ...core.files import output_folder
from ...core.orphan import end_with_parent
from ...core.progress import Progress, silent
from ...sim import gmc
from ..compare.compare import (
    RunComparison,
    compare_run,
    comparison_table,
    write_comparison,
)
from ..figures.several import PANELS, gmc_numbers
from ..fit.result import FitResult, write_fit
from ..fit.runs import try_fit
from ..report import write_report
from ..runs.load import load_run
from ..twin.run import bench_run
from .audit import audit_html, audit_paper

NUMBERS = (1, 2, 3, 4, 5, 6, 7)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduction:
    """What came of the seven runs.

    Attributes
    ----------
    html : Path
        The report.
    runs : tuple of RunComparison
        GMC 1 to 7.
    fits : tuple of FitResult or str
        One a run; a sentence where there is none.
    """

    html: Path
    runs: tuple[RunComparison, ...]
    fits: tuple[FitResult | str, ...]

    @property
    def comparisons(self) -> int:
        """Number of comparisons in the paper's three panels that have numbers."""
        by_number = gmc_numbers(self.runs)
        return sum(
            c.ok
            for _, numbers, _ in PANELS
            for n in numbers
            for c in by_number[n].of("magnet")
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the summary for a machine."""
        return {
            "html": str(self.html),
            "runs": [str(run.run.path) for run in self.runs],
            "steps": sum(len(run.run.steps) for run in self.runs),
            "comparisons": self.comparisons,
            "median_rms_mm": {
                model: _median(self.runs, model) for model in ("uniform", "magnet")
            },
        }

    def sentence(self) -> str:
        """Return the summary in words."""
        data = self.as_dict()
        rms = data["median_rms_mm"]
        return (
            f"{len(self.runs)} runs, {data['steps']} steps, {data['comparisons']} "
            f"comparisons; median RMS {rms['uniform']:.3f} mm in the uniform field, "
            f"{rms['magnet']:.3f} mm with the magnet"
        )


def reproduce(
    out: Path, *, seed: int = 1, workers: int = 1, progress: Progress = silent
) -> Reproduction:
    """Run the seven GMCs on the twin bench, compare, fit and report.

    Parameters
    ----------
    out : Path
        A new or empty folder: ``gmc1`` to ``gmc7`` are run folders, ``report.html`` and
        ``comparison.csv`` cover all.
    seed : int
        Of what the twin hides; rod n gets seed + n.
    workers : int
        Processes that run benches side by side.
    progress : callable
        Told after each rod and at the end.

    Raises
    ------
    StoreError
        If a run folder is there already.
    """
    output_folder(out)
    paths = [out / f"gmc{number}" for number in NUMBERS]
    for path in paths:
        if path.exists():
            raise StoreError(f"{path} is there already; give a new folder with --out")
    runs: list[RunComparison] = []
    fits: list[FitResult | str] = []
    for path in _bench_runs(paths, seed=seed, workers=workers):
        run = compare_run(load_run(path))
        fit = try_fit(run.run)
        write_comparison(path / "comparison.csv", [run])
        if isinstance(fit, FitResult):
            write_fit(path / "fit.json", fit)
        runs.append(run)
        fits.append(fit)
        progress(len(runs), len(NUMBERS) + 1)
    write_comparison(out / "comparison.csv", runs)
    files = write_report(
        runs,
        out / "report.html",
        fits=fits,
        title="Seven GMCs at three fields, on the twin bench",
        by_number=gmc_numbers(runs),
        extra_html=[("The paper's own numbers, audited", audit_html(audit_paper()))],
    )
    progress(len(NUMBERS) + 1, len(NUMBERS) + 1)
    return Reproduction(html=files.html, runs=tuple(runs), fits=tuple(fits))


def _bench_runs(paths: Sequence[Path], *, seed: int, workers: int) -> Iterator[Path]:
    """Run GMC 1 to 7 on the twin bench; yield the folders in order as they are done."""
    jobs = [
        (path, gmc(number), seed + number)
        for path, number in zip(paths, NUMBERS, strict=True)
    ]
    if workers == 1:
        for path, specimen, hidden in jobs:
            bench_run(path, specimen=specimen, seed=hidden)
            yield path
        return
    # Spawned, not forked: numba's and OpenCV's threads do not survive a fork.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(
        workers, mp_context=context, initializer=end_with_parent
    ) as pool:
        futures = [
            (path, pool.submit(bench_run, path, specimen=specimen, seed=hidden))
            for path, specimen, hidden in jobs
        ]
        try:
            for path, future in futures:
                future.result()
                yield path
        except BaseException:
            # After Ctrl-C or a failed bench nobody waits for the others. Killed: a
            # run that is asked to stop only ends its motion, then measures.
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.kill()
            raise


def _median(runs: Sequence[RunComparison], model: str) -> float:
    table = comparison_table(runs)
    chosen = table.loc[(table["model"] == model) & (table["status"] == "ok"), "rms_mm"]
    return float(np.median(chosen)) if len(chosen) else math.nan
