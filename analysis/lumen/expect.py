"""What the simulator says of a rod that was fed through a lumen, step by step."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...sim import MagnetField, Support, UniformField
from ...sim.navigate import Lumen, Passage, crosses, moving, navigate
from ...sim.navigate import Step as LumenStep
from ..runs.data import RunData, Step
from .contacts import HOLE_MM, Fed

Array = NDArray[np.float64]

STEP_MM = 0.5
NO_WEIGHT = Support()
POSE = ("gap_mm", "axis_angle_deg")
"""What moves the run's magnet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """A photographed rod held against the simulated one.

    Parameters
    ----------
    rms_mm, max_mm : float
        Distance across the simulated axis.
    tip_mm : float
        Distance of the tips.
    found, missed, extra : int
        Simulated contacts that are measured, those that are not, and measured ones that
        are not simulated: within 1 mm along the rod, on the same wall.
    """

    rms_mm: float
    max_mm: float
    tip_mm: float
    found: int
    missed: int
    extra: int


def fed_mm_of(step: Step) -> float:
    """Return how far the rod was fed in, as the run recorded it."""
    return float(step.settings["insertion_mm"])


def fed_steps(run: RunData) -> list[Step]:
    """Return the steps in which the rod was in the lumen."""
    return [step for step in run.steps if "insertion_mm" in step.settings]


def simulated(run: RunData, lumen: Lumen, friction: float) -> Passage:
    """Push the nominal rod through the lumen, in the field of the run's magnet.

    Raises
    ------
    InputError
        If the rod was pulled back on the way: it would not come the way it went.
    """
    steps = fed_steps(run)
    at = [fed_mm_of(step) for step in steps]
    if not at or any(b <= a for a, b in itertools.pairwise(at)):
        raise InputError(
            f"{run.path}: insertion_mm must rise from step to step to be simulated; "
            f"instead the run has {at} mm"
        )
    field: Any = UniformField(flux_mT=0.0)
    if run.magnet is not None:
        poses = [
            {"insertion_mm": mm, "gap_mm": step.gap_mm}
            | {k: v for k, v in step.settings.items() if k in POSE}
            for mm, step in zip(at, steps, strict=True)
        ]
        start = MagnetField(magnet=run.magnet, gap_mm=steps[0].gap_mm)
        field = moving(start, poses)
    return navigate(
        run.specimen, lumen, field, way_mm=at, step_mm=STEP_MM, friction=friction,
        support=run.support if run.support.in_plane else NO_WEIGHT, refine=False,
    )  # fmt: skip


def step_at(passage: Passage, fed_mm: float) -> LumenStep | None:
    """Return the step at an insertion; None if the rod did not come so far."""
    near = min(passage.steps, key=lambda step: abs(step.insertion_mm - fed_mm))
    return near if abs(near.insertion_mm - fed_mm) < 1e-6 else None


def gates_passed(lumen: Lumen, tips_mm: Sequence[tuple[float, float]]) -> list[str]:
    """Return the gates that a tip passed between its places, in order."""
    return [
        gate.name
        for before, after in itertools.pairwise(tips_mm)
        for gate in lumen.gates
        if crosses(gate, before, after)
    ]


def agreement(seen: Fed, step: LumenStep) -> Agreement:
    """Hold a measured rod against a simulated one."""
    inside = seen.s_mm > 0.0
    s = seen.s_mm[inside]
    x, y, theta = (np.interp(s, step.s_mm, row) for row in step.shape[:3])
    dx, dy = seen.points_mm[inside].T - np.array([x, y])
    across = -np.sin(theta) * dx + np.cos(theta) * dy
    found = [
        any(
            touch.wall == contact.wall
            and touch.from_mm - HOLE_MM < contact.s_mm < touch.to_mm + HOLE_MM
            for touch in seen.touches
        )
        for contact in step.contacts
    ]
    extra = [
        not any(
            touch.wall == contact.wall
            and touch.from_mm - HOLE_MM < contact.s_mm < touch.to_mm + HOLE_MM
            for contact in step.contacts
        )
        for touch in seen.touches
    ]
    return Agreement(
        rms_mm=float(np.sqrt(np.mean(across**2))),
        max_mm=float(np.abs(across).max()),
        tip_mm=math.dist(seen.points_mm[-1], step.tip_mm),
        found=sum(found),
        missed=len(found) - sum(found),
        extra=sum(extra),
    )
