"""Does grading help? Graded rods against uniform ones of the same tip compliance.

Both are pushed, held at their roots, through the same lumens with the same friction.

python examples/does_grading_help.py [folder]
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize

from magbend.core.specimen import Specimen
from magbend.sim import UniformField, gmc
from magbend.sim.navigate import (
    Gate,
    Lumen,
    Passage,
    Wall,
    channel,
    navigate,
    outline,
    polyline,
)

NOTHING = UniformField(flux_mT=0.0)
FRICTION = 0.2
WIDTH = 2.5
"""Of the lumens, in sides of the rod."""
TASKS = ("45 degrees", "90 degrees", "180 degrees", "S", "fork")
LIMIT = 50.0
"""A push this many times what the rod carries across a gap ends the attempt."""
STRAIN = 0.2
"""A rod whose outer fibre is strained more has folded, and has not passed."""


def tip_compliance(rod: Specimen) -> float:
    """Return the integral of (L - s)^2 / E, in mm3 / MPa: what a tip force bends."""
    ends = rod.length_mm - np.cumsum([0.0, *(s.length_mm for s in rod.sections)])
    E_MPa = np.array([section.E_MPa for section in rod.sections])
    return float(np.sum((ends[:-1] ** 3 - ends[1:] ** 3) / (3.0 * E_MPa)))


def uniform_like(rod: Specimen) -> Specimen:
    """Return the uniform rod that a force at the tip bends as much."""
    E_MPa = rod.length_mm**3 / 3.0 / tip_compliance(rod)
    sections = tuple(replace(section, E_MPa=E_MPa) for section in rod.sections)
    return replace(rod, name=f"uniform like {rod.name}", sections=sections)


def lumens(side_mm: float) -> dict[str, Lumen]:
    """Return what the rods are pushed through."""
    width_mm = WIDTH * side_mm
    legs = {
        "45 degrees": [(4.0, 0.0), (10.0, 45.0), (10.0, 0.0)],
        "90 degrees": [(4.0, 0.0), (13.0, 90.0), (8.0, 0.0)],
        "180 degrees": [(2.0, 0.0), (14.0, 180.0), (8.0, 0.0)],
        "S": [(4.0, 0.0), (8.0, 60.0), (8.0, -60.0), (5.0, 0.0)],
    }
    out = {
        name: channel(name, width_mm=width_mm, legs=path, mode="push")
        for name, path in legs.items()
    }
    half_mm = 0.5 * width_mm
    rise = math.tan(math.radians(30.0))

    def branch(sign: float) -> Wall:
        line = [(0.0, sign * half_mm), (8.0, sign * half_mm)]
        line.append((30.0, sign * (half_mm + 22.0 * rise)))
        return Wall("upper" if sign > 0.0 else "lower", polyline(line))

    # The carina stands a little to the side: the rod takes the upper branch.
    start_mm, low_mm = 8.0 + width_mm, -0.25 * side_mm
    carina = polyline(
        [
            (30.0, low_mm + (30.0 - start_mm) * rise),
            (start_mm, low_mm),
            (30.0, low_mm - (30.0 - start_mm) * rise),
        ]
    )
    end = Gate("end", (24.0, half_mm + 16.0 * rise), (24.0, (24.0 - start_mm) * rise))
    out["fork"] = Lumen(
        name="fork",
        walls=(branch(1.0), branch(-1.0), Wall("carina", carina)),
        inside_mm=(0.0, 0.0),
        mode="push",
        gates=(end,),
    )
    return out


def delivered_N(rod: Specimen) -> float:
    """Return the push at which a rod buckles across a gap, its tip on a smooth wall."""
    stop_mm = rod.length_mm - 0.5 * rod.side_mm
    line = [(0.0, 50.0), (stop_mm + 0.5 * rod.side_mm, 50.0)]
    wall = polyline([*line, *((x, -y) for x, y in reversed(line))])
    gap = Lumen(name="gap", walls=(Wall("wall", wall),), inside_mm=(1.0, 0.0))
    way_mm = (stop_mm, stop_mm + 0.002)
    return navigate(rod, gap, NOTHING, way_mm=way_mm, refine=False).steps[-1].push_N


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How a rod does a task; forces in mN."""

    task: str
    push_mN: float
    root_per_mm: float
    wall_mN: float
    reached_mm: float
    bow_mm: float
    strain: float
    passed: bool


def bow_mm(passage: Passage) -> float:
    """Return how far the rod ever was off its line before the mouth, in mm."""
    most = 0.0
    for step in passage.steps:
        x, y = step.shape[:2]
        inside = int(np.argmax(x >= 0.0))  # the first point within the lumen
        most = max(most, float(abs(y[:inside]).max(initial=0.0)))
    return most


def outcome(task: str, passage: Passage, side_mm: float) -> Outcome:
    """Return what is compared."""
    strain = 0.5 * side_mm * passage.most("most_curvature_per_mm")
    return Outcome(
        task=task,
        push_mN=1e3 * passage.most("push_N"),
        root_per_mm=passage.most("root_curvature_per_mm"),
        wall_mN=1e3 * passage.most("wall_N"),
        reached_mm=passage.reached_mm,
        bow_mm=bow_mm(passage),
        strain=strain,
        passed="end" in passage.gates and strain < STRAIN,
    )


def through(rod: Specimen, task: str) -> Passage:
    """Push a rod through the lumen of a task, up to what it can carry."""
    return navigate(
        rod, lumens(rod.side_mm)[task], NOTHING, friction=FRICTION, step_mm=0.25,
        push_limit_N=LIMIT * delivered_N(rod), refine=False,
    )  # fmt: skip


def tried(rod: Specimen, tasks: tuple[str, ...] = TASKS) -> dict[str, Outcome]:
    """Return how a rod does the tasks."""
    return {task: outcome(task, through(rod, task), rod.side_mm) for task in tasks}


def best_like(rod: Specimen, task: str) -> Specimen:
    """Return the grading, of the same tip compliance, that needs the least push.

    Over two ratios of moduli and two lengths of three sections.
    """
    lumen = lumens(rod.side_mm)[task]

    def made(z: np.ndarray) -> Specimen:
        share = np.exp([z[0], z[1], 0.0])
        length = rod.length_mm * share / share.sum()
        modulus = np.exp(np.clip([z[2] + z[3], z[3], 0.0], -3.0, 3.0))
        sections = tuple(
            replace(rod.sections[0], length_mm=float(part), E_MPa=float(E))
            for part, E in zip(length, modulus, strict=True)
        )
        plain = replace(rod, name=f"best for {task}", sections=sections)
        factor = tip_compliance(plain) / tip_compliance(rod)
        return replace(
            plain,
            sections=tuple(replace(s, E_MPa=factor * s.E_MPa) for s in sections),
        )

    def push(z: np.ndarray) -> float:
        passage = navigate(
            made(z), lumen, NOTHING, friction=FRICTION, step_mm=1.0,
            push_limit_N=0.3, refine=False,
        )  # fmt: skip
        return passage.most("push_N") * (1.0 if "end" in passage.gates else 10.0)

    found = minimize(
        push, np.zeros(4), method="Nelder-Mead",
        options={
            "maxfev": 100, "xatol": 0.02, "fatol": 1e-6,
            "initial_simplex": np.vstack([np.zeros(4), 0.7 * np.eye(4)]),
        },
    )  # fmt: skip
    return made(found.x)


def designed(rod: Specimen, task: str) -> Specimen:
    """Return what ``analysis design --lumen`` finds: least force on the walls."""
    from magbend.analysis import Makeable, design_through

    side = rod.side_mm
    found = design_through(
        lumens(side)[task], NOTHING, Makeable(side_mm=(side, side)), gate="end",
        stiffness_N_mm=side**4 / 12.0 / tip_compliance(rod), friction=FRICTION, count=1,
    )  # fmt: skip
    return found[0].specimen


def turn(ax: plt.Axes) -> None:
    """Draw GMC 2 and the uniform rod in the turn, where the latter bows out most."""
    task = "180 degrees"
    for wall in lumens(gmc(2).side_mm)[task].walls:
        ax.plot(*outline(wall.arcs).T, color="0.4", lw=1.2)
    bowed = through(uniform_like(gmc(2)), task)
    last_mm = bowed.steps[-1].insertion_mm
    for name, passage, colour in (
        ("GMC 2", through(gmc(2), task), "C0"),
        ("uniform", bowed, "C3"),
    ):
        step = min(passage.steps, key=lambda s: abs(s.insertion_mm - last_mm))
        label = f"{name}, {1e3 * step.push_N:.0f} mN"
        ax.plot(*step.shape[:2], color=colour, lw=2.5, label=label)
    ax.set_title(f"both pushed {last_mm:.0f} mm into a turn", fontsize=9)
    ax.set_aspect("equal")
    ax.legend(frameon=False, fontsize=8, loc="center left")


def main(folder: Path, numbers: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 7)) -> dict:
    """Draw the figure; return the outcomes of graded and uniform rods."""
    found = {n: (tried(gmc(n)), tried(uniform_like(gmc(n)))) for n in numbers}
    gaps = {
        n: (delivered_N(gmc(n)), delivered_N(uniform_like(gmc(n)))) for n in numbers
    }
    figure, axes = plt.subplots(2, 2, figsize=(8.6, 6.8), layout="constrained")
    turn(axes[0, 0])
    names = ("push_mN", "root_per_mm", "wall_mN")
    titles = ("greatest push", "root curvature", "force on the walls")
    for ax, name, title in zip(axes.flat[1:], names, titles, strict=True):
        for k, task in enumerate(TASKS):
            ratio = [
                getattr(graded[task], name) / getattr(plain[task], name)
                for graded, plain in found.values()
            ]
            ax.plot([k] * len(ratio), ratio, "o", alpha=0.6)
            for n, r in zip(found, ratio, strict=True):
                ax.annotate(str(n), (k, r), (5, -3), textcoords="offset points", size=6)
        ax.axhline(1.0, color="0.5", lw=0.8)
        ax.set_xticks(range(5), [task.replace(" degrees", "°") for task in TASKS])
        ax.set_title(f"{title}, graded / uniform", fontsize=9)
        ax.grid(visible=True, linewidth=0.3)
    figure.savefig(folder / "does_grading_help.svg")
    plt.close(figure)
    return {"tasks": found, "gap_N": gaps}


def table(found: dict) -> str:
    """Return the outcomes as a table."""
    lines = [
        "rod    task          push mN          root 1/mm      walls mN       "
        "bow mm     strain %  passed (graded, uniform)"
    ]
    for n, (graded, plain) in found["tasks"].items():
        a, b = (1e3 * force for force in found["gap_N"][n])
        lines.append(f"GMC {n}  across a gap  {a:7.2f} {b:7.2f}")
        for task in TASKS:
            g, u = graded[task], plain[task]
            lines.append(
                f"GMC {n}  {task:12s}  {g.push_mN:7.2f} {u.push_mN:7.2f}  "
                f"{g.root_per_mm:.3f} {u.root_per_mm:.3f}  {g.wall_mN:7.1f} "
                f"{u.wall_mN:7.1f}  {g.bow_mm:4.1f} {u.bow_mm:4.1f}  "
                f"{100 * g.strain:4.1f} {100 * u.strain:4.1f}  "
                f"{'yes' if g.passed else 'no':3s} {'yes' if u.passed else 'no'}"
            )
    return "\n".join(lines)


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "gallery")
    out.mkdir(parents=True, exist_ok=True)
    print(table(main(out)), flush=True)
    for task in TASKS:
        for best in (best_like(gmc(2), task), designed(gmc(2), task)):
            moduli = " ".join(f"{s.E_MPa:.1f}" for s in best.sections)
            lengths = " ".join(f"{s.length_mm:.1f}" for s in best.sections)
            one = tried(best, (task,))[task]
            print(
                f"{task}, {best.name}: {lengths} mm of {moduli} MPa, push "
                f"{one.push_mN:.2f} mN, root {one.root_per_mm:.4f} /mm, walls "
                f"{one.wall_mN:.1f} mN",
                flush=True,
            )
