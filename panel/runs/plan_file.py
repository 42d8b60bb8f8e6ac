"""The plan editor's side of ``plan.toml``: check, foresee, write with comments kept."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ...core.errors import InputError
from ...core.toml import read_text
from ..bench.theory import Place, predict, shape_mm
from ..toml_edit import change, edited, read_as
from ..workspace import Workspace

if TYPE_CHECKING:
    from ...rig import Plan

PLAN_KEYS: dict[str, tuple[str, ...]] = {
    "name": ("name",),
    "operator": ("operator",),
    "notes": ("notes",),
    "gaps_mm": ("gaps_mm",),
    "settle_s": ("settle", "time_s"),
    "frames": ("photograph", "frames"),
    "samples": ("flux", "samples"),
    "abort": ("abort", "policy"),
}
"""What the editor knows, and where it stands in the file."""


def plan_values(plan: Plan) -> dict[str, Any]:
    """Return the values of a plan that the editor shows."""
    return {
        "name": plan.model.name,
        "operator": plan.model.operator,
        "notes": plan.model.notes,
        "gaps_mm": list(plan.gaps_mm),
        "settle_s": plan.settle.time_s,
        "frames": plan.model.photograph.frames,
        "samples": plan.model.flux.samples,
        "abort": plan.model.abort.policy,
    }


def _named(values: Mapping[str, Any]) -> dict[tuple[str, ...], Any]:
    """Return the values by where they stand in the file.

    Raises
    ------
    InputError
        If one is given that the editor does not know.
    """
    for name in values:
        if name not in PLAN_KEYS:
            raise InputError(
                f"the plan editor knows {', '.join(PLAN_KEYS)}; instead received "
                f"{name!r}"
            )
    return {PLAN_KEYS[name]: value for name, value in values.items()}


def write_plan(workspace: Workspace, values: Mapping[str, Any]) -> None:
    """Write the plan file, if it can be carried out on this bench.

    Raises
    ------
    ConfigError
        One sentence, as `magbend.rig.read_plan` says it; the file stays as it was.
    """
    from ...rig import read_plan

    change(workspace.plan_path, _named(values), read_plan)


def check_plan(workspace: Workspace, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a plan would do, step by step, with the shapes it should show.

    Raises
    ------
    ConfigError
        If it cannot be carried out; nothing is written.
    """
    from ...rig import homing_s, plan_steps, read_plan

    text = edited(read_text(workspace.plan_path), _named(values))
    plan = read_as(workspace.plan_path, text, read_plan)
    files = workspace.files()
    steps, rows = plan_steps(plan), []
    for step in steps:
        found = predict(files, Place(gap_mm=step.gap_mm))
        magnet = found.get("magnet.fitted", found["magnet.nominal"])
        rows.append(
            {
                "index": step.index,
                "gap_mm": step.gap_mm,
                "stage_mm": step.stage_mm,
                "time_s": step.time_s,
                "flux_mT": flux_mT(files, step.gap_mm),
                "status": magnet if isinstance(magnet, str) else magnet.status,
                "shape_mm": shape_mm(magnet),
            }
        )
    total_s = homing_s(plan) + sum(step.time_s for step in steps)
    return {"steps": rows, "total_s": total_s, "name": plan.model.name}


def flux_mT(files: Any, gap_mm: float) -> float | None:
    """Return the model's flux density at the undeformed tip, in mT, or None."""
    from ..bench.theory import model_flux_mT

    if files.rig is None or files.rig.magnet is None or files.specimen is None:
        return None
    magnet = files.rig.magnet.magnet()
    return model_flux_mT(magnet, files.specimen.length_mm, gap_mm)
