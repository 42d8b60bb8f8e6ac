"""Open the devices one by one: a missing camera must not keep the stage away."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ...core.errors import MagbendError, StageError
from ..workspace import Workspace, require

if TYPE_CHECKING:
    from ...analysis import TwinBench
    from ...rig import GapStage

FRAME_S = 0.04
"""Time between two pictures of the computed bench."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """What could be opened; the others are sentences.

    Parameters
    ----------
    stage : GapStage or None
        Connected.
    camera, meter : Camera and Meter, or None
        Open.
    twin : TwinBench or None
        The computed bench, if it is one.
    problems : dict of str to str
        ``stage``, ``camera``, ``meter`` to why it could not be opened.
    held : ExitStack
        What else is let go with them: the claim on the bench.
    """

    stage: GapStage | None
    camera: Any
    meter: Any
    twin: TwinBench | None
    problems: dict[str, str]
    held: contextlib.ExitStack

    def close(self) -> None:
        """Let every device go, and the claim on the bench."""
        for part in (self.camera, self.meter, self.stage):
            if part is not None:
                with contextlib.suppress(MagbendError):
                    part.close()
        self.held.close()


EXPOSURES = 6
"""How many different pictures of a still rod the computed bench makes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Twin:
    """How the computed bench is opened.

    Parameters
    ----------
    seed : int
        Which hidden truth it gets.
    speed : float
        How many times as fast as the wall's its clock goes.
    """

    seed: int = 1
    speed: float = 1.0


def stage_of(parts: Parts) -> GapStage:
    """Return the stage.

    Raises
    ------
    StageError
        If it could not be opened: why.
    """
    if parts.stage is None:
        raise StageError(parts.problems.get("stage", "the stage is not connected"))
    return parts.stage


def is_twin(workspace: Workspace) -> bool:
    """Return whether the rig file names the computed bench."""
    rig = workspace.files().rig
    return rig is not None and (
        rig.camera.backend == "twin" or rig.meter.driver == "twin"
    )


def open_parts(workspace: Workspace, twin: Twin, *, stop: Callable[[], None]) -> Parts:
    """Open what the rig file names; nothing moves.

    The bench is claimed first: ``magbend rig status`` and ``rig stop`` find the panel,
    and a bench that another process holds is refused.

    Parameters
    ----------
    workspace : Workspace
        The files of the bench.
    twin : Twin
        How the computed bench is opened, if the rig file names it.
    stop : callable
        Stops the stage, from any thread.

    Raises
    ------
    ConfigError
        If the rig file cannot be used.
    RigError
        If another process holds the bench: it says which.
    """
    from ...rig import BenchState, owning

    def stopped() -> str:
        stop()
        return "the panel was told to stop the stage"

    files = workspace.files()
    rig = require(files.rig, files.problems, "rig")
    computed = is_twin(workspace)
    with contextlib.ExitStack() as held:
        owner = held.enter_context(
            owning(
                workspace.rig_path, rig.stage.port, BenchState(), command="panel",
                computed=computed,
            )
        )  # fmt: skip
        owner.commands["stop"] = stopped
        kept = contextlib.ExitStack()
        if computed:
            parts = _open_twin(workspace, twin, kept)
        else:
            parts = _open_real(workspace, kept)
        kept.callback(held.pop_all().close)
        return parts


def _open_twin(workspace: Workspace, twin: Twin, held: contextlib.ExitStack) -> Parts:
    from ...analysis import open_twin_bench
    from ...rig import ScaledClock

    files = workspace.files()
    plan = require(files.plan, files.problems, "plan")
    bench, devices = open_twin_bench(
        plan, seed=twin.seed, clock=ScaledClock(twin.speed),
        camera={"frame_s": FRAME_S * twin.speed},
    )  # fmt: skip
    bench.exposures = EXPOSURES
    return Parts(
        stage=devices.stage, camera=devices.camera, meter=devices.meter, twin=bench,
        problems={}, held=held,
    )  # fmt: skip


def _open_real(workspace: Workspace, held: contextlib.ExitStack) -> Parts:
    from ...rig import SystemClock, open_camera, open_meter, open_stage

    files, folder, clock = workspace.files(), workspace.folder, SystemClock()
    rig = require(files.rig, files.problems, "rig")
    problems: dict[str, str] = {}
    stage = _try(problems, "stage", lambda: open_stage(rig, clock))
    camera = _try(problems, "camera", lambda: open_camera(rig.camera, folder, clock))
    meter = None
    if rig.meter.driver not in ("manual", "none"):
        meter = _try(problems, "meter", lambda: open_meter(rig.meter, folder))
    return Parts(
        stage=stage, camera=camera, meter=meter, twin=None, problems=problems, held=held
    )


def _try(problems: dict[str, str], name: str, make: Callable[[], Any]) -> Any:
    try:
        return make()
    except MagbendError as error:
        problems[name] = str(error)
        return None
