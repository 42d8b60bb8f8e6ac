"""The main job on the twin bench: run, calibrate, extract, predict, report."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from ..core.errors import RigError, StoreError, VisionError
from ..core.files import write_bytes, write_text
from ..rig.config import Plan, read_plan
from ..rig.devices import closing_all
from ..rig.runner import run
from ..rig.virtual.bench import open_twin
from ..vision.batch import Settings, extract_files
from ..vision.calibrate import calibrate
from ..vision.calibration import Calibration
from ..vision.photo import read_photo
from .compare import compare_run, write_comparison
from .fit import try_fit
from .load import load_run
from .report import write_report
from .twin import TwinBench

Tell = Callable[[str], None]

SWING = {"swing_mm": 1.0, "swing_Hz": 2.0, "damping_s": 0.4}
"""How the twin's rod swings after the stage arrived."""

DEMO_FILES = {
    "gmc2.toml": """\
# GMC 2 of the paper's Table 1: three sections that soften from root to tip.
name = "GMC 2"
side_mm = 1.0          # square section
remanence_mT = 20.07   # axial; + points root to tip

[[section]]            # root first
length_mm = 10.0
E_MPa = 20.0

[[section]]
length_mm = 10.0
E_MPa = 15.0

[[section]]
length_mm = 10.0
E_MPa = 10.0
""",
    "rig.toml": """\
# The built-in twin bench: a simulated GRBL board, camera and Tesla-meter.
name = "twin bench"

[stage]
port = "twin://"
axis = "X"
gap_at_zero_mm = 120.0   # gap in mm from the N face when the machine stands at 0
direction = 1            # the homed stage travels toward negative machine mm
feed_mm_min = 300.0
backlash_mm = 0.5

[limits]
min_gap_mm = 40.0        # the interlock
max_gap_mm = 119.0
retract_gap_mm = 100.0

[camera]
backend = "twin"

[meter]
driver = "twin"

[magnet]
side_mm = 55.0
remanence_T = 1.30
""",
    "plan.toml": """\
# The paper's protocol: three gaps, each approached from the far side.
name = "GMC 2 at the paper's three gaps"
specimen = "gmc2.toml"
rig = "rig.toml"
gaps_mm = [70.0, 60.0, 50.0]
operator = "demo"
""",
}


def run_demo(out: Path, *, seed: int, tell: Tell) -> Path:
    """Run the whole loop on the twin bench.

    Parameters
    ----------
    out : Path
        Folder for the inputs and the run. An earlier run in it stays as it is; the new
        one gets the next free name.
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
        If `out` cannot be written.
    RigError, VisionError
        If a stage of the loop failed; the sentence says which and why.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise StoreError(f"{out} must be a folder; instead it is a file") from None
    for name, text in DEMO_FILES.items():
        write_text(out / name, text)
    plan = read_plan(out / "plan.toml")
    bench = twin_of(plan, seed=seed)
    folder = _free_name(out)
    tell(f"bench    twin bench, hidden truth number {seed}, {plan.specimen.name}")
    _experiment(plan, bench, folder, seed=seed, tell=tell)
    calibration = calibrate_twin(bench, folder)
    tell(f"camera   calibrated on its board, {calibration.rms_px:.3f} px RMS")
    measured = measure_twin(bench, folder, calibration)
    tell(f"vision   {measured} of {len(plan.gaps_mm)} photographs measured")
    return _report(folder, tell=tell)


def twin_of(plan: Plan, *, seed: int) -> TwinBench:
    """Return the twin bench of a plan: its specimen before its rig's magnet."""
    if plan.rig.magnet is None:
        raise RigError(
            f"{plan.rig_path}: the twin bench needs the table [magnet] with side_mm "
            f"and remanence_T"
        )
    return TwinBench(plan.specimen, plan.rig.magnet.magnet(), seed=seed)


def _free_name(out: Path) -> Path:
    names = (out / f"run_{number:03d}" for number in range(1, 1000))
    for folder in names:
        if not folder.exists():
            return folder
    raise StoreError(f"{out} must have room for a run; instead it holds 999 of them")


def _experiment(
    plan: Plan, bench: TwinBench, folder: Path, *, seed: int, tell: Tell
) -> None:
    devices = open_twin(
        plan.rig, bench.photograph, bench.flux_mT, seed=seed, camera=SWING
    )
    with closing_all(devices):
        summary = run(plan, devices, folder, twin=True)
    if summary.status != "success":
        raise RigError(f"the demo's run ended with {summary.status}: {summary.reason}")
    gaps = ", ".join(f"{gap_mm:g}" for gap_mm in plan.gaps_mm)
    tell(f"run      {summary.steps_done} steps at gaps of {gaps} mm")


def calibrate_twin(bench: TwinBench, folder: Path) -> Calibration:
    """Photograph the twin's board and calibrate the run in `folder` with it."""
    good, png = cv2.imencode(".png", bench.photograph_board())
    if not good:
        raise VisionError("the twin's board photograph could not be encoded as PNG")
    path = folder / "board.png"
    write_bytes(path, np.asarray(png).tobytes())
    calibration = calibrate(
        read_photo(path), board=bench.board, rod_height_mm=bench.axis_height_mm
    )
    calibration.save(folder / "calibration.json")
    return calibration


def measure_twin(bench: TwinBench, folder: Path, calibration: Calibration) -> int:
    """Extract the centrelines of the run in `folder`; return how many there are."""
    settings = Settings(
        calibration=calibration,
        rod_height_mm=bench.axis_height_mm,
        joints_mm=bench.specimen.joints_mm,
        length_mm=bench.specimen.length_mm,
    )
    return extract_files([folder], folder, settings=settings).measured


def _report(folder: Path, *, tell: Tell) -> Path:
    data = load_run(folder)
    compared = compare_run(data)
    write_comparison(folder / "comparison.csv", [compared])
    for model in ("uniform", "magnet"):
        rms_mm = [c.errors.rms_mm for c in compared.of(model) if c.errors]
        if rms_mm:
            tell(
                f"sim      {model} field: measured and predicted shapes are "
                f"{np.mean(rms_mm):.3f} mm RMS apart"
            )
    fit = try_fit(data, compared.support)
    files = write_report([compared], folder / "report.html", fits=[fit])
    tell(f"report   one page and {len(files.figures)} figures")
    return files.html
