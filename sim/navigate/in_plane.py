"""A rod on its way through a planar lumen: how it comes to rest, and what is read."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .case import Case
from .lumen import Gate
from .mesh import thirds, trace, unknowns
from .passage import MEETS, Event, Step
from .readout import loads, meets_itself, push_force, read_step
from .rod import Rod
from .settle import SETTLED, SOFT, settle
from .touch import TIP, Before, Touches, no_touches
from .walk import EASE, Walk

Array = NDArray[np.float64]


@dataclass(slots=True)
class State:
    """The rod at rest: insertion, mesh, unknowns, contacts."""

    insertion_mm: float
    rod: Rod
    u: Array
    touches: Touches
    held: Array = field(default_factory=lambda: np.zeros(2))
    energy: float = 0.0
    overlap: float = 0.0
    rubbing: Array = field(default_factory=lambda: np.zeros(0))
    rubbed: float = 0.0
    """Work of friction in the step that led here."""
    moved: float = 0.0
    push: float = 0.0


def at_rest(
    case: Case, old: State | None, insertion_mm: float, soft: float
) -> tuple[int, State]:
    """Return the outcome of `settle` at an insertion, and the state, from an old one.

    The first guess follows the leader: the rod keeps its place in the lumen.
    """
    rod = case.rod(insertion_mm)
    if old is None:
        old = State(insertion_mm, rod, np.full(3, rod.root[2]), no_touches())
        u = np.zeros(3 * len(rod.stiff) + 1)
        u[::3] = rod.root[2]
        if rod.grip[0]:
            u[-1] = rod.grip[3]
        guess, touches, shift = None, old.touches, 0.0
        before = Before(np.array([0.0, 1.0]), np.zeros(2), np.zeros(2), 0.0, 1.0)
    else:
        shift = (insertion_mm - old.insertion_mm) / case.length_mm
        u, touches = follow(case, old, rod, shift)
        before = history(case, old, shift)
    guess = trace(rod, u, rod.s)
    held = old.held.copy()
    outcome, stable, _, _, overlap, energy = settle(
        rod, case.flux(insertion_mm), case.walls, case.half, case.friction,
        u, touches, held, before, soft,
    )  # fmt: skip
    moved = np.hypot(*(trace(rod, u, rod.s)[:2] - guess[:2])).max()
    if outcome == SETTLED and not stable:
        outcome = -1
    friction, slip = rubbing(touches, before)
    return outcome, State(
        insertion_mm=insertion_mm,
        rod=rod,
        u=u,
        touches=touches,
        held=held,
        energy=energy,
        overlap=overlap,
        rubbing=friction,
        rubbed=float(friction @ slip),
        moved=float(moved),
    )


def copied(touches: Touches) -> Touches:
    """Return contacts that may be changed."""
    copies: list[Any] = [array.copy() for array in touches]
    return Touches(*copies)


def follow(case: Case, old: State, rod: Rod, shift: float) -> tuple[Array, Touches]:
    """Return unknowns and contacts of the old state on the new mesh."""
    ahead = 0.0 if case.feeds else shift
    s = thirds(rod)
    u = unknowns(rod, trace(old.rod, old.u, (s + ahead).ravel())[2].reshape(s.shape))
    if rod.grip[0]:
        u[-1] = rod.grip[3]
    touches = copied(old.touches)
    n = touches.used[0]
    s_new = touches.s[:n] - ahead
    s_new[touches.kind[:n] == TIP] = rod.s[-1]
    kept = np.flatnonzero((s_new > 0.0) & (s_new <= rod.s[-1]))
    touches.s[:n] = touches.home[:n] = s_new
    for array in touches[1:]:
        array[: len(kept)] = array[kept]
    touches.used[0] = len(kept)
    return u, touches


def history(case: Case, old: State, shift: float) -> Before:
    """Return where the material points were, for friction."""
    end = old.rod.s[-1]
    s = np.linspace(min(0.0, -1.01 * shift), end, 241)
    x, y = trace(old.rod, old.u, s)[:2]
    ease = max(EASE * abs(shift), 1e-9)
    return Before(s, x, y, shift if case.feeds else 0.0, ease)


def rubbing(touches: Touches, before: Before) -> tuple[Array, Array]:
    """Return friction along the walls' tangents, and the slip that it is against."""
    n = touches.used[0]
    slip = touches.way[:n]
    return touches.grip[:n] * np.clip(slip / before.ease, -1.0, 1.0), slip


class PlanarWalk(Walk[Case, State]):
    """A rod on its way in the plane."""

    def __init__(self, case: Case, step_mm: float, limit_N: float) -> None:
        super().__init__(case, step_mm, limit_N)
        self.left: list[tuple[State, float]] = []
        """States before snaps, and how far the step was."""

    def seen(self, state: State) -> Step:
        """Return what a user sees of any state at rest."""
        state.push = self._push(state)
        return self._read(state)

    def _rest(
        self, old: State | None, insertion_mm: float, soft: float
    ) -> tuple[int, State]:
        return at_rest(self.case, old, insertion_mm, soft)

    def _push(self, state: State) -> float:
        case, rod, u = self.case, state.rod, state.u
        field = case.flux(state.insertion_mm)
        load = loads(rod, field, u, state.touches, state.rubbing, state.held)
        return push_force(rod, field, u, load, slides=case.feeds)

    def _read(self, state: State) -> Step:
        case = self.case
        return read_step(
            state.insertion_mm,
            state.rod,
            state.u,
            state.touches,
            case.pieces,
            push=state.push,
            energy=state.energy,
            rubbed=self.rubbed,
            overlap=state.overlap,
            friction=case.friction,
            length_mm=case.length_mm,
            unit_N=case.unit_N,
        )

    def _notice(self, old: State | None, new: State, step: Step) -> None:
        super()._notice(old, new, step)
        if old is not None and self._leaps(old, new):
            self.left.append((old, new.insertion_mm - old.insertion_mm))
        known = any(event.kind == MEETS for event in self.events)
        side_mm = 2.0 * self.case.half * self.case.length_mm
        if not known and meets_itself(step, side_mm):
            self.events.append(
                Event(
                    kind=MEETS,
                    insertion_mm=new.insertion_mm,
                    what="the rod meets itself, which does not keep it off",
                )
            )

    def _passed(self, before: Step, after: Step) -> list[str]:
        return [
            gate.name
            for gate in self.case.lumen.gates
            if crosses(gate, before.tip_mm, after.tip_mm)
        ]

    def error_mm(self) -> float:
        """Return how far the last shape is from the one on elements half as long.

        With friction the whole way is gone again on them: it remembers.
        """
        state = self._here()
        fine = replace(self.case, elements=2 * self.case.elements)
        if self.case.friction:
            again = PlanarWalk(fine, self.step_mm, self.limit_N)
            there = all(again.go_to(mm) for mm in (*self.turns, state.insertion_mm))
            new = again.state
        else:
            outcome, new = at_rest(fine, state, state.insertion_mm, SOFT)
            there = outcome == SETTLED
        if not there or new is None:
            return math.nan
        s = state.rod.s
        off = trace(new.rod, new.u, s)[:2] - trace(state.rod, state.u, s)[:2]
        return float(np.hypot(*off).max()) * self.case.length_mm


def crosses(
    gate: Gate, start_mm: tuple[float, float], end_mm: tuple[float, float]
) -> bool:
    """Return whether the way from one point to another passes a gate."""
    (ax, ay), (bx, by) = gate.from_mm, gate.to_mm

    def side(p: tuple[float, float]) -> float:
        return (bx - ax) * (p[1] - ay) - (by - ay) * (p[0] - ax)

    (px, py), (qx, qy) = start_mm, end_mm
    u = (qx - px) * (ay - py) - (qy - py) * (ax - px)
    v = (qx - px) * (by - py) - (qy - py) * (bx - px)
    return (side(start_mm) > 0.0) != (side(end_mm) > 0.0) and (u > 0.0) != (v > 0.0)
