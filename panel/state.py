"""What every open page is told: the state of files, bench, field, run and jobs."""

from __future__ import annotations

import time
from typing import Any, Protocol

from .bench.field import FieldWatch
from .bench.owner import BenchOwner
from .bench.sight import Sight
from .hub import Hub
from .journal import Journal
from .kernels import KernelWatch
from .runs.jobs import Jobs
from .runs.supervisor import Supervisor
from .workspace import Workspace


class Parts(Protocol):
    """What a panel is made of, as far as its state goes."""

    workspace: Workspace
    owner: BenchOwner
    sight: Sight
    field: FieldWatch
    supervisor: Supervisor
    jobs: Jobs
    hub: Hub
    journal: Journal
    kernels: KernelWatch

    @property
    def is_twin(self) -> bool:
        """Whether the bench is the computed one."""
        ...


def compose(panel: Parts) -> dict[str, Any]:
    """Return the state that all pages share."""
    return {
        "beat": int(time.monotonic()),  # a page that hears nothing calls us lost
        "files": _files(panel),
        "bench": _bench(panel),
        "camera": panel.sight.facts(),
        "meter": panel.field.facts(),
        "run": _run(panel),
        "jobs": panel.jobs.facts(),
        "pages": len(panel.hub.pages),
        "journal": panel.journal.trouble,
        "compiling": panel.kernels.news,
    }


def _files(panel: Parts) -> dict[str, Any]:
    files = panel.workspace.files()
    rig, specimen, calibration = files.rig, files.specimen, files.calibration
    return {
        "folder": str(panel.workspace.folder),
        "rig_file": panel.workspace.rig_path.name,
        "has_rig_file": panel.workspace.rig_path.exists(),
        "rig": rig.name if rig else None,
        "twin": panel.is_twin,
        "meter": rig.meter.driver if rig else None,
        "specimen": {
            "name": specimen.name,
            "length_mm": specimen.length_mm,
            "joints_mm": list(specimen.joints_mm),
        }
        if specimen
        else None,
        "plan": files.plan.model.name if files.plan else None,
        "calibration": {
            "rms_px": calibration.rms_px,
            "size_px": list(calibration.image_size_px),
            "rod_height_mm": calibration.rod_height_mm,
            "tilt_deg": calibration.tilt_deg,
        }
        if calibration
        else None,
        "fitted": files.fitted.run if files.fitted else None,
        "problems": files.problems,
    }


def _bench(panel: Parts) -> dict[str, Any]:
    view = panel.owner.view()
    parts = panel.owner.parts
    rig = panel.workspace.files().rig
    limits: dict[str, Any] = {}
    if rig is not None:
        limits = {
            "min_gap_mm": rig.limits.min_gap_mm,
            "max_gap_mm": rig.limits.max_gap_mm,
            "contact_gap_mm": rig.limits.contact_gap_mm,
            "magnet_mm": rig.magnet.magnet().sides_mm[2] if rig.magnet else None,
            "homing": rig.stage.homing,
        }
    return {
        "open": parts is not None,
        "facts": view.facts,
        "doing": view.doing,
        "target_mm": view.target_mm,
        "trouble": view.trouble,
        "problems": parts.problems if parts else {},
        **limits,
    }


def _run(panel: Parts) -> dict[str, Any]:
    supervisor = panel.supervisor
    return {
        "facts": supervisor.facts,
        "starting": supervisor.is_starting and supervisor.facts is None,
        "last": supervisor.last_run,
    }
