"""From an imported table to its report: measure the photographs, compare, draw."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ...core.progress import Progress, silent
from ...vision import Setting, extract_files, read_calibration
from ..compare.compare import check_any, compare_run, write_comparison
from ..figures.several import gmc_numbers
from ..report import write_report
from ..runs.load import load_run
from .run import ImportedRun


def report_imported(
    runs: Sequence[ImportedRun],
    html: Path,
    *,
    rod_height_mm: float | None = None,
    progress: Progress = silent,
) -> Path:
    """Measure what is not measured yet, compare every run, and write one report.

    Parameters
    ----------
    runs : sequence of ImportedRun
        From `import_table`.
    html : Path
        The page; its figures go into ``figures/`` beside it.
    rod_height_mm : float or None
        Height of the rods' axes above the board's plane; None takes the calibration's.
    progress : callable
        Told after each run; of the last one when the report is written.

    Raises
    ------
    VisionError, StoreError
        If no photograph could be measured, or no step compared.
    """
    done = []
    for index, run in enumerate(runs, start=1):
        if not run.centrelines:
            _measure(run, rod_height_mm)
        done.append(compare_run(load_run(run.path)))
        write_comparison(run.path / "comparison.csv", [done[-1]])
        if index < len(runs):
            progress(index, len(runs))
    check_any(done)
    write_comparison(html.with_name("comparison.csv"), done)
    write_report(done, html, by_number=gmc_numbers(done))
    progress(len(runs), len(runs))
    return html


def _measure(run: ImportedRun, rod_height_mm: float | None) -> None:
    file = run.path / "calibration.json"
    setting = Setting(
        calibration=read_calibration(file) if file.is_file() else None,
        rod_height_mm=rod_height_mm,
        joints_mm=run.specimen.joints_mm,
        length_mm=run.specimen.length_mm,
    )
    extract_files([run.path], run.path, setting=setting)
