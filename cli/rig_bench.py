"""Open the bench of a plan for a command: the real devices, or the computed ones."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.errors import InputError, StoreError

if TYPE_CHECKING:
    from ..rig.clock import Clock
    from ..rig.config import Plan
    from ..rig.devices import Devices
    from ..rig.link import WireLog


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
        Seed of the computed bench; None opens the real one.
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
            devices = _open_twin(plan, clock, log, twin_seed)
        with contextlib.closing(devices):
            yield devices


def _open_twin(plan: Plan, clock: Clock, log: WireLog, seed: int) -> Devices:
    from ..analysis.twin import TwinBench
    from ..rig.virtual.bench import open_twin

    if plan.rig.magnet is None:
        raise InputError(
            f"{plan.rig_path}: the computed bench needs a magnet; add the table "
            f"[magnet] with side_mm and remanence_T"
        )
    bench = TwinBench(plan.specimen, plan.rig.magnet.magnet(), seed=seed)
    return open_twin(
        plan.rig, bench.photograph, bench.flux_mT, seed=seed, clock=clock, log=log
    )
