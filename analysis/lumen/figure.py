"""The picture of a run in a lumen: measured and simulated rods, and their contacts."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from ...core.files import write_bytes
from ...sim.navigate import outline
from ..figures.style import BAD, FAINT, INK, MAGNET
from .expect import fed_mm_of, fed_steps, step_at
from .in_lumen import InLumen


def draw(path: Path, result: InLumen) -> None:
    """Draw every measured rod in the walls, and how far it is from the simulated."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 4.6), layout="constrained")
    plan, below = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
    for wall in result.lumen.walls:
        plan.plot(*outline(wall.arcs).T, color=INK, lw=1.4)
    steps = [step for step in fed_steps(result.run) if step.image in result.fed]
    for step in steps:
        seen = result.fed[step.image]
        plan.plot(*seen.points_mm.T, color=MAGNET, lw=1.2)
        expected = step_at(result.passage, fed_mm_of(step))
        if expected is not None:
            plan.plot(*expected.shape[:2], color=INK, lw=0.7, ls=(0, (4, 3)))
        at = [int(np.argmin(abs(seen.s_mm - touch.at_mm))) for touch in seen.touches]
        plan.plot(*seen.points_mm[at].T, "o", color=BAD, ms=3.0)
    plan.plot([], [], color=MAGNET, label="measured")
    plan.plot([], [], color=INK, lw=0.7, ls=(0, (4, 3)), label="simulated")
    plan.plot([], [], "o", color=BAD, ms=3.0, label="contact, measured")
    plan.legend(fontsize=7, frameon=False)
    shapes = np.concatenate([seen.points_mm for seen in result.fed.values()])
    low, high = shapes.min(axis=0) - 3.0, shapes.max(axis=0) + 3.0
    plan.set_xlim(low[0], high[0])
    plan.set_ylim(low[1], high[1])
    plan.set_aspect("equal")
    plan.set_xlabel("x in mm")
    plan.set_ylabel("y in mm")
    held = [(fed_mm_of(s), result.agreements.get(s.image)) for s in steps]
    pairs = [(mm, each) for mm, each in held if each is not None]
    at_mm = [mm for mm, _ in pairs]
    below.plot(at_mm, [1e3 * a.rms_mm for _, a in pairs], "o-", color=MAGNET, ms=3)
    below.plot(at_mm, [1e3 * a.tip_mm for _, a in pairs], "s--", color=FAINT, ms=3)
    below.legend(["along the rod, RMS", "at the tip"], fontsize=7, frameon=False)
    below.set_xlabel("insertion in mm")
    below.set_ylabel("measured from simulated, in um")
    below.set_ylim(bottom=0.0)
    figure.suptitle(f"{result.run.specimen.name} in {result.lumen.name}", fontsize=10)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=150)
    write_bytes(path, buffer.getvalue())
