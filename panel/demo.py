"""A bench to play with: the computed bench, its files, its camera calibrated."""

from __future__ import annotations

from pathlib import Path

from .workspace import Workspace


def prepare_demo(folder: Path, *, seed: int) -> Path:
    """Write the files of a computed bench, with its calibration; return the rig file.

    What an earlier demo left there stays.

    Parameters
    ----------
    folder : Path
        Where the bench lives.
    seed : int
        Which hidden truth it gets.

    Raises
    ------
    StoreError
        If the folder cannot be written, or holds what magbend did not make.
    """
    from ..core.owned import owning_folder
    from ..rig import is_bench

    with owning_folder(folder, "demo", "demo --panel", ours=is_bench):
        return _prepared(folder, seed)


def _prepared(folder: Path, seed: int) -> Path:
    from ..analysis import open_twin_bench
    from ..rig import SteppedClock, write_templates
    from ..vision import as_photo, calibrate, write_calibration

    rig = folder / "rig.toml"
    if not rig.exists():
        write_templates(folder, twin=True)
    workspace = Workspace(rig)
    plan = workspace.files().plan
    if plan is None or workspace.calibration_path.exists():
        return rig
    bench, devices = open_twin_bench(plan, seed=seed, clock=SteppedClock())
    devices.close()
    calibration = calibrate(
        as_photo(bench.photograph_board()), board=bench.board,
        rod_height_mm=bench.axis_height_mm,
    )  # fmt: skip
    write_calibration(calibration, workspace.calibration_path)
    return rig
