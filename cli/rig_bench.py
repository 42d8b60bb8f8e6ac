"""Open the bench of a plan for a command: the real devices, or the computed ones."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.errors import StoreError

if TYPE_CHECKING:
    from ..rig.clock import Clock
    from ..rig.config import Plan
    from ..rig.devices import Devices


def needs_twin(plan: Plan) -> bool:
    """Return whether the rig file names the computed bench."""
    return plan.rig.camera.backend == "twin" or plan.rig.meter.driver == "twin"


@contextlib.contextmanager
def open_bench(
    plan: Plan,
    folder: Path,
    readings_mT: dict[float, float] | None,
    twin_seed: int | None,
    *,
    camera: bool = True,
) -> Iterator[Devices]:
    """Yield open devices; every byte of theirs goes to ``wire.log`` in `folder`.

    Parameters
    ----------
    plan : Plan
        The plan with its rig.
    folder : Path
        Run folder; made if missing.
    readings_mT : dict or None
        Typed readings per gap that replace the meter.
    twin_seed : int or None
        Seed of the computed bench; None opens the real one. The computed bench leaves
        a photograph of its calibration board as ``board.png``.
    camera : bool
        False where no picture is taken.
    """
    from ..rig.clock import SteppedClock, SystemClock
    from ..rig.link import WireLog
    from ..rig.open_devices import open_devices

    clock: Clock = SystemClock() if twin_seed is None else SteppedClock()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        log = WireLog(folder / "wire.log", clock)
    except OSError as error:
        raise StoreError(f"{folder}: cannot be written: {error.strerror}") from None
    with contextlib.closing(log):
        if twin_seed is None:
            devices = open_devices(
                plan, clock, log=log, readings_mT=readings_mT, with_camera=camera
            )
        else:
            from ..analysis.twin_run import open_twin_bench, photograph_board

            bench, devices = open_twin_bench(plan, seed=twin_seed, clock=clock, log=log)
        with contextlib.closing(devices):
            yield devices
        if twin_seed is not None and camera:
            photograph_board(bench, folder / "board.png")
