"""What the run commands print: a dry run, the end of a run, a field scan."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..core.errors import RigError
from .console import print_json, say

if TYPE_CHECKING:
    from ..rig import FieldScan, Plan, RunSummary


def print_dry_run(plan: Plan, as_json: bool) -> None:
    """Print the steps of a plan with what the simulator expects at each."""
    from ..rig import homing_s, plan_steps

    steps = plan_steps(plan)
    previews: dict[int, Any] = {}
    if plan.rig.magnet is not None:
        from ..analysis import preview_plan

        magnet = plan.rig.magnet.magnet()
        found = preview_plan(
            plan.specimen, magnet, plan.gaps_mm, gravity_m_s2=plan.gravity_m_s2
        )
        previews = dict(enumerate(found))
    total_s = homing_s(plan) + sum(step.time_s for step in steps)
    rows = []
    for step in steps:
        preview = previews.get(step.index)
        free = plan.model.lumen is None  # in a lumen, walls hold the rod too
        tip = preview.tip_mm if preview and free else None
        status = preview.status if preview else None
        status = status if free else "in a lumen"
        rows.append(
            {
                "index": step.index,
                "kind": step.kind,
                "settings": dict(step.settings),
                "gap_mm": step.gap_mm,
                "stage_mm": step.stage_mm,
                "move_mm": step.move_mm,
                "time_s": step.time_s,
                "predicted_flux_mT": preview.flux_mT if preview else None,
                "predicted_tip_x_mm": tip[0] if tip else None,
                "predicted_tip_y_mm": tip[1] if tip else None,
                "predicted_status": status,
            }
        )
    if as_json:
        print_json(
            {
                "name": plan.model.name,
                "total_s": total_s,
                "gravity_m_s2": plan.gravity_m_s2,
                "steps": rows,
            }
        )
        return
    say(f"{plan.model.name}: {plan.specimen.name} on {plan.rig.name}")
    say("step kind         gap mm  stage mm  move mm   time s  flux mT  tip x, y mm")
    for row in rows:
        say(_dry_line(row))
    if plan.model.lumen is not None:
        say("where the rod lies in its lumen, magbend sim navigate predicts")
    elif plan.rig.magnet is not None:
        say(_weight(plan))
    if plan.rig.stage.gap_at_zero_mm is None:
        from ..rig import NEVER_MEASURED

        say(f"note: {NEVER_MEASURED}")
    say(
        f"about {total_s / 60.0:.0f} min with homing; every gap is inside the limits; "
        f"nothing was moved"
    )


def _weight(plan: Plan) -> str:
    if any(plan.gravity_m_s2):
        x, y, z = plan.gravity_m_s2
        return f"predicted with weight: {x:.2f}, {y:.2f}, {z:.2f} m/s2 in x, y, z"
    missing = (
        "the rig file has no [bench] with up"
        if plan.rig.bench is None
        else "the specimen has no density_kg_m3"
    )
    return f"predicted without weight: {missing}"


def _dry_line(row: dict[str, Any]) -> str:
    """Return a step as a row of the table, with what other axes are set to."""
    settings = "".join(f"  {n} = {v:g}" for n, v in row["settings"].items())
    return _dry_row(row) + settings


def _dry_row(row: dict[str, Any]) -> str:
    stage = "-" if row["stage_mm"] is None else f"{row['stage_mm']:.2f}"
    line = (
        f"{row['index'] + 1:4d} {row['kind']:<11} {row['gap_mm']:7.2f} {stage:>9} "
        f"{row['move_mm']:8.2f} {row['time_s']:8.1f}"
    )
    if row["predicted_flux_mT"] is None:
        return line + "        -  (no [magnet] in the rig file)"
    line += f" {row['predicted_flux_mT']:8.2f}"
    if row["predicted_tip_x_mm"] is None:
        return line + f"  {row['predicted_status']}"
    tip = f"  {row['predicted_tip_x_mm']:.2f}, {row['predicted_tip_y_mm']:.2f}"
    doubt = row["predicted_status"]
    return line + tip + (f"  ({doubt})" if doubt != "stable" else "")


def print_summary(summary: RunSummary, as_json: bool) -> None:
    """Print how a run ended: its folder, or a sentence and how to go on."""
    if as_json:
        print_json(
            {
                "run": str(summary.path),
                "status": summary.status,
                "reason": summary.reason,
                "steps_done": summary.steps_done,
                "steps_total": summary.steps_total,
                "flagged": list(summary.flagged),
            }
        )
        return
    if summary.status == "success":
        say(str(summary.path))
        return
    say(
        f"magbend: {summary.status}: {' '.join(summary.reason.split())} "
        f"({summary.steps_done} of {summary.steps_total} steps are recorded in "
        f"{summary.path}; go on with --resume --out {summary.path})",
        err=True,
    )


def print_scan(
    plan: Plan, found: FieldScan, tolerance_percent: float, as_json: bool
) -> None:
    """Print a field scan and what it says about the magnet."""
    data: dict[str, Any] = {
        "field": str(found.path),
        "readings": len(found.gaps_mm),
        "skipped": list(found.skipped),
    }
    lines = [str(found.path), *(f"no reading at {line}" for line in found.skipped)]
    if plan.rig.magnet is not None and len(found.gaps_mm) >= 2:
        from ..analysis import judge_scan

        judged = judge_scan(
            found.path, found.gaps_mm, found.flux_mT, found.sd_mT,
            plan.rig.magnet.magnet(), tolerance_percent=tolerance_percent,
        )  # fmt: skip
        data["magnet"] = judged.as_dict()
        lines += judged.lines()
    if as_json:
        print_json(data)
    else:
        say("\n".join(lines))
    if not found.gaps_mm:
        raise RigError(
            "not one gap has a reading; check the range of the meter and its port"
        )
