"""The plan editor's side of ``plan.toml``: check, foresee, write with comments kept."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.errors import ConfigError, InputError
from ...core.files import write_text
from ..bench.theory import Place, predict, shape_mm
from ..workspace import Workspace, require

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


def edited(text: str, values: Mapping[str, Any]) -> str:
    """Return a TOML plan with new values; comments and all else stay.

    Raises
    ------
    InputError
        If a value is given that the editor does not know.
    ConfigError
        If the text is no TOML.
    """
    import tomlkit
    from tomlkit.exceptions import ParseError

    try:
        document = tomlkit.parse(text)
    except ParseError as error:
        raise ConfigError(f"the plan is not valid TOML: {error}") from None
    for name, value in values.items():
        if name not in PLAN_KEYS:
            raise InputError(
                f"the plan editor knows {', '.join(PLAN_KEYS)}; instead received "
                f"{name!r}"
            )
        *tables, key = PLAN_KEYS[name]
        table: Any = document
        for part in tables:
            if part not in table:
                table[part] = tomlkit.table()
            table = table[part]
        table[key] = value
    return tomlkit.dumps(document)


def write_plan(workspace: Workspace, values: Mapping[str, Any]) -> None:
    """Write the plan file, if it can be carried out on this bench.

    Raises
    ------
    ConfigError
        One sentence, as `magbend.rig.read_plan` says it; the file stays as it was.
    """
    text = edited(_text(workspace), values)
    _read_beside(workspace, text)
    write_text(workspace.plan_path, text)


def check_plan(workspace: Workspace, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a plan would do, step by step, with the shapes it should show.

    Raises
    ------
    ConfigError
        If it cannot be carried out; nothing is written.
    """
    from ...rig import homing_s, plan_steps

    plan = _read_beside(workspace, edited(_text(workspace), values))
    files = workspace.files()
    rows = []
    for step in plan_steps(plan):
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
    total_s = homing_s(plan) + sum(row["time_s"] for row in rows)
    return {"steps": rows, "total_s": total_s, "name": plan.model.name}


def flux_mT(files: Any, gap_mm: float) -> float | None:
    """Return the model's flux density at the undeformed tip, in mT, or None."""
    from ..bench.theory import model_flux_mT

    if files.rig is None or files.rig.magnet is None or files.specimen is None:
        return None
    magnet = files.rig.magnet.magnet()
    return model_flux_mT(magnet, files.specimen.length_mm, gap_mm)


def _text(workspace: Workspace) -> str:
    try:
        return workspace.plan_path.read_text(encoding="utf-8")
    except OSError:
        files = workspace.files()
        require(None, files.problems, "plan")
        raise


def _read_beside(workspace: Workspace, text: str) -> Plan:
    """Read a plan that is not written yet, as if it lay beside the rig file."""
    from ...rig import read_plan

    with tempfile.NamedTemporaryFile(
        "w", dir=workspace.folder, prefix=".plan-", suffix=".toml", encoding="utf-8",
        delete=False,
    ) as file:  # fmt: skip
        file.write(text)
    path = Path(file.name)
    try:
        return read_plan(path)
    except ConfigError as error:
        sentence = str(error).replace(str(path), workspace.plan_path.name)
        raise ConfigError(sentence) from None
    finally:
        path.unlink(missing_ok=True)
