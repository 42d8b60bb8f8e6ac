"""The mechanics behind the twin board: where the stage truly is, and its switches."""

from __future__ import annotations

from collections.abc import Callable

from ....core.checks import finite, positive

Triple = tuple[float, float, float]


class Plant:
    """Three leadscrew axes that count motor steps; nothing tells the board.

    Parameters
    ----------
    start_mm : tuple of float
        Where the axes stand at first, in mm from the upper switches' zero.
    steps_per_mm : float
        The true steps a millimetre of the screw and its motor.
    switch_high_mm, switch_low_mm : float
        A limit switch is closed at or above the one, at or below the other.
    backlash_mm : float
        Play between screw and carriage.

    Attributes
    ----------
    stuck, is_blind : bool
        All switches are closed; none ever closes.
    pressed : str
        Letters of the closed inputs that the board reports and passes over.
    """

    def __init__(
        self,
        *,
        start_mm: Triple = (-20.0, -20.0, -20.0),
        steps_per_mm: float = 250.0,
        switch_high_mm: float = 0.5,
        switch_low_mm: float = -190.0,
        backlash_mm: float = 0.0,
    ) -> None:
        self._steps_per_mm = positive(steps_per_mm, "steps_per_mm")
        self._start_mm = start_mm
        self._high_mm = switch_high_mm
        self._low_mm = switch_low_mm
        self._play_mm = finite(backlash_mm, "backlash_mm", "mm")
        self._steps = [0, 0, 0]
        self._lost_steps = 0
        self._carriage_mm = list(start_mm)
        self._watchers: list[Callable[[], None]] = []
        self.stuck = False
        self.is_blind = False
        self.pressed = ""

    @property
    def steps(self) -> tuple[int, int, int]:
        """Motor steps of the axes since the beginning."""
        return (self._steps[0], self._steps[1], self._steps[2])

    @property
    def carriage_mm(self) -> Triple:
        """Where the carriages truly are, after the play of the screws."""
        x, y, z = self._carriage_mm
        return (x, y, z)

    def lose(self, distance_mm: float) -> None:
        """Lose the next steps of whichever motor turns, over so many mm."""
        self._lost_steps += round(distance_mm * self._steps_per_mm)

    def step(self, axis: int, count: int) -> None:
        """Turn a motor by `count` steps (signed)."""
        lost = min(self._lost_steps, abs(count))
        self._lost_steps -= lost
        count -= lost if count > 0 else -lost
        self._steps[axis] += count
        screw = self._start_mm[axis] + self._steps[axis] / self._steps_per_mm
        half = self._play_mm / 2.0
        here = self._carriage_mm[axis]
        self._carriage_mm[axis] = min(max(here, screw - half), screw + half)
        for look in self._watchers:
            look()

    def watch(self, look: Callable[[], None]) -> None:
        """Call `look` whenever a carriage has moved."""
        self._watchers.append(look)

    def switches(self) -> int:
        """Return the closed limit switches as bits (1: X, 2: Y, 4: Z)."""
        if self.stuck or self.is_blind:
            return 7 if self.stuck else 0
        high, low = self._high_mm, self._low_mm
        x, y, z = self._carriage_mm
        return (
            (1 if x >= high or x <= low else 0)
            | (2 if y >= high or y <= low else 0)
            | (4 if z >= high or z <= low else 0)
        )
