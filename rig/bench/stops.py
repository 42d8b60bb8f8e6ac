"""Where a run stops, in turn: what the few words of a plan unfold to."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

Order = Literal["falling", "free"]
Sweep = Literal["approach", "return"]
StopKind = Literal["reference", "approach", "return", "free", "baseline"]
FAR: tuple[StopKind, ...] = ("reference", "baseline")
"""The kinds that are taken far from the magnet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """One step of a run.

    Attributes
    ----------
    gap_mm : float
        The gap.
    kind : str
        ``reference``: far from the magnet, for the rod's own bow and the meter's zero;
        ``approach`` and ``return``: on the way to the magnet and back; ``free``: in the
        plan's own order; ``baseline``: far away again, after all others.
    turn : int
        Which repeat, from 1; 0 outside of them.
    settings : mapping of str to float
        What the other axes are set to.
    """

    gap_mm: float
    kind: StopKind
    turn: int = 0
    settings: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """The words of a plan that say where a run stops.

    Attributes
    ----------
    gaps_mm : sequence of float
        The gaps of one approach, or in any order.
    order : {"falling", "free"}
        Whether they must fall.
    sweep : {"approach", "return"}
        With ``return`` each turn goes back through the same gaps.
    repeats : int
        How many turns.
    far_mm : float
        Where references and baselines are taken.
    reference, baseline : bool
        Whether there are such.
    scans : mapping of str to sequence of float
        Values of other axes, each at each gap.
    along : mapping of str to sequence of float
        Values of other axes, one a gap.
    rest : mapping of str to float
        What axes are set to for references and baselines.
    """

    gaps_mm: Sequence[float]
    order: Order
    sweep: Sweep
    repeats: int
    far_mm: float
    reference: bool
    baseline: bool
    scans: Mapping[str, Sequence[float]] = field(default_factory=dict)
    along: Mapping[str, Sequence[float]] = field(default_factory=dict)
    rest: Mapping[str, float] = field(default_factory=dict)


def stops_of(route: Route) -> tuple[Stop, ...]:
    """Return every step of a run, in turn."""
    stops: list[Stop] = []
    if route.reference:
        stops.append(Stop(gap_mm=route.far_mm, kind="reference", settings=route.rest))
    for turn in range(1, route.repeats + 1):
        for kind, index in _turn(route):
            here = {name: values[index] for name, values in route.along.items()}
            stops += [
                Stop(
                    gap_mm=route.gaps_mm[index],
                    kind=kind,
                    turn=turn,
                    settings=here | settings,
                )
                for settings in _settings(route.scans)
            ]
    if route.baseline:
        stops.append(Stop(gap_mm=route.far_mm, kind="baseline", settings=route.rest))
    return tuple(stops)


def _turn(route: Route) -> Iterator[tuple[StopKind, int]]:
    """Yield the kind and the index of the gap of each stop of one turn."""
    out: StopKind = "free" if route.order == "free" else "approach"
    count = len(route.gaps_mm)
    for index in range(count):
        yield out, index
    if route.sweep == "return":  # the nearest is not taken twice
        for index in range(count - 2, -1, -1):
            yield "return", index


def _settings(scans: Mapping[str, Sequence[float]]) -> Iterator[dict[str, float]]:
    for values in itertools.product(*scans.values()):
        yield dict(zip(scans, values, strict=True))


def out_of_order(gaps_mm: Sequence[float]) -> int | None:
    """Return the index of the first gap that does not fall, or None."""
    before = math.inf
    for index, gap_mm in enumerate(gaps_mm):
        if gap_mm >= before:
            return index
        before = gap_mm
    return None
