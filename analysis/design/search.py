"""Design backwards: from a wanted shape to several rods that can be made and give it.

Sobol points over what can be made are solved together; the nearest, spread apart, start
a Levenberg-Marquardt search in the unit cube (all of them in one batch, derivatives by
forward differences, coordinates held at the walls they press on). Of what hits the
goal the designs least sensitive to fabrication scatter are taken, each apart from the
others, and each solved again by itself, with the digits that are printed.

Several goals, each in its own field, are one search: a path of tips, say.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...core.checks import within
from ...core.errors import InputError, SolverError
from ...core.notebook import Tabular, axes_or_new
from ...core.specimen import Specimen
from ...core.specimen_file import specimen_dict
from ...sim import Field, solve, solve_shapes
from ..library.space import sobol_points
from . import goals
from .goals import Goal
from .makeable import (
    Candidates,
    Makeable,
    binding,
    choices,
    designs_in,
    dimension,
    mixture_of,
    rods,
    scattered,
    specimen_of,
)  # fmt: skip

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

STARTS = 2048
POLISHED = 96
STEPS = 12
APART, NEAREST_APART = 1.0, 0.3
"""Distance of distinct designs, in units of 3 mm of a unit length, a third of a modulus
or a tenth of the side (`_features`); the second where there are no such."""
SAMPLES, SHOWN = 4096, 256
"""Rods that fabrication makes of a design to tell its tolerance, and how many of them
are drawn. Those that rank designs are others: the best of several would look too good
(winner's curse)."""
Task = tuple[Goal, Field]
_DIFFERENCE = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class Design(Tabular):
    """A rod that gives the wanted shape.

    Parameters
    ----------
    specimen : Specimen
    achieved : float
        By a direct solve of this specimen: radius in mm, tip angle in degrees, or the
        distance in mm from a wanted tip or curve.
    error : float
        Percent of a wanted radius or angle; mm for a tip or curve.
    tolerance : float
        Half of the interval that holds 95 % of the rods that fabrication scatter makes
        of it, in the unit of `achieved`; for a tip or curve the distance that 95 % of
        them stay within.
    tip_mm, tip_angle_deg, radius_mm : tuple and floats
        Of the direct solve.
    tip_tolerance_mm : float
        Distance from `tip_mm` that 95 % of the scattered rods stay within.
    more : tuple of Design
        The same rod in the other fields, where several goals were given.
    shape_mm : ndarray, shape (61, 2)
    band_mm : ndarray, shape (samples, 61, 2)
        Shapes under fabrication scatter.
    """

    specimen: Specimen
    achieved: float
    error: float
    tolerance: float
    tip_mm: tuple[float, float]
    tip_angle_deg: float
    radius_mm: float
    tip_tolerance_mm: float
    shape_mm: Array
    band_mm: Array
    more: tuple[Design, ...] = ()

    def to_dataframe(self) -> pd.DataFrame:
        """Return the design as a table of one row."""
        import pandas as pd

        row: dict[str, float] = {"side_mm": self.specimen.side_mm}
        for i, section in enumerate(self.specimen.sections, start=1):
            row |= {f"length{i}_mm": section.length_mm, f"E{i}_MPa": section.E_MPa}
        row |= {
            "remanence_mT": self.specimen.remanence_mT,
            "achieved": self.achieved,
            "error": self.error,
            "tolerance": self.tolerance,
            "tip_x_mm": self.tip_mm[0],
            "tip_y_mm": self.tip_mm[1],
            "tip_angle_deg": self.tip_angle_deg,
            "radius_mm": self.radius_mm,
        }
        return pd.DataFrame([row])

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the shape and what fabrication scatter makes of it; return the axes."""
        ax = axes_or_new(ax, "x (mm)", "y (mm)")
        for shape in self.band_mm[:40]:
            ax.plot(*shape.T, color="C0", alpha=0.1, linewidth=0.6)
        ax.plot(*self.shape_mm.T, color="C0", label=self.specimen.name)
        ax.set_aspect("equal", adjustable="datalim")
        return ax


def find_designs(
    goal: Goal, field: Field, makeable: Makeable, *, count: int = 5, seed: int = 0
) -> list[Design]:
    """Return up to `count` distinct designs that meet a goal, best first.

    Designs are ranked by error where it matters (in steps of a tenth of what counts as
    a hit), then by tolerance.

    Parameters
    ----------
    goal : Goal
    field : Field
        Uniform, or of any sources within the plane.
    makeable : Makeable
    count : int
    seed : int
        Of the Sobol points and of the scatter.

    Raises
    ------
    SolverError
        If no design meets the goal: how near one comes, and which limits bind.
    """
    return design_all([(goal, field)], makeable, count=count, seed=seed)


def design_all(
    tasks: Sequence[Task], makeable: Makeable, *, count: int = 5, seed: int = 0
) -> list[Design]:
    """Return up to `count` distinct designs that meet all goals, each in its own field.

    Parameters
    ----------
    tasks : sequence of (Goal, Field)
        A design's own numbers are those of the first, `Design.more` has the others.
    makeable, count, seed
        See `design`.

    Raises
    ------
    InputError
        If a rod shall bend in a uniform field along it, which bends none.
    SolverError
        If no design meets them all: how near one comes, and which limits bind.
    """
    count = int(within(count, 1, 100, "count", ""))
    for goal, field in tasks:
        _refuse_field_along(goal, field)
    found, norms = _search(tasks, makeable, seed)
    table = rods(makeable, found)
    rng = np.random.default_rng(seed)
    best = int(np.argmin(norms))
    first = _verified(tasks, specimen_of(table, best, "design"), makeable, rng)
    if first is None or _missed(first, tasks):
        worst = _missed(first, tasks) if first else None
        goal, near = worst or (tasks[0][0], first)
        raise SolverError(_unreachable(goal, makeable, table, best, near))
    hit = min(_relative(goal, goals.hit_limit(goal)) for goal, _ in tasks)
    good = np.flatnonzero(norms <= max(2.0 * norms[best], 0.2 * hit))
    spread = _spread(tasks, table, good, makeable)
    features = _features({name: values[good] for name, values in table.items()})
    picked = _distinct(features, spread, count)
    designs = []
    for i in good[picked]:
        one = _verified(tasks, specimen_of(table, int(i), "design"), makeable, rng)
        if one is not None and not _missed(one, tasks):
            designs.append(one)
    designs.sort(key=lambda one: _rank(one, tasks))
    return [
        _named(_verified(tasks, one.specimen, makeable, rng) or one, number, makeable)
        for number, one in enumerate(designs, start=1)
    ]


def _named(one: Design, number: int, makeable: Makeable) -> Design:
    """Return the design with its name and what it is mixed from."""
    specimen = replace(
        one.specimen,
        name=f"design {number}",
        recipe=tuple(mixture_of(makeable, one.specimen).items()),
    )
    more = tuple(replace(other, specimen=specimen) for other in one.more)
    return replace(one, specimen=specimen, more=more)


def _missed(one: Design, tasks: Sequence[Task]) -> tuple[Goal, Design] | None:
    """Return the goal that is missed most, None if all are met."""
    shares = [
        (stage.error / goals.hit_limit(goal), goal, stage)
        for (goal, _), stage in zip(tasks, (one, *one.more), strict=True)
    ]
    share, goal, stage = max(shares, key=lambda item: item[0])
    return (goal, stage) if share > 1.0 else None


def _rank(one: Design, tasks: Sequence[Task]) -> tuple[int, float]:
    stages = list(zip(tasks, (one, *one.more), strict=True))
    worst = max(stage.error / goals.hit_limit(goal) for (goal, _), stage in stages)
    return round(10.0 * worst), sum(stage.tolerance for _, stage in stages)


def _relative(goal: Goal, limit: float) -> float:
    """Return what counts as a hit in the units of the residuals."""
    if goal.kind in ("radius", "angle"):
        return limit / 100.0
    length_mm = goals.curve_length_mm(goal)
    return limit / (length_mm or max(math.hypot(*goal.wanted), 1.0))


def _evaluate(
    tasks: Sequence[Task], makeable: Makeable, candidates: Candidates
) -> Array:
    return _residuals(tasks, rods(makeable, candidates))


def _residuals(tasks: Sequence[Task], rods_: dict[str, Array]) -> Array:
    """Return the residuals of all goals side by side, shape (n, m)."""
    parts = [
        goals.residuals(goal, solve_shapes(designs_in(rods_, field)).points)
        for goal, field in tasks
    ]
    return np.concatenate(parts, axis=1)


def _search(
    tasks: Sequence[Task], makeable: Makeable, seed: int
) -> tuple[Candidates, Array]:
    d = dimension(makeable)
    u = sobol_points(d + 1, 0, STARTS, seed)
    kinds = len(choices(makeable))
    choice = np.minimum((u[:, d] * kinds).astype(np.int64), kinds - 1)
    starts = Candidates(z=u[:, :d], choice=choice)
    r = _evaluate(tasks, makeable, starts)
    norms = np.linalg.norm(r, axis=1)
    keep = _spread_out(starts, np.argsort(norms)[: 6 * POLISHED], POLISHED)
    return _polish(tasks, makeable, starts.take(keep), r[keep])


def _spread_out(candidates: Candidates, order: NDArray, count: int) -> NDArray:
    """Take the nearest third, then those farthest from what is taken."""
    taken = list(order[: count // 3])
    rest = order[count // 3 :]
    z = np.column_stack([candidates.z, 3.0 * candidates.choice])
    distance = np.full(len(rest), np.inf)
    for i in taken:
        distance = np.minimum(distance, np.linalg.norm(z[rest] - z[i], axis=1))
    while len(taken) < min(count, len(order)):
        far = int(np.argmax(distance))
        taken.append(rest[far])
        step = np.linalg.norm(z[rest] - z[rest[far]], axis=1)
        distance = np.minimum(distance, step)
    return np.array(taken)


def _features(rods_: dict[str, Array]) -> Array:
    """Return coordinates in which distances tell designs apart."""
    return np.column_stack(
        [
            np.log(rods_["E_MPa"]) / 0.3,
            rods_["length_mm"] / 3.0,
            np.log(rods_["side_mm"]) / 0.1,
            np.log(np.abs(rods_["remanence_mT"])) / 0.1,
        ]
    )


def _polish(
    tasks: Sequence[Task], makeable: Makeable, at: Candidates, r: Array
) -> tuple[Candidates, Array]:
    """Run Levenberg-Marquardt on all candidates together; return them and |r|."""
    n = len(at.z)
    z, damping = at.z.copy(), np.full(n, 1e-3)
    norms = np.linalg.norm(r, axis=1)
    live = np.arange(n)
    for _ in range(STEPS):
        J = _slopes(
            tasks,
            makeable,
            Candidates(z=z[live], choice=at.choice[live]),
            r[live],
        )
        step = _steps(J, r[live], z[live], damping[live])
        trial = np.clip(z[live] + step, 0.0, 1.0)
        new = _evaluate(tasks, makeable, Candidates(z=trial, choice=at.choice[live]))
        size = np.linalg.norm(new, axis=1)
        better = size < norms[live]
        damping[live] = np.where(better, damping[live] * 0.2, damping[live] * 8.0)
        won = live[better]
        z[won], r[won], norms[won] = trial[better], new[better], size[better]
        live = np.flatnonzero((norms > 1e-6) & (damping < 1e6))
        if len(live) == 0:
            break
    return Candidates(z=z, choice=at.choice), norms


def _slopes(
    tasks: Sequence[Task], makeable: Makeable, at: Candidates, r: Array
) -> Array:
    """Return dr/dz, shape (n, m, d), by differences that stay inside the cube."""
    n, d = at.z.shape
    step = np.where(at.z < 0.5, _DIFFERENCE, -_DIFFERENCE)
    moved = np.repeat(at.z[:, None, :], d, axis=1)
    moved[:, range(d), range(d)] += step
    many = Candidates(z=moved.reshape(n * d, d), choice=np.repeat(at.choice, d))
    new = _evaluate(tasks, makeable, many).reshape(n, d, -1)
    slopes: Array = ((new - r[:, None, :]) / step[:, :, None]).transpose(0, 2, 1)
    return slopes


def _steps(J: Array, r: Array, z: Array, damping: Array) -> Array:
    """Return damped steps; coordinates that press on a wall are held."""
    gradient = np.einsum("nmd,nm->nd", J, r)
    held = ((z <= 0.0) & (gradient > 0.0)) | ((z >= 1.0) & (gradient < 0.0))
    J = np.where(held[:, None, :], 0.0, J)
    square = np.einsum("nmd,nme->nde", J, J)
    scale = np.einsum("ndd->n", square) + 1e-12
    d = z.shape[1]
    square += (damping * scale)[:, None, None] * np.eye(d)
    right = -np.einsum("nmd,nm->nd", J, r)[:, :, None]
    step: Array = np.linalg.solve(square, right)[:, :, 0]
    return step


def _spread(
    tasks: Sequence[Task], table: dict[str, Array], good: NDArray, makeable: Makeable
) -> Array:
    """Return how much fabrication scatter moves each goal, to first order."""
    scatter = makeable.scatter
    base = {name: values[good] for name, values in table.items()}
    r0 = _residuals(tasks, base)
    variance = np.zeros(len(good))
    share = {"E_MPa": scatter.E_percent, "remanence_mT": scatter.remanence_percent}
    for name, values in base.items():
        columns = [...] if values.ndim == 1 else list(range(values.shape[1]))
        for column in columns:
            moved = values.copy()
            at = column if values.ndim == 1 else (slice(None), column)
            fixed = {"side_mm": scatter.side_mm, "length_mm": scatter.length_mm}
            sd = fixed.get(name, np.abs(values[at]) * share.get(name, 0.0) / 100.0)
            moved[at] = values[at] + sd
            change = _residuals(tasks, {**base, name: moved}) - r0
            variance += np.sum(change**2, axis=1)
    return np.sqrt(variance)


def _distinct(z: Array, spread: Array, count: int) -> list[int]:
    """Take the least sensitive designs that are apart from those taken before."""
    order = np.argsort(spread, kind="stable")
    apart = APART
    while True:
        taken: list[int] = []
        for i in order:
            if len(taken) < count and all(
                np.linalg.norm(z[i] - z[j]) >= apart for j in taken
            ):
                taken.append(int(i))
        if len(taken) == count or apart <= NEAREST_APART:
            return taken
        apart = max(0.7 * apart, NEAREST_APART)


def _verified(
    tasks: Sequence[Task],
    specimen: Specimen,
    makeable: Makeable,
    rng: np.random.Generator,
) -> Design | None:
    """Solve a design by itself in each field, as it is and as it will be made."""
    many = scattered(specimen, makeable.scatter, SAMPLES, rng)
    stages = [_stage(goal, field, specimen, many) for goal, field in tasks]
    known = [stage for stage in stages if stage is not None]
    if len(known) < len(stages):
        return None
    return replace(known[0], more=tuple(known[1:]))


def _stage(
    goal: Goal, field: Field, specimen: Specimen, many: dict[str, Array]
) -> Design | None:
    line = solve(specimen, field).centreline
    if line is None:
        return None
    one = goals.shape_points(line)
    value = float(goals.achieved(goal, one)[0])
    shapes = solve_shapes(designs_in(many, field)).points
    shapes = shapes[np.isfinite(shapes[:, -1, 0])]
    made = goals.achieved(goal, shapes)
    away = shapes[:, -1, 1:3] - np.array(line.tip_mm)
    if goal.kind in ("radius", "angle"):
        low, high = np.quantile(made, [0.025, 0.975])
        tolerance = float(high - low) / 2.0
    else:
        tolerance = float(np.quantile(made, 0.95))
    return Design(
        specimen=specimen,
        achieved=value,
        error=goals.error_of(goal, value),
        tolerance=tolerance,
        tip_mm=line.tip_mm,
        tip_angle_deg=line.tip_angle_deg,
        radius_mm=float(goals.achieved(goals.radius_goal(1.0), one)[0]),
        tip_tolerance_mm=float(np.quantile(np.hypot(*away.T), 0.95)),
        shape_mm=line.points_mm,
        band_mm=shapes[:SHOWN, :, 1:3],
    )


def as_dict(found: Design, goal: Goal) -> dict[str, object]:
    """Return a design for machines; ``specimen`` has the keys of a specimen file."""
    unit = "percent" if goal.kind in ("radius", "angle") else "mm"
    data: dict[str, object] = {
        "specimen": specimen_dict(found.specimen),
        "achieved_radius_mm": found.radius_mm,
        "achieved_tip_mm": list(found.tip_mm),
        "achieved_tip_angle_deg": found.tip_angle_deg,
        f"error_{unit}": found.error,
        "tolerance_mm": found.tolerance,
        "tip_tolerance_mm": found.tip_tolerance_mm,
    }
    if goal.kind == "angle":
        data["tolerance_mm"] = found.tip_tolerance_mm
        data["tolerance_deg"] = found.tolerance
    if found.more:
        data["more"] = [
            {
                "achieved_tip_mm": list(one.tip_mm),
                f"error_{unit}": one.error,
                "tip_tolerance_mm": one.tip_tolerance_mm,
            }
            for one in found.more
        ]
    return data


def _refuse_field_along(goal: Goal, field: Field) -> None:
    uniform = field.uniform
    if goal.kind not in ("radius", "angle") or uniform is None:
        return
    if abs(math.sin(math.radians(uniform.angle_deg))) < 1e-9:
        raise InputError(
            f"a field at {uniform.angle_deg:g} deg runs along the rod and does not "
            f"bend it, so none gets {goal.words}; give a field across it, at 90 deg"
        )


def _unreachable(
    goal: Goal,
    makeable: Makeable,
    table: dict[str, Array],
    best: int,
    nearest: Design | None,
) -> str:
    limits = ", ".join(binding(makeable, table, best)) or "none of the limits alone"
    if nearest is None:
        return f"no rod that can be made gives {goal.words} and stays off the magnet"
    units = {"radius": "mm", "angle": "deg"}
    if goal.kind in units:
        near = f"the nearest is {nearest.achieved:.4g} {units[goal.kind]}"
    else:
        near = f"the nearest misses it by {nearest.achieved:.3g} mm"
    return (
        f"no rod that can be made gives {goal.words} in this field: {near}, "
        f"with {limits}"
    )
