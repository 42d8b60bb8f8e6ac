"""A stage in its own machine millimetres: protocol and states.

What people use is the gap in front of the magnet; `stage.gap` maps it onto this.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, Protocol

from ...core.errors import StageError
from .place import PlaceMap
from .stopping import StopProof

PositionState = Literal["unknown", "homed", "unverified"]
"""How far the position can be trusted.

unknown : the board restarted, lost its position, or was never homed: home it.
unverified : the board still counts, but a move did not end as it should: home it.
homed : homed since, and every move since ended where it was sent.
"""

StageState = Literal[
    "idle", "run", "hold", "jog", "alarm", "home", "check", "door", "sleep", "silent"
]


@dataclass(frozen=True, slots=True, kw_only=True)
class StageStatus:
    """What the controller says about itself.

    Attributes
    ----------
    state : str
        One of `StageState`; ``silent`` when it did not answer.
    substate : int or None
        Firmware detail, such as 0 (standing) or 1 (slowing down) of ``hold``.
    machine_mm : float or None
        Position on the stage's axis in its own frame, in mm.
    position_state : {"unknown", "homed", "unverified"}
        How far that number can be trusted.
    feed_mm_min : float
        Present speed in mm/min.
    alarm : int or None
        The alarm that locks the controller, if any.
    trouble : StageError or None
        What keeps the controller from moving, ready to be raised.
    pins : str
        Letters of the active inputs: ``X`` is the limit switch of axis X.
    raw : str
        The report as it came.
    """

    state: StageState
    position_state: PositionState
    substate: int | None = None
    machine_mm: float | None = None
    feed_mm_min: float = 0.0
    alarm: int | None = None
    trouble: StageError | None = None
    pins: str = ""
    raw: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class StageLimits:
    """What the controller was found to be set to, in mm, mm/min and mm/s2.

    Attributes
    ----------
    step_mm : float
        One motor step.
    max_feed_mm_min, acceleration_mm_s2 : float
        Ceilings of the axis.
    travel_mm : tuple of float or None
        Lowest and highest machine position, if the controller is homed by switches.
    switch_mm : float or None
        Machine position of the switch that homing runs to, if there is one.
    homed_mm : float or None
        What the controller should count after homing, as far as its settings tell.
    """

    step_mm: float
    max_feed_mm_min: float
    acceleration_mm_s2: float
    travel_mm: tuple[float, float] | None = None
    switch_mm: float | None = None
    homed_mm: float | None = None

    @property
    def tolerance_mm(self) -> float:
        """How far a report may be from its target: a step, and the last digits."""
        return 1.01 * self.step_mm + 0.002

    def stopping_mm(self, feed_mm_min: float) -> float:
        """Return the distance from a feed hold to standstill, v^2 / (2 a), in mm."""
        speed_mm_s = min(feed_mm_min, self.max_feed_mm_min) / 60.0
        return speed_mm_s**2 / (2.0 * self.acceleration_mm_s2)

    def duration_s(self, distance_mm: float, feed_mm_min: float) -> float:
        """Return an upper bound of the time of a move from rest to rest, in s."""
        speed_mm_s = min(feed_mm_min, self.max_feed_mm_min) / 60.0
        return abs(distance_mm) / speed_mm_s + speed_mm_s / self.acceleration_mm_s2


@dataclass(frozen=True, slots=True, kw_only=True)
class StageIdentity:
    """Who answers on the port, for the record of a run."""

    driver: str
    firmware: str
    port: str
    details: tuple[str, ...] = ()
    settings: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


GapMap = tuple[float, int]
"""`gap_at_zero_mm` and `direction`."""

Moved = Callable[[float], None]
"""Called with the machine position in mm, some times a second, on the way."""


def unheard(_machine_mm: float) -> None:
    """Tell nobody where the stage is."""


class Stage(Protocol):
    """One motorised axis in its own machine frame (mm).

    Every method raises `StageError` (or one of its kinds) with a sentence, leaves the
    stage standing, and says in `position_state` what its position is worth after it.
    """

    @property
    def position_state(self) -> PositionState:
        """How far the position can be trusted."""
        ...

    @property
    def identity(self) -> StageIdentity:
        """Who answers, with all settings; after `connect`."""
        ...

    @property
    def limits(self) -> StageLimits:
        """What the controller is set to; after `connect`."""
        ...

    def connect(self) -> None:
        """Open the port, find out who answers and refuse what does not fit."""
        ...

    def home(self) -> None:
        """Find the reference of the axis; afterwards the position is ``homed``."""
        ...

    @property
    def place_map(self) -> PlaceMap:
        """The map by which its count is a gap, with all that it rests on."""
        ...

    @property
    def doubt(self) -> str:
        """Why the position is not trusted, and the way out; empty if it is."""
        ...

    def assume_homed(
        self, machine_mm: float, map_: GapMap, *, for_run: bool = False
    ) -> None:
        """Take the operator's word for the place, and for the map there."""
        ...

    def nudge(self, distance_mm: float) -> None:
        """Go a short way slowly, from wherever the stage is."""
        ...

    def move_to(
        self, machine_mm: float, *, feed_mm_min: float, moved: Moved = unheard
    ) -> None:
        """Go to a machine position and return when the stage stands there."""
        ...

    def status(self) -> StageStatus:
        """Ask the controller; a silent controller is a status, not an error."""
        ...

    def listen(self) -> None:
        """Take in what the controller says unasked; raise if it lost its position."""
        ...

    def stop_requested(self) -> bool:
        """Return whether another process asks this one to stop the stage."""
        ...

    def request_stop(self) -> None:
        """Ask the thread that moves the stage to hold; safe from any thread."""
        ...

    @property
    def last_stop(self) -> StopProof | None:
        """What the last stop has shown."""
        ...

    def hold(self) -> StopProof:
        """Slow down, stand, forget the rest of the move; say what that took."""
        ...

    def stop(self) -> StopProof:
        """Stop at once; the position is ``unverified`` if anything was moving."""
        ...

    def recover(self) -> None:
        """Bring the controller back after an alarm, a timeout or a lost link."""
        ...

    def unlock(self) -> None:
        """Lift the alarm lock without homing; the position is not ``homed`` then."""
        ...

    def close(self) -> None:
        """Let go of the port."""
        ...
