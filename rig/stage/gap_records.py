"""What a stage says of itself in gaps: how it came to one, and how it stands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .protocol import PositionState, StageState

Approach = Literal["far side", "clipped"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveRecord:
    """How the stage came to a gap.

    Attributes
    ----------
    gap_mm, stage_mm : float
        Where the controller says it stands: gap and machine position, in mm.
    duration_s : float
        Time of the whole move.
    approach : {"far side", "clipped"}
        ``far side``: the last motion was toward the magnet, over the full backlash;
        ``clipped``: a limit left too little room to come from farther away.
    """

    gap_mm: float
    stage_mm: float
    duration_s: float
    approach: Approach


@dataclass(frozen=True, slots=True, kw_only=True)
class GapStatus:
    """State of the stage in one line.

    `gap_mm` is None when the position is unknown or the bench was never measured;
    `doubt` says why the position is not trusted, and the way out.
    """

    state: StageState
    position_state: PositionState
    gap_mm: float | None
    stage_mm: float | None
    feed_mm_min: float
    alarm: int | None
    pins: str
    doubt: str = ""
