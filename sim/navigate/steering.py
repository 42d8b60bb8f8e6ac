"""The path of a magnet, or of a uniform field, that leads a rod through a lumen.

From insertion to insertion a few fields near the last one are tried: the rod is pushed
on in each from where it is, and the field is kept in which the tip stays nearest to
where it is to go, and the walls are pressed least. A bench can only change its field so
fast: the fields tried are those it can reach.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.checks import positive
from ...core.errors import InputError, SolverError
from ...core.specimen import Specimen
from ..fields import Field
from ..tube.tube import Tube
from .lumen import Gate, Lumen
from .passage import INSERTED, Passage
from .poses import KEYS, moving
from .solver import navigate

PRESS_MM_PER_MN = 1.0
"""How far off the tip may be for a milli-newton less on the walls."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """What a bench can do with one number of its field.

    Parameters
    ----------
    low, high : float
        Its range.
    change : float
        Most that it changes from one pose to the next.
    falls : bool
        Whether it may only fall, as the gap of a stage that approaches.
    """

    low: float
    high: float
    change: float
    falls: bool = False

    def near(self, value: float) -> tuple[float, ...]:
        """Return a smaller, the same and a larger value that can be reached."""
        more = () if self.falls else (value + self.change,)
        tried = (value - self.change, value, *more)
        return tuple(dict.fromkeys(min(max(v, self.low), self.high) for v in tried))


@dataclass(frozen=True, slots=True, kw_only=True)
class Steered:
    """A steered way.

    Parameters
    ----------
    poses : tuple of dict
        What `moving` takes: `insertion_mm` and the field's numbers.
    passage : Passage
        The rod's way under them, on fine steps.
    """

    poses: tuple[dict[str, float], ...]
    passage: Passage


def steer(
    specimen: Specimen,
    lumen: Lumen | Tube,
    field: Field | None,
    reach: dict[str, Reach],
    *,
    gate: str,
    start: dict[str, float],
    every_mm: float = 3.0,
    step_mm: float = 1.0,
    friction: float = 0.0,
    angle_deg: float = 90.0,
) -> Steered:
    """Find poses of the field that lead the tip through a gate.

    Parameters
    ----------
    specimen, lumen
        As of `navigate`.
    field : Field or None
        Magnets that the poses move; None for a uniform field.
    reach : dict of Reach
        Of `flux_mT` and `angle_deg`, or of `gap_mm` and `axis_angle_deg`.
    gate : str
        The gate to pass.
    start : dict
        The first pose: a value for each key of `reach`.
    every_mm : float
        Distance of poses along the insertion.
    step_mm : float
        Steps while trying; the answer is on half of them.
    friction : float
        Coefficient of friction.
    angle_deg : float
        Direction of a uniform field whose angle the poses do not change.

    Raises
    ------
    InputError
        If a key is unknown or a gate is not the lumen's.
    SolverError
        If no fields within reach lead the tip through the gate.
    """
    keys = sorted(reach)
    known = KEYS[field is None]
    if not keys or set(keys) - set(known) or set(start) != set(keys):
        raise InputError(
            f"reach and start must have the same of {', '.join(known)}; instead "
            f"received {keys} and {sorted(start)}"
        )
    if isinstance(lumen, Tube):
        raise InputError(
            f"lumen must be planar to steer in; instead received tube {lumen.name!r}, "
            "which has one way only: give `navigate` its poses"
        )
    goal = _gate(lumen, gate)
    if field is None and "angle_deg" not in keys:
        start = start | {"angle_deg": angle_deg}
        reach = reach | {"angle_deg": Reach(low=angle_deg, high=angle_deg, change=1.0)}
        keys = sorted(reach)
    positive(every_mm, "every_mm", "mm")
    longest_mm = specimen.length_mm
    poses = [{"insertion_mm": 0.0} | start]
    options: dict[str, Any] = {"friction": friction, "refine": False}
    while poses[-1]["insertion_mm"] < longest_mm:
        at_mm = min(poses[-1]["insertion_mm"] + every_mm, longest_mm)
        tried = []
        for values in itertools.product(*(reach[k].near(poses[-1][k]) for k in keys)):
            pose = {"insertion_mm": at_mm} | dict(zip(keys, values, strict=True))
            way = _way(specimen, lumen, field, [*poses, pose], at_mm, step_mm, options)
            if way is not None:
                tried.append((_cost(way, goal), tuple(pose.items()), way))
        if not tried:
            break
        _, items, way = min(tried, key=lambda one: one[0])
        poses.append(dict(items))
        if gate in way.gates:
            break
    last_mm = poses[-1]["insertion_mm"]
    final = _way(
        specimen, lumen, field, poses, max(last_mm, step_mm), 0.5 * step_mm, options
    )
    if final is None or gate not in final.gates:
        near_mm = math.inf if final is None else _off(final, goal)
        raise SolverError(
            f"no fields within reach lead {specimen.name!r} through gate {gate!r} of "
            f"lumen {lumen.name!r}: the tip comes within {near_mm:.3g} mm of it"
        )
    return Steered(poses=tuple(poses), passage=final)


def _way(
    specimen: Specimen,
    lumen: Lumen | Tube,
    field: Field | None,
    poses: Sequence[dict[str, float]],
    to_mm: float,
    step_mm: float,
    options: dict[str, Any],
) -> Passage | None:
    """Return the rod's way to an insertion, or None if it does not get there."""
    try:
        way = navigate(
            specimen, lumen, moving(field, poses), way_mm=to_mm, step_mm=step_mm,
            **options,
        )  # fmt: skip
    except SolverError:
        return None
    return way if way.outcome == INSERTED else None


def _gate(lumen: Lumen | Tube, name: str) -> Gate:
    for gate in lumen.gates:
        if gate.name == name:
            return gate
    names = ", ".join(gate.name for gate in lumen.gates) or "none"
    raise InputError(
        f"gate must be one of lumen {lumen.name!r}'s, {names}; instead received "
        f"{name!r}"
    )


def _off(way: Passage, gate: Gate) -> float:
    """Return how far the tip is from the middle of a gate, in mm."""
    middle = 0.5 * (np.array(gate.from_mm) + np.array(gate.to_mm))
    return float(math.dist(way.steps[-1].tip_mm, middle))


def _cost(way: Passage, gate: Gate) -> float:
    """Return how far a way is from the gate, and what it presses, in mm."""
    if gate.name in way.gates:
        return -1e3 + 1e3 * PRESS_MM_PER_MN * way.most("wall_N")
    return _off(way, gate) + 1e3 * PRESS_MM_PER_MN * way.steps[-1].wall_N


def poses_text(steered: Steered) -> str:
    """Return the poses as a file that `read_poses` reads."""
    lines = []
    for pose in steered.poses:
        lines += ["[[pose]]", *(f"{name} = {value!r}" for name, value in pose.items())]
        lines.append("")
    return "\n".join(lines)


def plan_of(steered: Steered, *, name: str, specimen_file: str, rig_file: str) -> str:
    """Return a plan that the rig can run: the gaps, in the order of the poses.

    Parameters
    ----------
    steered : Steered
        Its poses must have `gap_mm`, never rising: the stage only approaches.
    name, specimen_file, rig_file : str
        Of the plan, and the files it names.

    Raises
    ------
    InputError
        If the poses have no gaps, the gaps rise, or the magnet also turns.
    """
    poses = steered.poses
    if any("gap_mm" not in pose for pose in poses):
        raise InputError(
            "a plan needs poses with gap_mm; instead received poses of a uniform field"
        )
    gaps = [pose["gap_mm"] for pose in poses]
    turns = len({pose.get("axis_angle_deg") for pose in poses}) > 1
    if turns or any(b > a for a, b in itertools.pairwise(gaps)):
        raise InputError(
            "a plan needs gaps that never rise and a magnet that does not turn; "
            f"instead received gaps of {gaps} mm"
        )
    kept = list(dict.fromkeys(gaps))
    when = [
        f"#   {pose['insertion_mm']:6.2f} mm in: {pose['gap_mm']:g} mm"
        for pose in poses
    ]
    return "\n".join(
        [
            f'name = "{name}"',
            f'specimen = "{specimen_file}"',
            f'rig = "{rig_file}"',
            "# Push the rod by hand; gap at each insertion:",
            *when,
            f"gaps_mm = {kept}",
            "",
        ]
    )
