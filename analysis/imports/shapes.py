"""What a file of shapes is read into, before anything in it is believed.

Every reader of this package gives `Block` (columns as they stand in the file) or
`RawShape` (points as they were written); `judge` holds a `RawShape` against physics and
makes a `Centreline` of it.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ...core.columns import parse_number, split_unit
from ...core.errors import ConfigError
from ...core.units import unit_factor

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class RawShape:
    """One shape as it was written.

    Parameters
    ----------
    source : str
        File and, where there are several shapes, which: named in messages.
    points : ndarray, shape (n, 2)
        In `unit`; in px y points down.
    unit : str
        Of lengths; empty where the file does not say.
    s, theta, kappa : ndarray, shape (n,), or None
        Arc length in `unit`, tangent angle in `theta_unit`, curvature per `unit`.
    theta_unit : str
        ``rad``, ``deg``, or empty where the file does not say.
    material : ndarray, shape (n,), or None
        What orders the points, in any unit: the coordinate along the undeformed rod.
    parameters : mapping of str to float
        What the shape belongs to, with the names of the file.
    kept : mapping of str to ndarray, shape (n,)
        Columns `KEPT` that stand beside the points.
    notes : tuple of str
        What the reader took for granted.
    """

    source: str
    points: Array
    unit: str = ""
    s: Array | None = None
    theta: Array | None = None
    theta_unit: str = ""
    kappa: Array | None = None
    material: Array | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    kept: Mapping[str, Array] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """The parameters in words, as they are written in column heads."""
        return ", ".join(f"{name}={value:g}" for name, value in self.parameters.items())


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """Columns of equal length, as they stand in a file.

    Parameters
    ----------
    source : str
        Named in messages.
    columns : sequence of (head, values)
        The head as written; values are numbers, or texts where they are none.
    unit : str
        Length unit that the file states for columns without one; empty if none.
    parameters : mapping of str to float
        What the file says of all its shapes, as ``% side_mm = 1.0``.
    """

    source: str
    columns: Sequence[tuple[str, Array | list[str]]]
    unit: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Head:
    quantity: str
    unit: str
    case: str


ALIASES = {
    "x": "x", "y": "y", "spatial.x": "x", "spatial.y": "y", "x-coordinate": "x",
    "y-coordinate": "y", "x_coordinate": "x", "y_coordinate": "y",
    "u": "u", "v": "v", "solid.u": "u", "solid.v": "v", "s": "s", "arc_length": "s",
    "arclength": "s", "theta": "theta", "angle": "theta", "kappa": "kappa",
    "curvature": "kappa",
}  # fmt: skip
"""Names that programs give to the quantities of a shape; X and Y are the undeformed,
unless they stand alone."""

QUANTITIES = ("x", "y", "s", "theta", "kappa", "u", "v", "X", "Y")
KEPT = (
    "width_mm", "sigma_mm", "x_px", "y_px", "good", "sigma_theta_rad",
    "sigma_kappa_per_mm", "sigma_width_mm",
)  # fmt: skip
"""Columns of our own centrelines that a table may bring besides; kept as they are."""


def head_of(text: str) -> _Head:
    """Part a head such as ``y (m) @ B0=0.05`` into quantity, unit and case."""
    name, _, case = text.partition("@")
    quantity, unit = split_unit(name.strip())
    quantity = re.sub(r"^(comp\d*|mod\d*)\.", "", quantity)
    if quantity in ("X", "Y"):
        return _Head(quantity=quantity, unit=unit, case=case.strip())
    known = ALIASES.get(quantity.lower().replace(" ", "_"), "")
    return _Head(quantity=known or quantity, unit=unit, case=case.strip())


def case_parameters(case: str) -> dict[str, float]:
    """Return what stands behind the ``@`` of a head: ``1: B0=0.05, L=30``."""
    found = {}
    for part in re.sub(r"^\s*\d+\s*:", "", case).split(","):
        name, _, value = part.partition("=")
        number = parse_number(re.sub(r"\[[^\]]*\]\s*$", "", value))
        if name.strip() and number is not None:
            found[name.strip()] = number
    return found


def shapes_of(block: Block) -> list[RawShape]:
    """Return the shapes of a block: side by side (``@``), or below each other.

    Raises
    ------
    ConfigError
        If it has no x and y, or their units differ.
    """
    heads = [head_of(head) for head, _ in block.columns]
    sides = [values for head, values in block.columns if head == "side"]
    if sides and isinstance(sides[0], list):
        return [_between(block, heads, sides[0])]
    is_measured = any(head.quantity == "x" and head.unit != "px" for head in heads)
    if not any(head.case for head in heads):
        heads = _side_by_side(block, heads, is_measured=is_measured)
    cases = list(dict.fromkeys(head.case for head in heads if head.case))
    shapes = []
    for case in cases or [""]:
        at = {
            head.quantity: i
            for i, head in enumerate(heads)
            if head.quantity in QUANTITIES
            and head.case in ("", case)
            and not (is_measured and head.unit == "px")
        }
        shapes += _of_case(block, heads, at, case)
    return shapes


def _side_by_side(
    block: Block, heads: Sequence[_Head], *, is_measured: bool
) -> list[_Head]:
    """Give numbers to shapes that stand side by side, where nothing else tells them.

    Raises
    ------
    ConfigError
        If some are there more often than others.
    """
    seen: Counter[str] = Counter()
    numbered = []
    for head in heads:
        if head.quantity in QUANTITIES and not (is_measured and head.unit == "px"):
            seen[head.quantity] += 1
            numbered.append(replace(head, case=f"{seen[head.quantity]}:"))
        else:
            numbered.append(head)
    if max(seen.values(), default=1) == 1:
        return list(heads)
    if len(set(seen.values())) > 1:
        counts = ", ".join(f"{name} {count} times" for name, count in seen.items())
        raise ConfigError(
            f"{block.source}: must have as many columns of each kind; instead it has "
            f"{counts}; leave one of each, or name the shapes as x_mm @ step=1"
        )
    return numbered


def _of_case(
    block: Block, heads: Sequence[_Head], at: dict[str, int], case: str
) -> list[RawShape]:
    def numbers(name: str) -> Array | None:
        values = block.columns[at[name]][1] if name in at else None
        return values if isinstance(values, np.ndarray) else None

    x, y, material = numbers("x"), numbers("y"), numbers("X")
    lengths: list[str] = [name for name in ("x", "y", "s") if name in at]
    if x is None or y is None:
        x, y, lengths = _displaced(numbers)
    if x is None and material is not None and not {"x", "y", "u", "v"} & set(at):
        x, y, lengths = _alone(material, numbers("Y"))
        material = None
    if x is None or y is None:
        names = ", ".join(head for head, _ in block.columns[:8]) or "no heads"
        raise ConfigError(
            f"{block.source}: must have columns x and y of a line, with their unit "
            f"(x_mm, y_mm); instead it has {names}"
        )
    unit = _common_unit(block, heads, at, lengths)
    kappa, per = numbers("kappa"), heads[at["kappa"]].unit if "kappa" in at else ""
    if kappa is not None and unit and unit_factor(f"per_{unit}", "per_mm"):
        kappa = kappa * (unit_factor(per or f"per_{unit}", f"per_{unit}") or 1.0)
    kept = {
        head: values
        for head, values in block.columns
        if head in KEPT and isinstance(values, np.ndarray)
    }
    whole = RawShape(
        source=block.source, points=np.column_stack([x, y]), unit=unit,
        s=numbers("s"), theta=numbers("theta"),
        theta_unit=heads[at["theta"]].unit if "theta" in at else "", kappa=kappa,
        material=material, kept=kept,
        parameters={**block.parameters, **case_parameters(case)},
    )  # fmt: skip
    return _by_parameters(whole, block, heads)


def _between(block: Block, heads: Sequence[_Head], sides: list[str]) -> RawShape:
    """Return the line midway between the left and the right edge."""
    at = {head.quantity: i for i, head in enumerate(heads)}
    columns = [block.columns[at[name]][1] if name in at else [] for name in ("x", "y")]
    points = np.column_stack(columns)
    edges = [
        points[[side.strip().lower() == wanted for side in sides]]
        for wanted in ("left", "right")
    ]
    if points.dtype.kind != "f" or min(len(edge) for edge in edges) < 3:
        raise ConfigError(
            f"{block.source}: edges must have x and y, and at least three points on "
            "the side left and on the side right"
        )
    shares = np.linspace(0.0, 1.0, max(len(edge) for edge in edges))
    middle = sum(_at_shares(edge, shares) for edge in edges) / 2.0
    unit = _common_unit(block, heads, at, ("x", "y"))
    return RawShape(
        source=block.source, points=np.asarray(middle), unit=unit, notes=("edges",)
    )


def _at_shares(points: Array, shares: Array) -> Array:
    steps = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    return np.column_stack(
        [np.interp(shares * steps[-1], steps, column) for column in points.T]
    )


def _displaced(
    numbers: Callable[[str], Array | None],
) -> tuple[Array | None, Array | None, list[str]]:
    """Return x = X + u and y = Y + v, where a program gives displacements."""
    first, u, v = numbers("X"), numbers("u"), numbers("v")
    if first is None or u is None or v is None:
        return None, None, []
    second = numbers("Y")
    return first + u, (v if second is None else second + v), ["u", "v", "X"]


def _alone(
    first: Array, second: Array | None
) -> tuple[Array | None, Array | None, list[str]]:
    """Return X and Y as the points, as ImageJ heads them; not an undeformed rod's."""
    if second is None or not np.ptp(second):
        return None, None, []
    return first, second, ["X", "Y"]


def _common_unit(
    block: Block, heads: Sequence[_Head], at: dict[str, int], names: Sequence[str]
) -> str:
    units = {heads[at[name]].unit or block.unit for name in names}
    if len(units) > 1:
        raise ConfigError(
            f"{block.source}: x, y and s must be in one unit; instead they are in "
            f"{' and '.join(sorted(unit or 'none' for unit in units))}"
        )
    return units.pop() if units else block.unit


def _by_parameters(
    whole: RawShape, block: Block, heads: Sequence[_Head]
) -> list[RawShape]:
    """Part a long table where a column that tells shapes apart changes."""
    keys: dict[str, Array] = {}
    names: dict[str, list[str]] = {}
    for (head, values), parsed in zip(block.columns, heads, strict=True):
        if parsed.quantity in QUANTITIES or parsed.case or head in KEPT:
            continue
        if isinstance(values, np.ndarray):
            few = len(np.unique(values)) <= max(1, len(values) // 3)
            if few and np.all(np.isfinite(values)):
                keys[head] = values
        elif parsed.quantity.lower() in ("image", "run", "model", "name", "curve"):
            names[head] = values
    if not keys and not names:
        return [whole]
    rows: dict[tuple[object, ...], list[int]] = {}
    columns = [*keys.values(), *names.values()]
    for i, key in enumerate(zip(*columns, strict=True)):
        rows.setdefault(key, []).append(i)
    shapes = []
    for key, places in rows.items():
        told = dict(zip(keys, map(float, key[: len(keys)]), strict=True))  # type: ignore[arg-type]
        name = " ".join(str(part) for part in key[len(keys) :])
        shapes.append(_rows(whole, places, dict(whole.parameters) | told, name))
    return shapes


def _rows(
    whole: RawShape, places: list[int], parameters: dict[str, float], name: str
) -> RawShape:
    def some(values: Array | None) -> Array | None:
        return None if values is None else values[places]

    return RawShape(
        source=f"{whole.source}, {name}" if name else whole.source,
        points=whole.points[places], unit=whole.unit, s=some(whole.s),
        theta=some(whole.theta), theta_unit=whole.theta_unit, kappa=some(whole.kappa),
        material=some(whole.material), parameters=parameters, notes=whole.notes,
        kept={head: values[places] for head, values in whole.kept.items()},
    )  # fmt: skip
