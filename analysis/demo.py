"""The main job on the twin bench: run, calibrate, extract, predict, report."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..core.errors import StoreError
from ..core.jit import once
from ..core.owned import owning_folder
from ..rig import is_bench, read_plan, write_templates
from .compare.compare import compare_run, write_comparison
from .fit.runs import try_fit
from .report import ReportFiles, write_report
from .runs.load import load_run
from .twin.run import calibrate_twin, measure_twin, run_on_twin
from .warm_up import is_warm, warm_up_beside

Tell = Callable[[str], None]

PATIENCE = 5_000_000
"""Calls of kernels that fit and report may take in plain Python: some minutes."""


def run_demo(out: Path, *, seed: int, tell: Tell) -> Path:
    """Run the whole loop on the twin bench.

    Parameters
    ----------
    out : Path
        Folder for the plan, the rig and specimen files, and the run. What an earlier
        demo left there stays; the new run gets the next free name.
    seed : int
        Which hidden truth the bench gets.
    tell : callable
        Given one line a stage.

    Returns
    -------
    Path
        The report.

    Raises
    ------
    StoreError
        If `out` cannot be written, or holds what magbend did not make.
    RigError, VisionError
        If a stage of the loop failed; the sentence says which and why.
    """
    with owning_folder(out, "demo", "demo", ours=is_bench):
        return _run(out, seed=seed, tell=tell)


def _run(out: Path, *, seed: int, tell: Tell) -> Path:
    if not (out / "plan.toml").exists():
        write_templates(out, twin=True)
    plan = read_plan(out / "plan.toml")
    cold = not is_warm()
    folder = _free_name(out)
    gaps = ", ".join(f"{gap_mm:g}" for gap_mm in plan.gaps_mm)
    tell(f"bench    {plan.specimen.name} on the twin bench, hidden truth {seed}")
    bench, summary = run_on_twin(plan, folder, seed=seed)
    tell(f"run      {summary.steps_done} steps at gaps of {gaps} mm")
    calibration = calibrate_twin(bench, folder)
    tell(f"camera   calibrated on its board, {calibration.rms_px:.3f} px RMS")
    measured = measure_twin(bench, folder, calibration)
    tell(f"vision   {measured} of {summary.steps_done} photographs measured")
    report = _report(folder, cold=cold, tell=tell)
    if cold:
        tell("kernels  compiling in the background, once, for a few minutes")
        warm_up_beside()
    return report


def _free_name(out: Path) -> Path:
    for number in range(1, 1000):
        folder = out / f"run_{number:03d}"
        if not folder.exists():
            return folder
    raise StoreError(
        f"{out} holds 999 runs already; name another folder with --out, or remove some"
    )


def _report(folder: Path, *, cold: bool, tell: Tell) -> Path:
    data = load_run(folder)
    compared = compare_run(data)
    write_comparison(folder / "comparison.csv", [compared])
    for model in ("uniform", "magnet"):
        rms_mm = [c.errors.rms_mm for c in compared.of(model) if c.errors]
        if rms_mm:
            tell(
                f"sim      {model} field: {sum(rms_mm) / len(rms_mm):.3f} mm RMS "
                f"between measured and predicted shapes"
            )

    def judged() -> ReportFiles:
        fit = try_fit(data, compared.support)
        return write_report([compared], folder / "report.html", fits=[fit])

    # Their kernels take longer to compile than three steps do in plain Python.
    files = once(judged, patience=PATIENCE) if cold else judged()
    tell(f"report   one page and {len(files.figures)} figures")
    return files.html
