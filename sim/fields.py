"""What acts on a rod, how it is held, and what comes out: plain records.

Specimen frame and units as everywhere (`core.centreline`): mm, mT, degrees.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.checks import listed, shown, size, store, vector, within
from ..core.errors import InputError
from ..core.magnet import Magnet
from ..core.sources import FLUX_LIMIT_T, Cuboid, Source, Uniform
from ..core.specimen import Specimen
from ..core.units import cos_deg

GRAVITY_LIMIT_M_S2 = 1000.0
"""Weight beyond about a hundred g is refused as a mistaken unit."""

STABLE = "stable"
UNSTABLE = "unstable"
PULLED_IN = "pulled in: no equilibrium"


class Field:
    """A field: the sum of its sources.

    Parameters
    ----------
    *sources : Cuboid, Cylinder, Dipole, Coil, Uniform, Gradient or FieldMap
        Any number; or one sequence of them.
    gap_mm : float, optional
        Gap of those sources that have neither a centre nor a gap of their own.

    Raises
    ------
    InputError
        If there is none, or something that is no source.

    Examples
    --------
    >>> from magbend.sim import Cuboid, Field, Uniform, gmc, solve
    >>> field = Field(Cuboid(sides_mm=55.0, remanence_T=1.3, gap_mm=60.0),
    ...               Uniform(flux_mT=-5.0))
    >>> round(solve(gmc(2), field).centreline.tip_mm[1], 3)
    3.73
    """

    __slots__ = ("_sources",)
    _sources: tuple[Source, ...]

    def __init__(
        self, *sources: Source | Iterable[Source], gap_mm: float | None = None
    ) -> None:
        given: Any = sources
        if len(sources) == 1 and not hasattr(sources[0], "kind"):
            given = listed(sources[0]) or ()
        for source in given:
            if not hasattr(source, "follows_gap"):
                raise InputError(
                    "sources of a field must each be a Cuboid, Cylinder, Dipole, Coil, "
                    f"Uniform, Gradient or FieldMap; instead received {shown(source)}"
                )
        if not given:
            raise InputError(
                "a field must have at least one source; instead received 0"
            )
        self._sources = tuple(given)
        if gap_mm is not None:
            self._sources = self.at_gap(gap_mm)._sources

    @property
    def sources(self) -> tuple[Source, ...]:
        """What it is the sum of."""
        return self._sources

    @property
    def in_plane(self) -> bool:
        """Whether it has no component across the rod's plane z = 0, in that plane."""
        return all(source.in_plane for source in self.sources)

    @property
    def follows_gap(self) -> bool:
        """Whether a source waits for a gap."""
        return any(source.follows_gap for source in self.sources)

    @property
    def uniform(self) -> UniformField | None:
        """The field in the plane, if it is uniform and within the plane; else None."""
        if not all(type(one) is Uniform and one.in_plane for one in self.sources):
            return None
        if len(self.sources) == 1:
            one: Any = self.sources[0]
            return UniformField(flux_mT=one.flux_mT, angle_deg=one.angle_deg)
        parts: Any = self.sources
        x = sum(one.flux_mT * cos_deg(one.angle_deg) for one in parts)
        y = sum(one.flux_mT * cos_deg(one.angle_deg - 90.0) for one in parts)
        angle_deg = math.degrees(math.atan2(y, x))
        return UniformField(flux_mT=math.hypot(x, y), angle_deg=angle_deg)

    def at_gap(self, gap_mm: float) -> Field:
        """Return the field with the sources that wait for a gap at this one, in mm."""
        return Field(
            replace(source, gap_mm=gap_mm) if source.follows_gap else source  # type: ignore[type-var, call-arg]
            for source in self.sources
        )

    def __eq__(self, other: object) -> bool:
        return type(other) is Field and self._sources == other._sources

    def __hash__(self) -> int:
        return hash(self._sources)

    def __repr__(self) -> str:
        return f"Field{self._sources!r}"


@dataclass(frozen=True, slots=True, kw_only=True)
class UniformField(Field):
    """A uniform field in the specimen's plane.

    Parameters
    ----------
    flux_mT : float
        Flux density in mT; negative turns the field round.
    angle_deg : float
        Direction of the flux from +x, counter-clockwise, in degrees.

    Raises
    ------
    InputError
        If a number is not finite or the flux is above 30 T.
    """

    flux_mT: float
    angle_deg: float = 90.0

    def __post_init__(self) -> None:
        limit_mT = FLUX_LIMIT_T * 1e3
        store(
            self,
            flux_mT=within(self.flux_mT, -limit_mT, limit_mT, "flux_mT", "mT"),
            angle_deg=within(self.angle_deg, -36000.0, 36000.0, "angle_deg", "deg"),
        )

    @property
    def sources(self) -> tuple[Source, ...]:
        """The one source."""
        return (Uniform(flux_mT=self.flux_mT, angle_deg=self.angle_deg),)

    @property
    def in_plane(self) -> bool:
        """It is."""
        return True

    @property
    def uniform(self) -> UniformField:
        """Itself."""
        return self


@dataclass(frozen=True, slots=True, kw_only=True)
class MagnetField(Field):
    """The field of a cuboid magnet at a gap from the undeformed tip.

    Parameters
    ----------
    magnet : Magnet
        The cuboid and its pose (see `core.magnet`).
    gap_mm : float
        Distance from the centre of the N face to the undeformed tip, along the
        magnet's axis, in mm.

    Raises
    ------
    InputError
        If the gap is not above zero or the remanence is above 30 T.
    """

    magnet: Magnet
    gap_mm: float

    def __post_init__(self) -> None:
        if not isinstance(self.magnet, Magnet):
            raise InputError(
                "magnet must be a Magnet, as Magnet.cube(55.0, 1.3) in mm and T is; "
                f"instead received {shown(self.magnet)}"
            )
        store(self, gap_mm=size(self.gap_mm, "gap_mm", "mm"))
        within(
            self.magnet.remanence_T,
            -FLUX_LIMIT_T, FLUX_LIMIT_T, "magnet remanence_T", "T",
        )  # fmt: skip

    @property
    def sources(self) -> tuple[Source, ...]:
        """The one source."""
        return (cuboid_of(self.magnet, self.gap_mm),)

    @property
    def in_plane(self) -> bool:
        """Whether the magnet is symmetric about the plane z = 0 of the rod."""
        return self.magnet.elevation_deg == 0.0 and self.magnet.offset_mm[2] == 0.0

    @property
    def uniform(self) -> None:
        """It is not."""


@lru_cache(maxsize=256)
def cuboid_of(magnet: Magnet, gap_mm: float | None = None) -> Cuboid:
    """Return a magnet as a source; without a gap, one that waits for it."""
    return Cuboid(
        sides_mm=magnet.sides_mm, remanence_T=magnet.remanence_T, gap_mm=gap_mm,
        axis_angle_deg=magnet.axis_angle_deg, elevation_deg=magnet.elevation_deg,
        offset_mm=magnet.offset_mm,
    )  # fmt: skip


def as_field(given: object, other: str = "or a source") -> Field:
    """Return a field, a single source or several of them as a field.

    Raises
    ------
    InputError
        If it is none of these.
    """
    if isinstance(given, Field):
        return given
    if hasattr(given, "follows_gap") or isinstance(given, (list, tuple)):
        return Field(given)  # type: ignore[arg-type]
    raise InputError(
        "field must be a UniformField in mT, a MagnetField in mm, a Field of sources "
        f"{other}; instead received {shown(given)}"
    )


def gap_of(field: object) -> str:
    """Return what a message says of where the sources stand."""
    gaps = [
        gap for one in as_field(field).sources if (gap := getattr(one, "gap_mm", 0))
    ]
    if gaps:
        return " and ".join(f"{gap:g} mm" for gap in gaps)
    return kinds_of(as_field(field))


def kinds_of(field: Field) -> str:
    """Return what a message says of the sources of a field: their kinds, in order."""
    return ", ".join(source.kind for source in field.sources)


def before(magnet: Magnet | Field) -> Field:
    """Return a magnet, or a field whose sources wait for a gap, as a field."""
    return magnet if isinstance(magnet, Field) else Field(cuboid_of(magnet))


def check_case(specimen: object, field: object, support: object) -> None:
    """Refuse what is no rod, no field or no support.

    Raises
    ------
    InputError
        If one is of another type.
    """
    if not isinstance(specimen, Specimen):
        raise InputError(
            "specimen must be a Specimen, as gmc(2) is; instead received "
            f"{shown(specimen)}"
        )
    as_field(field)
    if not isinstance(support, Support):
        raise InputError(
            f"support must be a Support; instead received {shown(support)}"
        )


def refuse_outside(
    field: Field,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    unit_mm: float,
    z: NDArray[np.float64] | None = None,
) -> None:
    """Refuse a rod that leaves the box of a map: nobody measured there.

    Raises
    ------
    InputError
        If one of its points, in units of `unit_mm`, does.
    """
    maps = maps_of(field)
    if not maps:
        return
    points_mm = np.column_stack([x, y, 0.0 * x if z is None else z]) * unit_mm
    for source in maps:
        if not source.holds(points_mm):
            raise InputError(
                "the rod leaves the box of the map of the field, from "
                f"{source.low_mm.tolist()} to {source.high_mm.tolist()} mm: measure "
                "farther out, or check the unit of its points"
            )


def outside(
    field: Field, curves: NDArray[np.float64], unit_mm: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Tell of planar rods which leave the box of a map.

    Parameters
    ----------
    field : Field
    curves : ndarray, shape (n, 2, points)
        x and y of each rod, in units of its own.
    unit_mm : ndarray, shape (n,)
        These units.
    """
    left = np.zeros(len(curves), dtype=np.bool_)
    maps = maps_of(field)
    if maps:
        points_mm = np.zeros((len(curves), curves.shape[2], 3))
        points_mm[..., :2] = curves.transpose(0, 2, 1) * unit_mm[:, None, None]
        for source in maps:
            left |= ~source.holds(points_mm)
    return left


def maps_of(field: Field) -> list[Any]:
    """Return the maps among the sources of a field."""
    if type(field) is not Field:
        return []
    return [source for source in field.sources if source.kind == "map"]


def check_plain(specimen: Specimen) -> None:
    """Refuse a rod that no planar solver takes: curved, or magnetised across.

    Raises
    ------
    InputError
        If it is either.
    """
    if not specimen.is_plain:
        raise InputError(
            f"specimen {specimen.name!r} must be straight and magnetised along its "
            f"axis here, which is planar; instead received {_unplain(specimen)}: "
            "`magbend sim shape` (solve, solve_spatial) takes it"
        )


def _unplain(specimen: Specimen) -> str:
    """Return the first number of a rod that no planar solver takes."""
    across = specimen.transverse_mT
    numbers = {
        "natural_curvature_per_mm": (specimen.natural_curvatures_per_mm, "1/mm"),
        "remanence_y_mT": ([y for y, _ in across], "mT"),
        "remanence_z_mT": ([z for _, z in across], "mT"),
    }
    return next(
        f"{name} {value:g} {unit}"
        for name, (values, unit) in numbers.items()
        for value in values
        if value
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Support:
    """How the rod is held, and what else acts on it.

    Parameters
    ----------
    clamp_angle_deg : float
        Direction of the rod's tangent at the clamp from +x, in degrees. The specimen
        frame, and with it the undeformed tip from which the gap counts, stays.
    gravity_m_s2 : tuple of float
        Acceleration of free fall (x, y, z) in the specimen frame, in m/s2: a bench seen
        from above has (0, 0, -9.80665). The default leaves weight out.
    load_factor : float
        Factor on the magnetic load, for sensitivity studies; 1 is the physics.

    Raises
    ------
    InputError
        If a number is not finite or out of range.
    """

    clamp_angle_deg: float = 0.0
    gravity_m_s2: tuple[float, float, float] = (0.0, 0.0, 0.0)
    load_factor: float = 1.0

    def __post_init__(self) -> None:
        clamp = within(self.clamp_angle_deg, -180.0, 180.0, "clamp_angle_deg", "deg")
        gravity = vector(self.gravity_m_s2, "gravity_m_s2", "m/s2", GRAVITY_LIMIT_M_S2)
        load = within(self.load_factor, 0.0, 1e6, "load_factor", "")
        store(self, clamp_angle_deg=clamp, gravity_m_s2=gravity, load_factor=load)

    @property
    def in_plane(self) -> bool:
        """Whether the weight, if any, acts within the specimen's plane."""
        return self.gravity_m_s2[2] == 0.0
