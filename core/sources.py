"""Sources of a magnetic field and where they stand in the specimen frame.

Every source but the uniform field and the map has a pose: its own +z axis points along
`axis_angle_deg` (in the specimen's xy plane, from +x) and `elevation_deg` (toward +z).
Its centre is at `centre_mm`; or, as that of a magnet on a stage, at a gap: `gap_mm`
from the middle of its front face (that at its own +z end) to the rod's undeformed tip,
along its axis, and shifted by `offset_mm`. A gap not given comes with the case.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from .checks import finite, shown, size, store, vector, whole, within
from .errors import InputError
from .magnet import Vector, axes_of
from .units import MU0

Matrix = tuple[Vector, Vector, Vector]


class Source(Protocol):
    """What a field asks of every source."""

    @property
    def kind(self) -> str:
        """What it is, as in a file."""

    @property
    def follows_gap(self) -> bool:
        """Whether its gap comes with the case."""

    @property
    def in_plane(self) -> bool:
        """Whether its field has no component across the specimen's plane in it."""


FLUX_LIMIT_T = 30.0
"""Fields and remanences above this are refused as mistaken units (mT for T)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Posed:
    """What all sources with a pose share; see the module's docstring."""

    kind: ClassVar[str] = "source"
    axis_angle_deg: float = 90.0
    elevation_deg: float = 0.0
    centre_mm: Vector | None = None
    gap_mm: float | None = None
    offset_mm: Vector = (0.0, 0.0, 0.0)

    def _check_pose(self) -> None:
        store(
            self,
            axis_angle_deg=finite(self.axis_angle_deg, "axis_angle_deg", "deg"),
            elevation_deg=finite(self.elevation_deg, "elevation_deg", "deg"),
            offset_mm=vector(self.offset_mm, "offset_mm", "mm", 1e9),
        )
        if self.gap_mm is not None:
            store(self, gap_mm=size(self.gap_mm, "gap_mm", "mm"))
        if self.centre_mm is None:
            return
        store(self, centre_mm=vector(self.centre_mm, "centre_mm", "mm", 1e9))
        if self.gap_mm is not None or any(self.offset_mm):
            raise InputError(
                f"a {self.kind} must have either centre_mm, or gap_mm and offset_mm, "
                "in mm; instead received both"
            )

    @property
    def half_mm(self) -> float:
        """Distance of the front face from the centre, in mm."""
        return 0.0

    @property
    def follows_gap(self) -> bool:
        """Whether its gap comes with the case."""
        return self.centre_mm is None and self.gap_mm is None

    @property
    def in_plane(self) -> bool:
        """Whether its field has no component across the specimen's plane in it."""
        z_mm = self.offset_mm[2] if self.centre_mm is None else self.centre_mm[2]
        return self.elevation_deg == 0.0 and z_mm == 0.0

    def axes(self) -> Matrix:
        """Return its own x, y, z axes as unit vectors of the specimen frame."""
        return axes_of(self.axis_angle_deg, self.elevation_deg)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cuboid(Posed):
    """A cuboid permanent magnet, polarised along its own z.

    Parameters
    ----------
    sides_mm : tuple of float
        Along its own x, y, z, in mm: z along the axis, x in the table's plane. A single
        number is a cube.
    remanence_T : float
        In T; negative turns the poles round.
    """

    kind: ClassVar[str] = "cuboid"
    sides_mm: Vector
    remanence_T: float

    def __post_init__(self) -> None:
        sides = self.sides_mm
        if isinstance(sides, (int, float)):
            sides = (sides, sides, sides)
        sides = vector(sides, "cuboid sides_mm", "mm")
        for side in sides:
            size(side, "cuboid side_mm", "mm")
        store(self, sides_mm=sides, remanence_T=_remanence(self.remanence_T, self.kind))
        self._check_pose()

    @property
    def half_mm(self) -> float:
        """Half its side along its own z, in mm."""
        return self.sides_mm[2] / 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Cylinder(Posed):
    """A cylindrical permanent magnet, polarised along its axis.

    Parameters
    ----------
    diameter_mm, length_mm : float
        In mm.
    remanence_T : float
        In T; negative turns the poles round.
    """

    kind: ClassVar[str] = "cylinder"
    diameter_mm: float
    length_mm: float
    remanence_T: float

    def __post_init__(self) -> None:
        store(
            self,
            diameter_mm=size(self.diameter_mm, "cylinder diameter_mm", "mm"),
            length_mm=size(self.length_mm, "cylinder length_mm", "mm"),
            remanence_T=_remanence(self.remanence_T, self.kind),
        )
        self._check_pose()

    @property
    def half_mm(self) -> float:
        """Half its length, in mm."""
        return self.length_mm / 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Dipole(Posed):
    """A dipole, or the sphere whose outside it is.

    Parameters
    ----------
    moment_A_m2 : float, optional
        Its moment in A m2, along its own z; or a sphere's remanence:
    remanence_T : float, optional
        Of a sphere of `diameter_mm`, in T.
    diameter_mm : float
        Of what a rod may not enter, in mm; 0 is a point.
    """

    kind: ClassVar[str] = "dipole"
    moment_A_m2: float | None = None
    remanence_T: float | None = None
    diameter_mm: float = 0.0

    def __post_init__(self) -> None:
        diameter = within(self.diameter_mm, 0.0, 1e9, "dipole diameter_mm", "mm")
        store(self, diameter_mm=diameter)
        if (self.moment_A_m2 is None) == (self.remanence_T is None):
            raise InputError(
                "a dipole must have either moment_A_m2 in A m2, or remanence_T in T "
                "and diameter_mm in mm; instead received both or neither"
            )
        if self.remanence_T is None:
            moment = within(self.moment_A_m2 or 0.0, -1e9, 1e9, "moment_A_m2", "A m2")
            store(self, moment_A_m2=moment)
        else:
            size(self.diameter_mm, "diameter_mm of a sphere with remanence_T", "mm")
            store(self, remanence_T=_remanence(self.remanence_T, self.kind))
        self._check_pose()

    @property
    def half_mm(self) -> float:
        """Half its diameter, in mm."""
        return self.diameter_mm / 2.0

    @property
    def strength_A_m2(self) -> float:
        """Its moment in A m2, whichever way it was given."""
        if self.remanence_T is None:
            return self.moment_A_m2 or 0.0
        return self.remanence_T / MU0 * math.pi / 6.0 * (self.diameter_mm * 1e-3) ** 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Coil(Posed):
    """A circular coil: a ring, or a single layer of some length.

    Parameters
    ----------
    diameter_mm : float
        Of the winding's middle, in mm.
    current_A : float
        Counter-clockwise seen from its own +z, in A.
    turns : int
        How many.
    length_mm : float
        Of the layer, in mm; 0 is a ring.
    wire_mm : float
        Thickness of the winding, in mm, which a rod may not enter.
    """

    kind: ClassVar[str] = "coil"
    diameter_mm: float
    current_A: float
    turns: int = 1
    length_mm: float = 0.0
    wire_mm: float = 0.0

    def __post_init__(self) -> None:
        diameter = size(self.diameter_mm, "coil diameter_mm", "mm")
        store(
            self,
            diameter_mm=diameter,
            current_A=within(self.current_A, -1e9, 1e9, "coil current_A", "A"),
            turns=whole(self.turns, 1, 1_000_000_000, "coil turns"),
            length_mm=within(self.length_mm, 0.0, 1e9, "coil length_mm", "mm"),
            wire_mm=within(self.wire_mm, 0.0, diameter, "coil wire_mm", "mm"),
        )
        self._check_pose()

    @property
    def half_mm(self) -> float:
        """Half its length, in mm."""
        return self.length_mm / 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Uniform:
    """A uniform field.

    Parameters
    ----------
    flux_mT : float
        Flux density in mT; negative turns it round.
    angle_deg, elevation_deg : float
        Direction in the specimen's plane from +x, and out of it toward +z, in degrees.
    """

    kind: ClassVar[str] = "uniform"
    flux_mT: float
    angle_deg: float = 90.0
    elevation_deg: float = 0.0

    def __post_init__(self) -> None:
        limit_mT = FLUX_LIMIT_T * 1e3
        store(
            self,
            flux_mT=within(self.flux_mT, -limit_mT, limit_mT, "flux_mT", "mT"),
            angle_deg=within(self.angle_deg, -36000.0, 36000.0, "angle_deg", "deg"),
            elevation_deg=within(
                self.elevation_deg, -90.0, 90.0, "elevation_deg", "deg"
            ),
        )

    @property
    def follows_gap(self) -> bool:
        """No: it is the same everywhere."""
        return False

    @property
    def in_plane(self) -> bool:
        """Whether it has no component across the specimen's plane."""
        return self.elevation_deg == 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Gradient:
    """A field that grows linearly from a point at which it is zero.

    Parameters
    ----------
    gradient_mT_per_mm : 3 x 3 numbers
        dB_i / dx_j in mT/mm (= T/m), rows i. Without curl and divergence: symmetric,
        and the diagonal adds up to zero.
    centre_mm : tuple of float
        Where the field is zero, in mm.
    """

    kind: ClassVar[str] = "gradient"
    gradient_mT_per_mm: Matrix
    centre_mm: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        given: Any = self.gradient_mT_per_mm
        rows = given.tolist() if hasattr(given, "tolist") else given
        if not isinstance(rows, (list, tuple)) or len(rows) != 3:
            raise InputError(
                "gradient_mT_per_mm must be 3 rows of 3 numbers in mT/mm; instead "
                f"received {shown(given)}"
            )
        g = [vector(row, "gradient_mT_per_mm", "mT/mm", 1e6) for row in rows]
        largest = max(abs(value) for row in g for value in row)
        trace = g[0][0] + g[1][1] + g[2][2]
        curl = max(abs(g[i][j] - g[j][i]) for i in range(3) for j in range(i))
        if max(abs(trace), curl) > 1e-9 * largest:
            raise InputError(
                "gradient_mT_per_mm in mT/mm must be symmetric with a diagonal that "
                "adds up to zero, as Maxwell's equations ask; instead received a "
                f"diagonal that adds up to {trace:g} and an asymmetry of {curl:g}"
            )
        store(
            self,
            gradient_mT_per_mm=tuple(g),
            centre_mm=vector(self.centre_mm, "gradient centre_mm", "mm", 1e9),
        )

    @property
    def follows_gap(self) -> bool:
        """No: its centre is given."""
        return False

    @property
    def in_plane(self) -> bool:
        """Whether it has no component across the specimen's plane in it."""
        g = self.gradient_mT_per_mm
        return g[0][2] == 0.0 and g[1][2] == 0.0 and g[2][2] * self.centre_mm[2] == 0.0


def _remanence(value: float, kind: str) -> float:
    return within(value, -FLUX_LIMIT_T, FLUX_LIMIT_T, f"{kind} remanence_T", "T")
