"""Commands about plans, runs, and the work on finished runs."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from ...core.checks import finite
from ...core.errors import ConfigError, InputError
from ...core.files import write_bytes
from ..arguments import Arguments, Outcome
from ..workspace import now_name, require
from .plan_file import write_plan

if TYPE_CHECKING:
    from ..panel import Panel

TWIN_SPEED = 4.0
"""How many times as fast as the wall clock a run on the computed bench goes."""


def save_plan(panel: Panel, arguments: Arguments) -> Outcome:
    """Write the plan file, if the plan can be carried out."""
    write_plan(panel.workspace, arguments)
    return {"text": f"{panel.workspace.plan_path.name} written"}


def start_run(panel: Panel, arguments: Arguments) -> Outcome:
    """Let go of the bench and start ``magbend rig run`` in its own process."""
    panel.require_free()
    files = panel.workspace.files()
    plan = require(files.plan, files.problems, "plan")
    name = str(arguments.get("resume") or "")
    folder = panel.workspace.run_path(name) if name else _new_folder(panel, plan)
    command = [
        "rig", "run", panel.workspace.plan_path.name,
        "--out", str(folder.relative_to(panel.workspace.folder)), "--live-port", "0",
    ]  # fmt: skip
    if name:
        command.append("--resume")
    if panel.is_twin:
        speed = TWIN_SPEED * panel.twin.speed
        command += ["--seed", str(panel.twin.seed), "--speed", f"{speed:g}"]
    command += _assumed(panel)
    command += _readings(arguments, len(plan.gaps_mm))
    with panel.handing_over:
        panel.require_free()
        panel.owner.release()
        panel.sight.forget()
        panel.supervisor.start(command, folder)
    return {"text": f"run {folder.name} started", "run": folder.name}


def _new_folder(panel: Panel, plan: Any) -> Any:
    name = re.sub(r"[^\w.-]+", "-", plan.model.name).strip("-") or "run"
    return panel.workspace.runs_path / f"{now_name()}_{name}"


def _assumed(panel: Panel) -> list[str]:
    """Return the word for where the stage stands, where no switch tells it."""
    rig, gap_mm = panel.workspace.files().rig, panel.owner.gap_mm
    if rig is None or rig.stage.homing != "manual" or gap_mm is None:
        return []
    return ["--assume-gap-mm", f"{gap_mm:.3f}"]


def _readings(arguments: Arguments, count: int) -> list[str]:
    """Return the option for readings of a hand meter, one a gap."""
    values = arguments.get("flux_mT")
    if not values:
        return []
    if not isinstance(values, list) or len(values) != count:
        raise InputError(f"flux_mT must be {count} numbers in mT, one a gap")
    values = [finite(value, "flux_mT", "mT") for value in values]
    return ["--flux-mT", ",".join(f"{value:g}" for value in values)]


def pause_run(panel: Panel, _arguments: Arguments) -> Outcome:
    """Ask the run to pause at its next safe point."""
    return {"text": panel.supervisor.ask("pause")}


def resume_run(panel: Panel, _arguments: Arguments) -> Outcome:
    """Let a paused run go on."""
    return {"text": panel.supervisor.ask("resume")}


def abort_run(panel: Panel, _arguments: Arguments) -> Outcome:
    """Stop the run: the stage is held, and its ending written."""
    return {"text": panel.supervisor.stop()}


def start_job(panel: Panel, arguments: Arguments) -> Outcome:
    """Queue extract, fit, compare, report, verify or package for runs."""
    what = str(arguments.get("what"))
    names = arguments.get("runs")
    if not isinstance(names, list) or not names:
        raise InputError("a job must name at least one run")
    runs = [
        str(panel.workspace.run_path(str(name)).relative_to(panel.workspace.folder))
        for name in names
    ]
    command = _job_command(panel, what, runs)
    panel.jobs.add(what, ", ".join(str(name) for name in names), command)
    return {"text": f"{what} queued"}


def _job_command(panel: Panel, what: str, runs: list[str]) -> list[str]:
    if what == "extract":
        if panel.workspace.files().calibration is None:
            raise ConfigError(
                "the camera is not calibrated; do that on the page Set up first"
            )
        # The run keeps the calibration that it was measured with: its report needs it.
        kept = panel.workspace.folder / runs[0] / "calibration.json"
        write_bytes(kept, panel.workspace.calibration_path.read_bytes())
        return ["vision", "extract", runs[0], "--calibration",
                f"{runs[0]}/calibration.json", "--out", runs[0]]  # fmt: skip
    commands = {
        "verify": ["rig", "verify", runs[0]],
        "fit": ["analysis", "fit", *runs],
        "compare": ["analysis", "compare", *runs],
        "report": ["analysis", "report", *runs],
        "package": ["analysis", "package", *runs, "--out", "paper.zip"],
    }
    if what not in commands:
        raise InputError(
            f"a job must be one of extract, {', '.join(commands)}; instead received "
            f"{what!r}"
        )
    return commands[what]
