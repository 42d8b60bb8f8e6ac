"""Open the bench of a plan for a command: the real devices, or the computed ones."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.errors import ConfigError
from .rig_flux import asker

if TYPE_CHECKING:
    from ..rig import Clock, Devices, Owner, Plan, RunControl


def needs_twin(plan: Plan) -> bool:
    """Return whether the rig file names the computed bench.

    Raises
    ------
    ConfigError
        If it names some of its devices and some real ones: nothing named is left out
        without a word.
    """
    rig, where = plan.rig, plan.rig_path
    twins = {
        'camera.backend = "twin"': rig.camera.backend == "twin",
        'meter.driver = "twin"': rig.meter.driver == "twin",
    }
    if not any(twins.values()):
        return False
    named = {
        f"stage.port = {rig.stage.port!r}": rig.stage.port != "auto"
        and not rig.stage.port.startswith("twin:"),
        f"camera.backend = {rig.camera.backend!r}": rig.camera.backend
        not in ("twin", "auto"),
        f"camera.source = {rig.camera.source!r}": rig.camera.source != 0,
        f"meter.driver = {rig.meter.driver!r}": rig.meter.driver
        not in ("twin", "manual", "none"),
    }
    twin = next(text for text, is_so in twins.items() if is_so)
    real = next((text for text, is_so in named.items() if is_so), None)
    if real is not None:
        raise ConfigError(
            f"{where}: {twin} is the computed bench, which has all devices of its own, "
            f"but {real} names a real one, which would not be opened; name the twin's "
            "for all (camera.backend, meter.driver, no stage.port) or for none"
        )
    return True


def connect_computed(plan: Plan, seed: int) -> None:
    """Connect to the stage of the computed bench, in memory: nothing is moved.

    Raises
    ------
    StageError
        If its board does not fit the rig file: no gap in reach, too fast, ...
    """
    from ..analysis import open_twin_bench

    _, devices = open_twin_bench(plan, seed=seed, clock=_clock(seed, None))
    devices.close()


def asks_flux(plan: Plan, readings_mT: dict[float, float] | None) -> bool:
    """Return whether the readings of a hand meter are asked for at each gap."""
    by_hand = plan.rig.meter.driver == "manual" and readings_mT is None
    return by_hand and sys.stdin.isatty()


@contextlib.contextmanager
def open_bench(
    plan: Plan,
    folder: Path,
    readings_mT: dict[float, float] | None,
    twin_seed: int | None,
    *,
    camera: bool = True,
    control: RunControl | None = None,
    speed: float | None = None,
) -> Iterator[Devices]:
    """Yield open devices; every byte of theirs is for ``wire.log``.

    Parameters
    ----------
    plan : Plan
        The plan with its rig.
    folder : Path
        Run folder; owned meanwhile, made if missing.
    readings_mT : dict or None
        Typed readings per gap that replace the meter.
    twin_seed : int or None
        Seed of the computed bench; None opens the real one. The computed bench leaves
        its stills beside the run: ``board.png``, and ``bare.png`` of a lumen.
    camera : bool
        False where no picture is taken.
    control : RunControl, optional
        Of a run: callers may pause it and ask what it does.
    speed : float, optional
        Of the computed bench's clock over the wall's; by default it only steps.
    """
    from ..core.owned import owning_folder
    from ..rig import WireLog, is_run, open_devices, stopping

    clock = _clock(twin_seed, speed)
    kind, command = ("run", "rig run") if camera else ("scan", "rig scan-field")
    with (
        owning_folder(folder, kind, command, ours=is_run),
        contextlib.closing(WireLog(None, clock)) as log,
        _owner(plan, twin_seed, control) as owner,
    ):
        if twin_seed is None:
            devices = open_devices(
                plan, clock, log=log, readings_mT=readings_mT, with_camera=camera,
                ask=asker(plan) if asks_flux(plan, readings_mT) else None,
            )  # fmt: skip
        else:
            from ..analysis import keep_stills, open_twin_bench

            bench, devices = open_twin_bench(plan, seed=twin_seed, clock=clock, log=log)
        owner.commands["stop"] = stopping(devices.stage)
        with contextlib.closing(devices):
            yield devices
        if twin_seed is not None and camera:
            keep_stills(bench, folder)


def _clock(twin_seed: int | None, speed: float | None) -> Clock:
    from ..rig import SteppedClock, SystemClock

    return SystemClock() if twin_seed is None else SteppedClock(speed=speed)


@contextlib.contextmanager
def _owner(
    plan: Plan, twin_seed: int | None, control: RunControl | None
) -> Iterator[Owner]:
    """Own the bench of a plan; a run may be paused by whoever asks."""
    from ..rig import BenchState, owning

    with owning(
        plan.rig_path,
        plan.rig.stage.port,
        control.state if control else BenchState(),
        command="rig run" if control else "rig scan-field",
        computed=twin_seed is not None,
    ) as owner:
        if control:
            owner.commands["pause"] = control.pause
            owner.commands["resume"] = control.resume
        yield owner
