"""A rod fed into a tube in space: its case, its steps, what a user sees of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.specimen import Specimen
from ...core.units import deg_from_rad
from ..fields import Field, Support, refuse_outside
from ..scaling import field_array
from ..spatial.march import C1, C3, K1, K3, MU1, MU2, H
from ..spatial.rod import SpatialRod, rod_table
from ..tube.look import Scene
from ..tube.mesh import clamp, interpolated, mesh, root_strain, straight, trace
from ..tube.rod import Rod
from ..tube.rub import Past
from ..tube.settle import SETTLED, SOFT, Rest, settle
from ..tube.touch import TIP, Touches
from ..tube.tube import Tube
from ..tube.wall import Bore, gaps
from .passage import Contact, Passage, Step
from .walk import EASE, TURNED, Walk

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class SpatialContact(Contact):
    """A point where the rod presses on a tube.

    Parameters
    ----------
    z_mm : float
        Of the rod's axis, as `x_mm` and `y_mm`.
    along_mm : float
        Place along the tube's centre curve.
    """

    z_mm: float
    along_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SpatialStep(Step):
    """The rod at rest in a tube at one insertion.

    As `Step`, but curvatures and moments have no sign, and

    Parameters
    ----------
    tip_mm : tuple of float
        x, y and z of the tip.
    tip_angle_deg : float
        Angle between the tip and the tube's centre curve.
    along_mm : float
        Place of the tip along the tube.
    residual_Nmm : float
        Largest moment, of all that could turn a part of the rod, that is not balanced.
    shape : ndarray, shape (7, m)
        x, y, z in mm, the tangent, curvature in 1/mm.
    """

    tip_mm: tuple[float, float, float]  # type: ignore[assignment]
    along_mm: float
    residual_Nmm: float

    @property
    def centreline(self) -> None:  # type: ignore[override]
        """None: a centreline is planar; see `to_csv`."""
        return

    def to_csv(self) -> str:
        """Return the shape as CSV: s, x, y, z, tangent, curvature; 15 digits."""
        table = np.column_stack([self.s_mm, self.shape.T])
        rows = (",".join(f"{value:.15g}" for value in row) for row in table)
        return "\n".join(["s_mm,x_mm,y_mm,z_mm,tx,ty,tz,kappa_per_mm", *rows]) + "\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class SpatialPassage(Passage):
    """A rod's way through a tube: as `Passage`, its steps in space."""

    steps: tuple[SpatialStep, ...]  # type: ignore[assignment]


@dataclass(frozen=True, slots=True, kw_only=True)
class TubeCase:
    """A rod, a tube, a field, and how to mesh them.

    Parameters
    ----------
    table : ndarray, shape (k, 13)
        See `spatial.rod.rod_table`.
    bore : Bore
        Of the tube, in lengths of the rod.
    start : float
        Foot of the entry on the tube's curve, in lengths of the rod.
    """

    specimen: Specimen
    lumen: Tube
    field: Field | Callable[[float], Field]
    table: Array
    bore: Bore
    start: float
    friction: float
    elements: int
    tip: None = None

    @property
    def length_mm(self) -> float:
        """Unit of lengths, in mm."""
        return self.specimen.length_mm

    @property
    def unit_N(self) -> float:
        """Unit of forces, in N."""
        part = SpatialRod.from_specimen(self.specimen).sections[0]
        return part.stiffness_Nmm2[1] / self.length_mm**2

    @property
    def half(self) -> float:
        """Radius of the rod with its edges, in lengths of the rod."""
        return radius_mm(self.specimen) / self.length_mm

    @property
    def clamp(self) -> Array:
        """Quaternion of the guide."""
        return clamp(np.array(self.lumen.direction))

    def given(self, insertion_mm: float) -> Field:
        """Return the field at an insertion."""
        return self.field(insertion_mm) if callable(self.field) else self.field

    def flux(self, insertion_mm: float) -> Array:
        """Return the field at an insertion, as the kernels take it."""
        return field_array(self.given(insertion_mm), self.length_mm)

    def guided(self, insertion_mm: float) -> float:
        """Return the energy of a curved rod that its guide holds straight."""
        rows = self.table[::-1]
        left = 1.0 - insertion_mm / self.length_mm
        ends = np.cumsum(rows[:, H])
        inside = np.clip(left - (ends - rows[:, H]), 0.0, rows[:, H])
        bent = rows[:, K1 : K3 + 1] ** 2 / rows[:, C1 : C3 + 1]
        return float(0.5 * inside @ bent.sum(axis=1))

    def rod(self, insertion_mm: float) -> Rod:
        """Return the meshed rod at an insertion."""
        root = np.array(self.lumen.entry_mm) / self.length_mm
        return mesh(self.table, insertion_mm / self.length_mm, root, self.elements)


@dataclass(slots=True)
class TubeState:
    """The rod at rest in the tube; its energy is that of the whole rod."""

    insertion_mm: float
    rod: Rod
    rest: Rest
    moved: float
    energy: float
    overlap: float
    rubbed: float = 0.0
    push: float = 0.0


class TubeWalk(Walk[TubeCase, TubeState]):
    """A rod on its way in a tube."""

    def _rest(
        self, old: TubeState | None, insertion_mm: float, soft: float
    ) -> tuple[int, TubeState]:
        return at_rest(self.case, old, insertion_mm, soft)

    def _push(self, state: TubeState) -> float:
        rest, rod = state.rest, state.rod
        turns = root_strain(rod, rest.turn)
        along = np.array(self.case.lumen.direction)
        stored = 0.5 * float(rod.stiff[0] @ turns**2)
        return -float(rest.load @ along) - stored

    def _read(self, state: TubeState) -> SpatialStep:
        return read_step(self.case, state, self.rubbed)

    def _passed(self, before: Step, after: Step) -> list[str]:
        low, high = sorted((_along(before), _along(after)))
        return [g.name for g in self.case.lumen.gates if low < g.at_mm <= high]

    def error_mm(self) -> float:
        """Return how far the last shape is from the one on elements half as long."""
        state = self._here()
        if self.case.friction:
            return math.nan
        fine = replace(self.case, elements=2 * self.case.elements)
        outcome, new = at_rest(fine, state, state.insertion_mm, SOFT)
        if outcome != SETTLED:
            return math.nan
        s = state.rod.s
        off = trace(new.rod, new.rest.turn, s) - trace(state.rod, state.rest.turn, s)
        return float(np.linalg.norm(off[:, :3], axis=1).max()) * self.case.length_mm


def _along(step: Step) -> float:
    return step.along_mm if isinstance(step, SpatialStep) else math.nan


def at_rest(
    case: TubeCase, old: TubeState | None, insertion_mm: float, soft: float
) -> tuple[int, TubeState]:
    """Return the outcome of `settle` at an insertion, and the state, from an old one.

    The first guess follows the leader: the rod keeps its place in the tube.
    """
    rod, start = case.rod(insertion_mm), case.clamp
    if old is None:
        turn, touches = straight(rod, start), Touches()
    else:
        turn = interpolated(old.rod, old.rest.turn, rod, start, 0.0)
        touches = old.rest.touches
        inside = (touches.s <= rod.s[-1]) | (touches.kind == TIP)
        touches = touches.kept(inside)
        touches.s[touches.kind == TIP] = rod.s[-1]
    guess = trace(rod, turn, rod.s)
    scene = Scene(
        rod=rod, field=case.flux(insertion_mm), tube=case.bore, half=case.half,
        start=case.start, friction=case.friction, past=_past(case, old, insertion_mm),
    )  # fmt: skip
    rest = settle(scene, turn, touches, soft)
    moved = trace(rod, rest.turn, rod.s)[:, :3] - guess[:, :3]
    outcome = rest.outcome if rest.stable or rest.outcome != SETTLED else -1
    if outcome == SETTLED and _behind(case, rod, rest):
        outcome = TURNED
    return outcome, TubeState(
        insertion_mm=insertion_mm,
        rod=rod,
        rest=rest,
        moved=float(np.linalg.norm(moved, axis=1).max()),
        energy=rest.energy + case.guided(insertion_mm),
        overlap=float(rest.overlap),
        rubbed=rest.rubbed,
    )


def _behind(case: TubeCase, rod: Rod, rest: Rest) -> bool:
    """Tell whether a part of the rod lies beside its guide."""
    path = trace(rod, rest.turn, rod.s)[:, :3]
    feet = gaps(case.bore, path, 0.0, case.start)[1]
    return bool(np.min(feet) < case.start - case.half)


def _past(case: TubeCase, old: TubeState | None, insertion_mm: float) -> Past | None:
    """Return the step before, for friction."""
    if old is None:
        return None
    shift = (insertion_mm - old.insertion_mm) / case.length_mm
    along = np.array(case.lumen.direction)
    ease = max(EASE * abs(shift), 1e-9)
    return Past(old.rod, old.rest.turn, along, shift, ease)


def radius_mm(specimen: Specimen) -> float:
    """Return the largest distance of the rod's surface from its axis, in mm.

    A tube is round: the edges of a square rod touch it first.
    """
    return max(
        0.5 * (a.width_mm if a.is_round else math.hypot(a.width_mm, a.height_mm))
        for a in specimen.cross_sections
    )


def read_step(case: TubeCase, state: TubeState, rubbed: float) -> SpatialStep:
    """Return what a user sees of a state."""
    L, unit_N = case.length_mm, case.unit_N
    rod, rest = state.rod, state.rest
    # Four points an element, and the joints from the side of the root.
    parts = rod.s[:-1, None] + np.diff(rod.s)[:, None] * np.arange(1.0, 5.0) / 4.0
    s = np.append(0.0, parts)
    path = trace(rod, rest.turn, s)
    curvature = np.linalg.norm(path[:, 6:], axis=1) / L
    place_mm = path[:, :3] * L
    refuse_outside(case.given(state.insertion_mm), *path[:, :2].T, L, path[:, 2])  # type: ignore[call-arg, arg-type]
    turns = root_strain(rod, rest.turn)
    moment = rod.stiff[0] * (turns - rod.rest[0])
    contacts = contacts_of(case, rest)
    forces = [contact.force_N for contact in contacts]
    tip = (float(place_mm[-1, 0]), float(place_mm[-1, 1]), float(place_mm[-1, 2]))
    along_mm = _foot_mm(case, path[:, :3])
    towards = case.lumen.at(along_mm)[1]
    cosine = float(towards @ path[-1, 3:6] / np.linalg.norm(towards))
    return SpatialStep(
        insertion_mm=state.insertion_mm,
        push_N=state.push * unit_N,
        root_curvature_per_mm=float(np.hypot(*turns[:2])) / L,
        root_moment_Nm=float(np.linalg.norm(moment)) * unit_N * L * 1e-3,
        most_curvature_per_mm=float(curvature.max()),
        wall_N=sum(forces),
        most_wall_N=max(forces, default=0.0),
        energy_Nmm=rest.energy * unit_N * L,
        rubbed_Nmm=rubbed * unit_N * L,
        tip_mm=tip,
        tip_angle_deg=deg_from_rad(math.acos(max(-1.0, min(1.0, cosine)))),
        contacts=contacts,
        overlap_mm=rest.overlap * L,
        s_mm=s * L,
        shape=np.vstack([place_mm.T, path[:, 3:6].T, curvature]),
        along_mm=along_mm,
        residual_Nmm=rest.residual * unit_N * L,
    )


def _foot_mm(case: TubeCase, path: Array) -> float:
    """Return the tip's place along the tube, followed from the root."""
    return float(gaps(case.bore, path, 0.0, case.start)[1, -1]) * case.length_mm


def contacts_of(case: TubeCase, rest: Rest) -> tuple[SpatialContact, ...]:
    """Return the contacts that carry a force, root first."""
    L, touches, seen = case.length_mm, rest.touches, rest.seen
    steep = np.linalg.norm(seen.grad, axis=1)
    return tuple(
        SpatialContact(
            wall=case.lumen.name,
            s_mm=float(touches.s[k] * L),
            x_mm=float(seen.r[k, 0] * L),
            y_mm=float(seen.r[k, 1] * L),
            z_mm=float(seen.r[k, 2] * L),
            along_mm=float(touches.p[k] * L),
            force_N=float(touches.force[k] * steep[k] * case.unit_N),
            friction_N=float(case.friction * touches.force[k] * steep[k] * case.unit_N),
        )
        for k in np.argsort(touches.s)
        if touches.force[k] > 0.0
    )


def tube_case(
    specimen: Specimen,
    tube: Tube,
    field: Field | Callable[[float], Field],
    support: Support,
    friction: float,
    elements: int,
) -> TubeCase:
    """Return a case, checked.

    Raises
    ------
    InputError
        If the rod does not fit into the tube, or has a magnetisation across it.
    """
    tube.check_rod(radius_mm(specimen))
    table = rod_table(SpatialRod.from_specimen(specimen), support)
    if np.any(table[:, [MU1, MU2]]):
        raise InputError(
            f"specimen {specimen.name!r} must be magnetised along its axis in a tube "
            "(remanence_y_mT and remanence_z_mT 0); instead received another"
        )
    L = specimen.length_mm
    along_mm, _ = tube.foot_mm(tube.entry_mm or (0.0, 0.0, 0.0))
    return TubeCase(
        specimen=specimen,
        lumen=tube,
        field=field,
        table=table,
        bore=tube.packed(L),
        start=along_mm / L,
        friction=friction,
        elements=elements,
    )
