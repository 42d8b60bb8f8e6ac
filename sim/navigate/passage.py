"""What comes out when a rod is pushed through a lumen: plain records."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.centreline import Centreline

INSERTED = "inserted"
JAMMED = "jammed: no equilibrium found without passing a wall"
PULLED_ON = "pulled onto the magnet: no equilibrium"
LIMIT = "push force beyond its limit"
LOST = "no equilibrium found"
TURNED_BACK = "turned back behind the guide, where it has no room"
MEETS = "self-contact"
OVERPOWERED = "no equilibrium found: the magnet pulls more than rod and walls hold"


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """A point where the rod presses on a wall.

    Parameters
    ----------
    wall : str
        Name of the wall.
    s_mm : float
        Place on the rod, from the clamp, in mm.
    x_mm, y_mm : float
        Of the rod's axis there; the wall is half a side further.
    force_N : float
        Normal force, above zero.
    friction_N : float
        Largest friction the force allows, in N: what acts if it slides.
    """

    wall: str
    s_mm: float
    x_mm: float
    y_mm: float
    force_N: float
    friction_N: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """The rod at rest at one insertion.

    Parameters
    ----------
    insertion_mm : float
        How far it is pushed in, in mm.
    push_N : float
        Force on the rod that holds it there against lumen, field and its own bending,
        in N; negative: it is pulled.
    root_curvature_per_mm, root_moment_Nm : float
        At the clamp, counter-clockwise.
    most_curvature_per_mm : float
        Largest along the rod, without sign.
    wall_N, most_wall_N : float
        Sum of the walls' normal forces, and the largest, in N.
    energy_Nmm : float
        Of bending, magnet and weight of what is outside the guide, in N mm.
    rubbed_Nmm : float
        Work of friction since the beginning, in N mm.
    tip_mm : tuple of float
        Tip, in mm.
    tip_angle_deg : float
        Its direction.
    contacts : tuple of Contact
        All of them, root first.
    overlap_mm : float
        How deep any point between contacts is behind a wall: the error of a line of
        contact.
    shape : ndarray, shape (4, m)
        x, y in mm, angle in rad, curvature in 1/mm.
    s_mm : ndarray, shape (m,)
        Arc length of these points.
    """

    insertion_mm: float
    push_N: float
    root_curvature_per_mm: float
    root_moment_Nm: float
    most_curvature_per_mm: float
    wall_N: float
    most_wall_N: float
    energy_Nmm: float
    rubbed_Nmm: float
    tip_mm: tuple[float, float]
    tip_angle_deg: float
    contacts: tuple[Contact, ...]
    overlap_mm: float
    s_mm: NDArray[np.float64]
    shape: NDArray[np.float64]

    @property
    def centreline(self) -> Centreline:
        """The shape as the rest of magbend knows it."""
        x, y, theta, kappa = self.shape
        return Centreline._trusted(self.s_mm, x, y, theta, kappa)


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something that happened on the way.

    Parameters
    ----------
    kind : {"snap", "gate", "gate back", "touch", "coarse", "self-contact"}
        ``snap``: the rod left a state that ceased to be one (buckling, snap-through)
        for another. ``gate``: the tip passed a gate, or came back through it.
        ``touch``: the first contact with a wall. ``coarse``: the push was larger
        within the step than at any of its ends. ``self-contact``: the rod meets
        itself for the first time; from there on it passes through itself.
    insertion_mm : float
        When.
    what : str
        Name of the gate or wall, or what the snap is.
    released_Nmm : float
        Energy that a snap loses, in N mm.
    moved_mm : float
        How far a snap moves the rod.
    """

    kind: str
    insertion_mm: float
    what: str
    released_Nmm: float = 0.0
    moved_mm: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Branch:
    """The branch of states that the rod left in a snap, followed by arc length.

    No hand that pushes can go along it where it is unstable; it tells where a snap
    back will be, and what else the rod could do.

    Parameters
    ----------
    from_mm : float
        Insertion of the last state before the snap, where it begins.
    end : str
        How it ends.
    steps : tuple of Step
        Its states, in order.
    indices : tuple of int
        In how many directions the energy of each falls: 0 if it is stable.
    """

    from_mm: float
    end: str
    steps: tuple[Step, ...]
    indices: tuple[int, ...]

    @property
    def folds_mm(self) -> tuple[float, ...]:
        """Insertions at which it turns, in order, to within its states."""
        at = [step.insertion_mm for step in self.steps]
        return tuple(
            b
            for a, b, c in zip(at, at[1:], at[2:], strict=False)
            if (b - a) * (c - b) < 0
        )

    @property
    def stable_mm(self) -> tuple[tuple[float, float], ...]:
        """Insertions between which it is stable again, in order."""
        found: list[tuple[float, float]] = []
        before = 0
        for step, index in zip(self.steps, self.indices, strict=True):
            at = step.insertion_mm
            if index == 0 and before > 0:
                found.append((at, at))
            elif index == 0 and found:
                found[-1] = (found[-1][0], at)
            before = index
        return tuple(found)

    @property
    def work_Nmm(self) -> float:
        """Work of the push along it, in N mm: in a field that stays, the energy won."""
        pairs = zip(self.steps, self.steps[1:], strict=False)
        return sum(
            0.5 * (a.push_N + b.push_N) * (b.insertion_mm - a.insertion_mm)
            for a, b in pairs
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Passage:
    """A rod's way through a lumen.

    Parameters
    ----------
    lumen, specimen : str
        Their names.
    outcome : str
        ``inserted`` if all of the way was gone, else why not.
    steps : tuple of Step
        In the order they happened.
    events : tuple of Event
        In the order they happened.
    error_mm : float
        How far the last shape is from the one on elements of half the size.
    branches : tuple of Branch
        One for each snap, if they were asked for.
    """

    lumen: str
    specimen: str
    outcome: str
    steps: tuple[Step, ...]
    events: tuple[Event, ...]
    error_mm: float
    branches: tuple[Branch, ...] = ()

    @property
    def gates(self) -> tuple[str, ...]:
        """Names of the gates the tip passed on the way in, in order."""
        return tuple(event.what for event in self.events if event.kind == "gate")

    @property
    def snaps(self) -> tuple[Event, ...]:
        """The snaps."""
        return tuple(event for event in self.events if event.kind == "snap")

    @property
    def reached_mm(self) -> float:
        """The furthest insertion."""
        return max((step.insertion_mm for step in self.steps), default=0.0)

    def most(self, name: str) -> float:
        """Return the largest magnitude of a quantity of `Step` over the way."""
        return max((abs(getattr(step, name)) for step in self.steps), default=0.0)
