"""Check that the millimetres of the board and the gaps of a run belong to one map.

A run keeps the map it was taken by (`stage.place`), every step the zero and the sign
that turned the board's count into its gap. A map that changed between two sessions
makes gaps that look right and are not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from ...core.errors import StoreError
from ..stage.place import difference
from .read import Run, read_objects
from .records import SESSIONS_FILE, Record

_ROUNDING_MM = 0.0015
_ARRIVED_MM = 0.02


def require_same_map(old: Record, new: Record) -> None:
    """Refuse to go on with a run by another map than it was begun with.

    Parameters
    ----------
    old, new : dict
        ``run.json`` as written, and as it would be written now.

    Raises
    ------
    StoreError
        If anything of the map differs, or the run was begun on the operator's word for
        the gap and that is not repeated; nothing has moved.
    """
    was_assumed, is_assumed = old.get("assumed_gap"), new.get("assumed_gap")
    if was_assumed and not is_assumed:
        raise StoreError(
            f"the run was begun with --assume-gap-mm {was_assumed['gap_mm']:g}: that "
            "word held for its session only; repeat it with the gap at which the stage "
            "stands now"
        )
    then, now = dict(old.get("map") or {}), dict(new.get("map") or {})
    if was_assumed:  # the board may count from elsewhere after a restart by hand
        then.pop("gap_at_zero_mm", None)
    change = difference(then, now)
    if change:
        raise StoreError(
            f"the position is unverified: {change} since the run was begun, so its "
            "gaps would be others; undo that, or start a new run in another folder"
        )


def map_problems(run: Run) -> Iterator[str]:
    """Yield one sentence for every step whose gap is not that of its stage_mm."""
    maps = list(_maps(run))
    step_mm = run.manifest.get("devices", {}).get("stage_limits", {}).get("step_mm")
    arrived_mm = max(_ARRIVED_MM, 2.0 * float(step_mm or 0.0))
    for step in run.steps:
        problem = _step_problem(step, maps, arrived_mm)
        if problem:
            yield f"step {step['index'] + 1}: {problem}"


def _maps(run: Run) -> Iterator[dict[str, Any]]:
    first = run.manifest.get("map") or run.manifest.get("rig", {}).get("stage")
    if first:
        yield first
    for record in read_objects(run.path / SESSIONS_FILE):
        if isinstance(record.get("map"), dict):
            yield record["map"]


def _step_problem(step: Record, maps: list[dict[str, Any]], arrived_mm: float) -> str:
    stage_mm, gap_mm = step.get("stage_mm"), step.get("gap_mm")
    reached_mm = step.get("gap_reached_mm", gap_mm)
    if stage_mm is None or reached_mm is None or not maps:
        return ""
    own = [step] if step.get("gap_at_zero_mm") is not None else maps
    by_map = [gap for map_ in own if (gap := _gap_mm(map_, stage_mm)) is not None]
    if by_map and not any(math.isclose(g, reached_mm, abs_tol=_ROUNDING_MM)
                          for g in by_map):  # fmt: skip
        return (
            f"stage_mm = {stage_mm:g} is a gap of {by_map[0]:g} mm by the map, not "
            f"{reached_mm:g} mm"
        )
    if gap_mm is not None and abs(reached_mm - gap_mm) > arrived_mm:
        return f"the stage stood at {reached_mm:g} mm instead of {gap_mm:g} mm"
    if own is not maps and not any(
        not difference(_pair(step), _pair(map_)) for map_ in maps
    ):
        return (
            f"its map (gap_at_zero_mm = {step['gap_at_zero_mm']:g}) is none of those "
            "of the run and its sessions"
        )
    return ""


def _pair(map_: dict[str, Any]) -> dict[str, Any]:
    return {name: map_.get(name) for name in ("gap_at_zero_mm", "direction")}


def _gap_mm(map_: dict[str, Any], stage_mm: float) -> float | None:
    zero = map_.get("gap_at_zero_mm")
    return None if zero is None else zero + map_.get("direction", 1) * stage_mm
