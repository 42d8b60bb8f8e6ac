"""Runs on the twin bench: open it, carry a plan out, calibrate, measure."""

from __future__ import annotations

import contextlib
import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ...core.derived import note_derived
from ...core.errors import ConfigError, RigError, VisionError
from ...core.files import write_bytes, write_text
from ...core.owned import owning_folder
from ...core.specimen import Specimen
from ...core.specimen_file import specimen_dict
from ...rig import (
    Clock,
    Devices,
    Plan,
    RunSummary,
    SteppedClock,
    WireLog,
    closing_all,
    read_plan,
    run,
    write_templates,
)
from ...rig.virtual import VirtualAxis, open_twin
from ...sim.navigate import lumen_of
from ...vision import (
    Calibration,
    Setting,
    calibrate,
    extract_files,
    read_photo,
    write_calibration,
)
from ..runs.witness import witness_of
from .bench import HiddenTruth, TwinBench
from .lumen_bench import LumenBench

_SWING = {"swing_mm": 1.0, "swing_Hz": 2.0, "damping_s": 0.4}
"""How the twin's rod swings after the stage arrived."""


def open_twin_bench(
    plan: Plan,
    *,
    seed: int,
    clock: Clock,
    log: WireLog | None = None,
    camera: Mapping[str, Any] | None = None,
    truth: HiddenTruth | None = None,
) -> tuple[TwinBench, Devices]:
    """Open the twin bench of a plan: its specimen before its rig's magnet.

    Parameters
    ----------
    plan : Plan
        Its rig file needs the table ``[magnet]``.
    seed : int
        Which hidden truth the bench gets.
    clock : Clock
        Shared by all devices.
    log : WireLog, optional
        Where every byte to and from the board is recorded.
    camera : mapping, optional
        Options of the twin's camera besides the rod's swing, such as ``frame_s``.
    truth : HiddenTruth, optional
        Given in place of the seeded one.

    Raises
    ------
    ConfigError
        If the rig has no magnet.
    """
    if plan.rig.magnet is None:
        raise ConfigError(
            f"{plan.rig_path}: the twin bench needs a magnet; add the table [magnet] "
            f"with side_mm and remanence_T"
        )
    magnet = plan.rig.magnet.magnet()
    swing: dict[str, Any] = _SWING
    if plan.model.lumen is None:
        bench = TwinBench(
            plan.specimen, magnet, seed=seed, truth=truth,
            gravity_m_s2=plan.gravity_m_s2,
        )  # fmt: skip
    else:
        # Walls keep the rod from swinging.
        swing = {"swing_mm": 0.0}
        bench = LumenBench(
            plan.specimen, magnet, lumen_of(plan.lumen_text), seed=seed, truth=truth,
            wall_height_mm=plan.model.lumen.wall_height_mm,
        )  # fmt: skip
    devices = open_twin(
        plan.rig, bench.photograph, bench.flux_mT,
        seed=seed, clock=clock, log=log, camera={**swing, **(camera or {})},
    )  # fmt: skip
    if isinstance(bench, LumenBench):
        axes = devices.axes.items()
        bench.axes = {
            name: axis for name, axis in axes if isinstance(axis, VirtualAxis)
        }
    return bench, devices


def run_on_twin(
    plan: Plan, folder: Path, *, seed: int, truth: HiddenTruth | None = None
) -> tuple[TwinBench, RunSummary]:
    """Carry a plan out on its twin bench.

    Returns
    -------
    bench : TwinBench
        The bench that was run.
    summary : RunSummary
        How the run ended.

    Raises
    ------
    RigError
        If the run did not end with success.
    """
    clock = SteppedClock()
    with (
        owning_folder(folder, "run", "rig run"),
        contextlib.closing(WireLog(None, clock)) as log,
    ):
        bench, devices = open_twin_bench(
            plan, seed=seed, clock=clock, log=log, truth=truth
        )
        with closing_all(devices):
            summary = run(plan, devices, folder, twin=True, witness=witness_of(plan))
    if summary.status != "success":
        raise RigError(
            f"{folder}: the run on the twin bench ended with {summary.status}: "
            f"{summary.reason}"
        )
    return bench, summary


def keep_stills(bench: TwinBench, folder: Path) -> None:
    """Write the board's picture, and a bare channel's, into a run; note their maker."""
    for name, picture in bench.stills().items():
        path = folder / name
        good, png = cv2.imencode(".png", picture)
        if not good:
            raise VisionError(f"{path}: the photograph could not be encoded")
        write_bytes(path, np.asarray(png).tobytes())
        note_derived([path], sources=[folder / "run.json"], command="rig run --twin")


def calibrate_twin(bench: TwinBench, folder: Path) -> Calibration:
    """Photograph the twin's board and calibrate the run in `folder` with it."""
    path = folder / "board.png"
    keep_stills(bench, folder)
    calibration = calibrate(
        read_photo(path), board=bench.board, rod_height_mm=bench.axis_height_mm
    )
    out = folder / "calibration.json"
    write_calibration(calibration, out)
    note_derived([out], sources=[path], command="vision calibrate")
    return calibration


def measure_twin(bench: TwinBench, folder: Path, calibration: Calibration) -> int:
    """Extract the centrelines of the run in `folder`; return how many there are."""
    setting = Setting(
        calibration=calibration,
        rod_height_mm=bench.axis_height_mm,
        joints_mm=bench.specimen.joints_mm,
        length_mm=bench.specimen.length_mm,
    )
    return extract_files([folder], folder, setting=setting).measured


def bench_run(
    folder: Path, *, specimen: Specimen, seed: int, truth: HiddenTruth | None = None
) -> None:
    """Run a specimen at the paper's three gaps on the twin bench and measure it.

    Parameters
    ----------
    folder : Path
        The run folder; must not hold a run.
    specimen : Specimen
        The nominal rod.
    seed : int
        Which hidden truth the bench gets.
    truth : HiddenTruth, optional
        Given in place of the seeded one.
    """
    with tempfile.TemporaryDirectory() as inputs:
        write_templates(Path(inputs), twin=True)
        text = json.dumps(specimen_dict(specimen), indent=1)
        write_text(Path(inputs) / "specimen.toml", text)
        plan = read_plan(Path(inputs) / "plan.toml")
        bench, _ = run_on_twin(plan, folder, seed=seed, truth=truth)
    measure_twin(bench, folder, calibrate_twin(bench, folder))
