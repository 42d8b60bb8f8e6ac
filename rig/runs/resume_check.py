"""Is the stage where it was? Before a run goes on, look at its last finished step."""

from __future__ import annotations

import math
from pathlib import Path

from ...core.door import inside, read_file
from ...core.errors import StageError, StoreError
from ...core.picture import decode_picture
from ..bench.config import Plan
from ..bench.devices import Devices
from ..camera.protocol import grab_median
from ..clock import Check, go_on
from .records import Record
from .settle import change_percent, settle

_TOLERANCE = 0.01
_SIGMAS = 4.0


def verify_position(
    plan: Plan, devices: Devices, folder: Path, last: Record, *, check: Check = go_on
) -> Record:
    """Return to the last finished step and compare the field with what was recorded.

    Parameters
    ----------
    plan : Plan
        The plan.
    devices : Devices
        Homed and open.
    folder : Path
        The run folder, for the photograph of that step.
    last : dict
        Record of the last finished step.
    check : callable
        Called in every wait; it may raise, to end it.

    Returns
    -------
    dict
        What was compared, for ``sessions.jsonl``: flux now and then, and the share of
        pixels by which the photographs differ.

    Raises
    ------
    StageError
        If the flux density differs by more than 1 % and by more than four standard
        deviations: the stage, the magnet or the probe is not where it was.
    """
    gap_mm = float(last["gap_mm"])
    move = devices.stage.goto_gap(gap_mm)
    devices.camera.at_step(int(last["index"]), gap_mm)
    settle(devices.camera, devices.clock, plan.settle, check=check)
    flux = devices.meter.read_flux(plan.model.flux.samples, gap_mm=gap_mm, check=check)
    frame = grab_median(
        devices.camera, devices.clock, plan.model.photograph.frames, check=check
    )
    compared: Record = {
        "index": last["index"],
        "gap_mm": gap_mm,
        "stage_mm": move.stage_mm,
        "flux_then_mT": last.get("flux_mT"),
        "flux_now_mT": flux.flux_mT,
        "image_change_percent": _image_change(folder, last, frame.image),
    }
    then_mT = last.get("flux_mT")
    if then_mT is not None and flux.flux_mT is not None and flux.status == "ok":
        sd_mT = math.hypot(last.get("flux_sd_mT") or 0.0, flux.sd_mT or 0.0)
        allowed_mT = max(_TOLERANCE * abs(then_mT), _SIGMAS * sd_mT)
        if abs(flux.flux_mT - then_mT) > allowed_mT:
            raise StageError(
                f"flux density at the gap of {gap_mm:g} mm must be {then_mT:.2f} mT as "
                f"when the step was recorded, within {allowed_mT:.2f} mT; instead "
                f"received {flux.flux_mT:.2f} mT: the stage, the magnet or the probe "
                f"was moved; start a new run"
            )
    return compared


def _image_change(folder: Path, last: Record, image: object) -> float | None:
    import numpy as np

    files = last.get("files") or []
    if not files:
        return None
    path = inside(folder, str(files[0]["path"]), StoreError)
    now = np.asarray(image)
    try:
        data = read_file(path, 256.0, StoreError)
        stored = decode_picture(data, path.name, StoreError)
    except StoreError:
        return None
    if stored.shape != now.shape:
        return None
    return change_percent(stored, now)
