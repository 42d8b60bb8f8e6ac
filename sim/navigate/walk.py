"""One step after the other, finer where the rod snaps."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..magnet.flux import UNIFORM
from .passage import (
    INSERTED,
    JAMMED,
    LIMIT,
    LOST,
    OVERPOWERED,
    PULLED_ON,
    TURNED_BACK,
    Event,
    Step,
)
from .settle import JAMMED as NO_ROOM
from .settle import PULLED, SETTLED, SOFT

Array = NDArray[np.float64]

FINEST = 256
"""A step is halved down to this part of it before a jump counts as a snap."""
JUMP = 4.0
"""A move beyond this many steps is looked at closely."""
CAREFUL = 16
"""A rod that moves so fast without a snap, or stores more than the push gives, is
followed by this part of a step."""
DOUBT = 64
"""A rod whose contacts were not all found is followed by this part of a step."""
TRUSTED = 1e-5
"""Overlap, in L, beyond which they were not: such a rod may give way where one between
all of its contacts would not."""
LOSS = 1e-4
"""A snap loses more than this part of the energy."""
HIDDEN = 0.5
"""A step that stores this part more than the push at its ends gives hides a peak."""
LEAST = 1e-2
"""Energy below which none is lost or won that matters, in EI / L."""
EASE = 1e-3
"""Friction is fully mobilised by a slip of this part of a step."""
SOFTER = (1e2, 1e3, 1e4, 1e5)
"""Stiffness of the walls where a rod that snaps is to find its way past them."""
TURNED = PULLED + 1
"""Outcome of coming to rest, besides those of `settle`: behind the guide's end."""
WHY = {NO_ROOM: JAMMED, PULLED: PULLED_ON, TURNED: TURNED_BACK}


class AtRest(Protocol):
    """What a walk asks of a rod at rest."""

    insertion_mm: float
    energy: float
    rubbed: float
    moved: float
    push: float
    overlap: float


class OfCase(Protocol):
    """What a walk asks of its case; see `case.Case`."""

    @property
    def tip(self) -> tuple[float, float, float] | None:
        """Where the tip is held."""
        ...

    @property
    def field(self) -> object:
        """What bends the rod: a field, or a function of the insertion."""
        ...

    @property
    def length_mm(self) -> float:
        """Unit of lengths, in mm."""
        ...

    @property
    def unit_N(self) -> float:
        """Unit of forces, in N."""
        ...

    def flux(self, insertion_mm: float) -> Array:
        """Return the field at an insertion."""
        ...


S = TypeVar("S", bound=AtRest)
C = TypeVar("C", bound=OfCase)


class Walk(ABC, Generic[C, S]):
    """A rod on its way: its state, and what happened."""

    def __init__(self, case: C, step_mm: float, limit_N: float) -> None:
        self.case = case
        self.step_mm = step_mm
        self.limit_N = limit_N
        self.state: S | None = None
        self.steps: list[Step] = []
        self.events: list[Event] = []
        self.outcome = INSERTED
        self.rubbed = 0.0
        self.doubted_mm = math.nan
        """Insertion of the last state that finer steps were to confirm."""
        self.turns: list[float] = []
        """Insertions that were gone to, and left again."""

    @abstractmethod
    def _rest(self, old: S | None, insertion_mm: float, soft: float) -> tuple[int, S]:
        """Return the outcome of coming to rest, and the state; see `at_rest`."""

    @abstractmethod
    def _push(self, state: S) -> float:
        """Return the force that holds the rod there."""

    @abstractmethod
    def _read(self, state: S) -> Step:
        """Return what a user sees of a state."""

    @abstractmethod
    def _passed(self, before: Step, after: Step) -> list[str]:
        """Return the names of the gates between two steps."""

    @abstractmethod
    def error_mm(self) -> float:
        """Return how far the last shape is from the one on elements half as long."""

    def go_to(self, target_mm: float) -> bool:
        """Go to an insertion; return whether it was reached."""
        if self.state is None and not self._begin(target_mm):
            return False
        now = self._here()
        self.turns.append(now.insertion_mm)
        way = math.copysign(1.0, target_mm - now.insertion_mm)
        step = self.step_mm
        while now.insertion_mm != target_mm:
            left = abs(target_mm - now.insertion_mm)
            take = left if left < 1.001 * step else step
            goal = target_mm if take == left else now.insertion_mm + way * take
            finest = step <= self.step_mm / FINEST
            new = self._try(now, goal, last_try=finest)
            if new is None and finest:
                new = self._doubted(now, way)
                if new is None:
                    return False
            if new is None:
                step *= 0.5
                continue
            snapped = self._leaps(now, new)
            self._arrive(now, new)
            if abs(self.steps[-1].push_N) > self.limit_N:
                self.outcome = LIMIT
                return False
            now = new
            step = self.step_mm if snapped else min(2.0 * step, self.step_mm)
        return True

    def _here(self) -> S:
        if self.state is None:
            raise RuntimeError("the walk has not begun")
        return self.state

    def _begin(self, target_mm: float) -> bool:
        """Take the first step into the lumen."""
        first = min(self.step_mm, target_mm)
        if self.case.tip is not None:
            first = target_mm
        outcome, state = self._come(None, first, SOFT)
        if outcome != SETTLED:
            self.outcome = WHY.get(outcome, LOST)
            return False
        self._arrive(None, state)
        return True

    def _come(self, old: S | None, goal_mm: float, soft: float) -> tuple[int, S]:
        """Come to rest, and know the push there."""
        outcome, new = self._rest(old, goal_mm, soft)
        if outcome == SETTLED:
            new.push = self._push(new)
        return outcome, new

    def _try(self, old: S, goal_mm: float, *, last_try: bool) -> S | None:
        """Return the state at a goal; None if a finer step is needed, or none is."""
        outcome, new = self._come(old, goal_mm, SOFT)
        taken = abs(goal_mm - old.insertion_mm)
        moved = new.moved * self.case.length_mm
        careless = taken > self.step_mm / CAREFUL
        fast = careless and moved > JUMP * taken
        free = not self.steps[-1].contacts
        peaks = (careless or free) and self._hides(old, new)
        if outcome == SETTLED and not (fast or peaks or self._leaps(old, new)):
            if taken <= self.step_mm / DOUBT or new.overlap <= TRUSTED:
                return new
            self.doubted_mm = goal_mm
        if not last_try:
            return None
        again = outcome
        risen: list[S] = []
        for soft in (SOFT, *(SOFTER if self.steps[-1].contacts else ())):
            if soft != SOFT:
                again, new = self._come(old, goal_mm, soft)
            if again != SETTLED:
                continue
            if not self._rises(old, new):
                return new
            risen.append(new)
        if risen:
            return min(risen, key=lambda state: state.energy + state.rubbed)
        lost = OVERPOWERED if self.case.flux(goal_mm)[0] != UNIFORM else LOST
        self.outcome = WHY.get(again) or WHY.get(outcome) or lost
        return None

    def _doubted(self, old: S, way: float) -> S | None:
        """Return the state that was doubted, where finer steps find none before it."""
        if not way * (self.doubted_mm - old.insertion_mm) > 0.0:
            return None
        outcome, new = self._come(old, self.doubted_mm, SOFT)
        if outcome != SETTLED or self._leaps(old, new):
            return None
        self.outcome = INSERTED
        return new

    def _leaps(self, old: S, new: S) -> bool:
        """Return whether a step moves the rod far, and energy is lost or won by it."""
        taken = (new.insertion_mm - old.insertion_mm) / self.case.length_mm
        if new.moved <= JUMP * abs(taken):
            return False
        lost, much = self._released(old, new), LOSS * self._scale(old, new)
        return lost > much or self._rises(old, new)

    def _rises(self, old: S, new: S) -> bool:
        """Return whether a step gains energy from nowhere: no rod snaps uphill.

        A field that moves may give any.
        """
        won = -self._released(old, new)
        return not callable(self.case.field) and won > LOSS * self._scale(old, new)

    def _hides(self, old: S, new: S) -> bool:
        """Return whether the push was much larger within a step than at its ends.

        So it is where a tip meets an edge head on, buckles, and slips off it.
        """
        taken = (new.insertion_mm - old.insertion_mm) / self.case.length_mm
        work = abs(0.5 * (old.push + new.push) * taken)
        return self._rises(old, new) and -self._released(old, new) > HIDDEN * work

    def _scale(self, old: S, new: S) -> float:
        taken = (new.insertion_mm - old.insertion_mm) / self.case.length_mm
        return LEAST + abs(new.energy) + abs(old.energy) + abs(old.push * taken)

    def _released(self, old: S, new: S) -> float:
        """Return the energy that is neither stored, nor rubbed away, nor work.

        The work is that of the push before, where the push falls, as at a snap; where
        it rises, of the mean of both.
        """
        taken = (new.insertion_mm - old.insertion_mm) / self.case.length_mm
        push = old.push
        if (new.push - old.push) * taken > 0.0:
            push = 0.5 * (old.push + new.push)
        return old.energy + push * taken - new.rubbed - new.energy

    def _arrive(self, old: S | None, new: S) -> None:
        self.state = new
        self.rubbed += new.rubbed
        step = self._read(new)
        self._notice(old, new, step)
        self.steps.append(step)

    def _notice(self, old: S | None, new: S, step: Step) -> None:
        """Write down what happened in a step."""
        at_mm = new.insertion_mm
        if step.contacts and not any(event.kind == "touch" for event in self.events):
            self.events.append(
                Event(kind="touch", insertion_mm=at_mm, what=step.contacts[0].wall)
            )
        if old is None:
            return
        if self._leaps(old, new):
            unit_Nmm = self.case.unit_N * self.case.length_mm
            self.events.append(
                Event(
                    kind="snap",
                    insertion_mm=at_mm,
                    what="the rod leaves a state that ceased to be stable",
                    released_Nmm=self._released(old, new) * unit_Nmm,
                    moved_mm=new.moved * self.case.length_mm,
                )
            )
        elif at_mm - old.insertion_mm > self.step_mm / CAREFUL and self._hides(
            old, new
        ):
            what = "the push was larger within the step; take finer ones"
            self.events.append(Event(kind="coarse", insertion_mm=at_mm, what=what))
        for name in self._passed(self.steps[-1], step):
            self.events.append(
                Event(
                    kind="gate" if at_mm > old.insertion_mm else "gate back",
                    insertion_mm=at_mm,
                    what=name,
                )
            )
