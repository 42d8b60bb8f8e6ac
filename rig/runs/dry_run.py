"""What a plan would do: positions and times, checked against every limit; no device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..bench.config import Plan

_FRAME_S = 0.05
_SAMPLE_S = 0.2
_RECORD_S = 0.2
_HOME_FEED_MM_MIN = 500.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedStep:
    """One step of a plan.

    Parameters
    ----------
    index : int
        From 0.
    kind : str
        As `bench.stops.Stop` has it.
    gap_mm : float
        The gap.
    stage_mm : float or None
        Position in the stage's own frame; None on a bench that was never measured.
    move_mm : float
        Distance from the step before (from the farthest gap, for the first).
    time_s : float
        Estimate of the whole step, with the rod settling in the fixed time.
    settings : mapping of str to float
        What other axes are set to.
    """

    index: int
    kind: str
    gap_mm: float
    stage_mm: float | None
    move_mm: float
    time_s: float
    settings: Mapping[str, float]


def plan_steps(plan: Plan) -> tuple[PlannedStep, ...]:
    """Return the steps of a plan with an estimate of their times.

    Limits have been checked when the plan was read (`config.read_plan`).
    """
    stage, limits, settle = plan.rig.stage, plan.rig.limits, plan.settle
    still_s = max(settle.window_s, settle.frames * _FRAME_S)
    fixed_s = (
        settle.time_s + still_s + plan.model.flux.samples * _SAMPLE_S
        + plan.model.photograph.frames * _FRAME_S + _RECORD_S
        + plan.model.photograph.series * plan.model.photograph.interval_s
    )  # fmt: skip
    acceleration = stage.acceleration_mm_s2 or 10.0
    speed_mm_s = stage.feed_mm_min / 60.0
    here_mm, zero = limits.max_gap_mm, stage.gap_at_zero_mm
    steps = []
    for index, stop in enumerate(plan.stops):
        gap_mm = stop.gap_mm
        move_mm = here_mm - gap_mm
        move_s = (
            abs(move_mm) / speed_mm_s + speed_mm_s / acceleration if move_mm else 0.0
        )
        steps.append(
            PlannedStep(
                index=index,
                kind=stop.kind,
                settings=stop.settings,
                gap_mm=gap_mm,
                move_mm=move_mm,
                time_s=move_s + fixed_s,
                stage_mm=None if zero is None else (gap_mm - zero) / stage.direction,
            )
        )
        here_mm = gap_mm
    return tuple(steps)


def homing_s(plan: Plan) -> float:
    """Return an estimate of the time of homing: the whole travel at the usual rate."""
    travel_mm = plan.rig.stage.travel_mm or plan.rig.limits.max_gap_mm
    return travel_mm / _HOME_FEED_MM_MIN * 60.0
