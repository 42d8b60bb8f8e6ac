"""The path of a magnet, or of a uniform field, that leads a rod through a lumen.

From insertion to insertion a few fields near the last one are tried: the rod is pushed
on in each from where it is, and the fields are kept in which the tip stays nearest to
where it is to go, and the walls are pressed least; from each of them it goes on (a beam
search). A bench can only change its field so fast: the fields tried are those it can
reach.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...core.checks import positive
from ...core.errors import InputError, SolverError
from ...core.specimen import Specimen
from ..fields import Field
from ..tube.tube import Tube
from .case import FieldOfWay
from .in_plane import PlanarWalk
from .lumen import Gate, Lumen
from .passage import Passage
from .poses import KEYS, moving
from .solver import navigate, planar_walk

PRESS_MM_PER_MN = 1.0
"""How far off the tip may be for a milli-newton less on the walls."""
MOVE_MM = 0.05
"""And for each number of the field that need not change: no zigzag without a reason."""
STARTS = 5
"""Values of each number of the field at which a way may begin, if any may."""
KEPT = 6
"""Ways that go on from pose to pose."""
Poses = tuple[dict[str, float], ...]


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
    start: dict[str, float] | None = None,
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
    start : dict, optional
        The first pose: a value for each key of `reach`. If not given, it may be any:
        five values of each are tried.
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
    given = keys if start is None else sorted(start)
    if not keys or set(keys) - set(known) or given != keys:
        raise InputError(
            f"reach and start must have the same of {', '.join(known)}; instead "
            f"received {keys} and {given}"
        )
    if isinstance(lumen, Tube):
        raise InputError(
            f"lumen must be planar to steer in; instead received tube {lumen.name!r}, "
            "which has one way only: give `navigate` its poses"
        )
    goal = _gate(lumen, gate)
    if field is None and "angle_deg" not in keys:
        start = None if start is None else start | {"angle_deg": angle_deg}
        reach = reach | {"angle_deg": Reach(low=angle_deg, high=angle_deg, change=1.0)}
    positive(every_mm, "every_mm", "mm")
    longest_mm = specimen.length_mm
    ways: list[tuple[float, Poses, PlanarWalk]] = []
    for first in _starts(reach) if start is None else [start]:
        poses: Poses = ({"insertion_mm": 0.0} | first,)
        walk = planar_walk(
            specimen, lumen, moving(field, poses), step_mm=step_mm, friction=friction
        )
        ways.append((0.0, poses, walk))
    passed: list[tuple[float, Poses, PlanarWalk]] = []
    while ways and not passed and ways[0][1][-1]["insertion_mm"] < longest_mm:
        at_mm = min(ways[0][1][-1]["insertion_mm"] + every_mm, longest_mm)
        ways = _longer(ways, field, reach, goal, at_mm)
        passed = [way for way in ways if gate in _gates(way[2])]
    best = min(passed or ways, key=lambda way: way[0], default=None)
    if best is None or not passed:
        off_mm = math.inf if best is None else _off(best[2], goal)
        raise _out_of_reach(specimen, lumen, gate, off_mm)
    poses = best[1]
    final = navigate(
        specimen, lumen, moving(field, poses), way_mm=poses[-1]["insertion_mm"],
        step_mm=0.5 * step_mm, friction=friction, refine=False,
    )  # fmt: skip
    if gate not in final.gates:
        raise _out_of_reach(specimen, lumen, gate, _off(best[2], goal))
    return Steered(poses=poses, passage=final)


def _starts(reach: dict[str, Reach]) -> list[dict[str, float]]:
    """Return poses to begin with, all over the reach."""
    ranges = [
        dict.fromkeys(np.linspace(r.low, r.high, STARTS).tolist())
        for r in reach.values()
    ]
    return [
        dict(zip(reach, values, strict=True)) for values in itertools.product(*ranges)
    ]


def _longer(
    ways: Sequence[tuple[float, Poses, PlanarWalk]],
    field: Field | None,
    reach: dict[str, Reach],
    goal: Gate,
    at_mm: float,
) -> list[tuple[float, Poses, PlanarWalk]]:
    """Push the rod on from each way in all fields that can be reached; keep the best.

    Ways whose fields end alike are one: only the better goes on.
    """
    found: dict[tuple[float, ...], tuple[float, Poses, PlanarWalk]] = {}
    for _, poses, walk in ways:
        for values in itertools.product(*(reach[k].near(poses[-1][k]) for k in reach)):
            pose = {"insertion_mm": at_mm} | dict(zip(reach, values, strict=True))
            longer = (*poses, pose)
            other = _branched(walk, moving(field, longer))
            if not other.go_to(at_mm):
                continue
            moved = sum(pose[key] != poses[-1][key] for key in reach)
            cost = _cost(other, goal) + MOVE_MM * moved
            if values not in found or cost < found[values][0]:
                found[values] = cost, longer, other
    return sorted(found.values(), key=lambda way: way[0])[:KEPT]


def _branched(walk: PlanarWalk, field: FieldOfWay) -> PlanarWalk:
    """Return another walk that has come so far, and goes on in another field."""
    other = PlanarWalk(replace(walk.case, field=field), walk.step_mm, walk.limit_N)
    other.state, other.rubbed = walk.state, walk.rubbed
    other.steps, other.events = list(walk.steps), list(walk.events)
    return other


def _out_of_reach(
    specimen: Specimen, lumen: Lumen, gate: str, near_mm: float
) -> SolverError:
    return SolverError(
        f"no fields within reach lead {specimen.name!r} through gate {gate!r} of "
        f"lumen {lumen.name!r}: the tip comes within {near_mm:.3g} mm of it"
    )


def _gate(lumen: Lumen, name: str) -> Gate:
    for gate in lumen.gates:
        if gate.name == name:
            return gate
    names = ", ".join(gate.name for gate in lumen.gates) or "none"
    raise InputError(
        f"gate must be a gate of the lumen {lumen.name!r}, which has {names}; instead "
        f"received {name!r}"
    )


def _gates(walk: PlanarWalk) -> list[str]:
    return [event.what for event in walk.events if event.kind == "gate"]


def _off(walk: PlanarWalk, gate: Gate) -> float:
    """Return how far the tip is from the middle of a gate, in mm."""
    middle = 0.5 * (np.array(gate.from_mm) + np.array(gate.to_mm))
    return float(math.dist(walk.steps[-1].tip_mm, middle))


def _cost(walk: PlanarWalk, gate: Gate) -> float:
    """Return how far a way is from the gate, and what it presses, in mm."""
    if gate.name in _gates(walk):
        most_N = max(step.wall_N for step in walk.steps)
        return -1e3 + 1e3 * PRESS_MM_PER_MN * most_N
    return _off(walk, gate) + 1e3 * PRESS_MM_PER_MN * walk.steps[-1].wall_N


def poses_text(steered: Steered) -> str:
    """Return the poses as a file that `read_poses` reads."""
    lines = []
    for pose in steered.poses:
        lines += ["[[pose]]", *(f"{name} = {value!r}" for name, value in pose.items())]
        lines.append("")
    return "\n".join(lines)


def plan_of(
    steered: Steered,
    *,
    name: str,
    specimen_file: str,
    rig_file: str,
    axes: Sequence[str] = (),
    lumen_file: str = "",
    wall_height_mm: float = 0.0,
) -> str:
    """Return a plan that the rig can run: the gaps, in the order of the poses.

    Parameters
    ----------
    steered : Steered
        Its poses must have `gap_mm`.
    name, specimen_file, rig_file : str
        Of the plan, and the files it names.
    axes : sequence of str
        Axes of the rig that the plan may set: ``insertion_mm`` feeds the rod,
        ``axis_angle_deg`` turns the magnet. Without ``insertion_mm`` a hand feeds it.
    lumen_file, wall_height_mm : str, float
        The channel, for its table; none without a feeding axis.

    Raises
    ------
    InputError
        If the poses have no gaps, the magnet turns without an axis for it, or the gaps
        rise while a hand feeds the rod.
    """
    poses = steered.poses
    if any("gap_mm" not in pose for pose in poses):
        raise InputError(
            "a plan needs poses with gap_mm; instead received poses of a uniform field"
        )
    turns = len({pose.get("axis_angle_deg") for pose in poses}) > 1
    if turns and "axis_angle_deg" not in axes:
        raise InputError(
            "a plan needs a magnet that does not turn, or an axis axis_angle_deg of "
            "the rig; instead received poses that turn it, and no such axis"
        )
    head = [
        f'name = "{name}"',
        f'specimen = "{specimen_file}"',
        f'rig = "{rig_file}"',
    ]
    if "insertion_mm" not in axes:
        return "\n".join([*head, *_by_hand(poses), ""])
    fed = poses[1:]
    head += [f"gaps_mm = {[pose['gap_mm'] for pose in fed]}", 'order = "free"', ""]
    for axis in axes:
        if axis in fed[0]:
            values = [pose[axis] for pose in fed]
            head += ["[[along]]", f'axis = "{axis}"', f"values = {values}", ""]
    head += ["[lumen]", f'file = "{lumen_file}"', f"wall_height_mm = {wall_height_mm}"]
    return "\n".join([*head, ""])


def _by_hand(poses: Poses) -> list[str]:
    """Return the lines of a plan for a rod that a hand feeds."""
    gaps = [pose["gap_mm"] for pose in poses]
    if any(b > a for a, b in itertools.pairwise(gaps)):
        raise InputError(
            "a plan for a rod that a hand feeds needs gaps that never rise; instead "
            f"received {gaps} mm; an axis insertion_mm of the rig lifts that"
        )
    when = [
        f"#   {pose['insertion_mm']:6.2f} mm in: {pose['gap_mm']:g} mm"
        for pose in poses
    ]
    kept = list(dict.fromkeys(gaps))
    return [
        "# Push the rod by hand; gap at each insertion:",
        *when,
        f"gaps_mm = {kept}",
    ]
