"""What a run in a lumen gave: channel, rods and contacts measured, and simulated."""

from __future__ import annotations

from dataclasses import dataclass

from ...sim.navigate import Lumen, Passage
from ...vision import Placed
from ..runs.data import RunData
from .contacts import Fed
from .expect import Agreement, fed_steps, gates_passed


@dataclass(frozen=True, slots=True, kw_only=True)
class InLumen:
    """What a run in a lumen gave.

    Parameters
    ----------
    run : RunData
        The run, with its centrelines.
    lumen, placed : Lumen, Placed
        The channel, and where it lies.
    fed : dict of str to Fed
        The rod in each photograph that could be measured.
    passage : Passage
        The simulated rod's way.
    agreements : dict of str to Agreement
        Of the photographs whose insertion the simulated rod reached.
    """

    run: RunData
    lumen: Lumen
    placed: Placed
    fed: dict[str, Fed]
    passage: Passage
    agreements: dict[str, Agreement]

    @property
    def gates(self) -> list[str]:
        """Gates that the measured tip passed from photograph to photograph."""
        seen = [self.fed.get(step.image) for step in fed_steps(self.run)]
        tips = [tuple(one.points_mm[-1].tolist()) for one in seen if one is not None]
        return gates_passed(self.lumen, tips)
