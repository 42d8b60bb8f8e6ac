"""Gauge the gap: which way the stage goes, and where it stands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...core.errors import InputError, RigError, StageError
from ..arguments import Arguments, Outcome, number
from ..bench.parts import Parts, stage_of
from ..workspace import require, utc_now
from .steps import mark, was_tested

if TYPE_CHECKING:
    from ..panel import Panel

TEST_MM = 1.0
TAKE_UP_MM = 0.5
"""As `magbend rig set-gap` tests the direction: this far, and the play taken up so."""

_MOVE_S = 60.0


def try_direction(panel: Panel, _arguments: Arguments) -> Outcome:
    """Move by 1 mm of the machine's count, slowly, for somebody to see which way."""
    panel.require_free()
    stage_rig = require(panel.workspace.files().rig, {}, "rig")
    gap_mm = panel.owner.gap_mm
    if gap_mm is not None and gap_mm - TEST_MM < stage_rig.limits.min_gap_mm:
        raise InputError(
            f"the direction is tested by moving 1 mm, and {gap_mm:g} mm leaves no room "
            f"before min_gap_mm = {stage_rig.limits.min_gap_mm:g} mm: jog farther away"
        )
    _do(panel, "testing the direction", lambda parts: stage_of(parts).nudge(TEST_MM))
    return {"text": "it moved by 1 mm: is the rod now farther from the magnet?"}


def tell_direction(panel: Panel, arguments: Arguments) -> Outcome:
    """Take in which way the stage went, and move it back with the play taken up."""
    farther = arguments.get("farther")
    if not isinstance(farther, bool):
        raise InputError("farther must be true or false: say which way the stage went")
    panel.require_free()

    def back(parts: Parts) -> None:
        stage = stage_of(parts)
        stage.nudge(-TEST_MM)
        if not farther:  # end with a motion toward the magnet, as every approach does
            stage.nudge(-TAKE_UP_MM)
            stage.nudge(TAKE_UP_MM)

    _do(panel, "moving back", back)
    panel.direction = 1 if farther else -1
    return {"text": f"direction = {panel.direction}; now gauge the gap"}


def set_gap(panel: Panel, arguments: Arguments) -> Outcome:
    """Take a gauged gap for where the stage stands, and write it into the rig file."""
    from ...rig import InterlockError, keep_measured_gap, why_doubt_gap

    gap_mm = number(arguments, "gap_mm", "mm")
    panel.require_free()
    rig = require(panel.workspace.files().rig, {}, "rig")
    tested = panel.direction is not None or was_tested(rig)
    if rig.stage.gap_at_zero_mm is None and not tested:
        raise StageError(
            "the direction was never tested on this bench: let the stage move by 1 mm "
            "first, and say which way it went"
        )

    def assume(parts: Parts) -> float:
        stage = stage_of(parts)
        doubt = why_doubt_gap(stage, gap_mm)
        if doubt and arguments.get("confirm") is not True:
            raise InterlockError(
                f"{doubt}: gauge it again, or confirm it; nothing was changed"
            )
        zero_mm: float = stage.assume_gap(gap_mm, direction=panel.direction)
        keep_measured_gap(
            panel.workspace.rig_path, stage, gap_mm, direction_tested=tested
        )
        return zero_mm

    zero_mm = _do(panel, "setting the gap", assume)
    mark(panel.workspace.folder, "gap", utc_now())
    return {"text": f"gap_at_zero_mm = {zero_mm:.3f}"}


def _do(panel: Panel, name: str, action: Any) -> Any:
    """Let the owner of the stage do something short, and wait for it."""
    try:
        return panel.owner.submit(name, action).result(timeout=_MOVE_S)
    except TimeoutError:
        raise RigError(f"{name}: the stage is busy with something else") from None
