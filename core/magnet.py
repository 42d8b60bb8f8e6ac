"""The cuboid magnet and where it stands in the specimen frame.

Magnet frame: centre at the origin, polarised along its own +z, N face at
z = +side_z / 2. The gap is the distance from the centre of the N face to the rod's
undeformed tip along the magnet's axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from .checks import finite, size, store, vector, within

Vector = tuple[float, float, float]


def axes_of(
    axis_angle_deg: float, elevation_deg: float
) -> tuple[Vector, Vector, Vector]:
    """Return own x, y, z axes as unit vectors of the specimen frame.

    Own z points along both angles (in degrees); own x stays in the specimen's xy plane.
    """
    a = math.radians(axis_angle_deg)
    e = math.radians(elevation_deg)
    z_axis = (math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e))
    x_axis = (math.sin(a), -math.cos(a), 0.0)
    y_axis = (
        z_axis[1] * x_axis[2] - z_axis[2] * x_axis[1],
        z_axis[2] * x_axis[0] - z_axis[0] * x_axis[2],
        z_axis[0] * x_axis[1] - z_axis[1] * x_axis[0],
    )
    return x_axis, y_axis, z_axis


@dataclass(frozen=True, slots=True, kw_only=True)
class Magnet:
    """A cuboid permanent magnet and its pose relative to the undeformed tip.

    Parameters
    ----------
    sides_mm : tuple of float
        Sides along the magnet's own x, y, z (polarisation), in mm.
    remanence_T : float
        Remanence in T along its own +z; negative turns the poles round.
    axis_angle_deg : float
        Direction of the polarisation in the specimen's xy plane, counter-clockwise
        from +x, in degrees. The default 90 is the bench of the paper: magnet on the
        -y side, N face toward the rod.
    elevation_deg : float
        Angle of the polarisation out of that plane toward +z, in degrees.
    offset_mm : tuple of float
        Shift (x, y, z) of the magnet in the specimen frame, in mm, away from the pose
        in which its axis passes through the undeformed tip.
    remanence_sd_T : float, optional
        Standard deviation of the remanence, where it is known.

    Raises
    ------
    InputError
        If a side is not above zero or a number is not finite.
    """

    sides_mm: Vector
    remanence_T: float
    axis_angle_deg: float = 90.0
    elevation_deg: float = 0.0
    offset_mm: Vector = (0.0, 0.0, 0.0)
    remanence_sd_T: float | None = None

    def __post_init__(self) -> None:
        sides = vector(self.sides_mm, "magnet sides_mm", "mm")
        for side in sides:
            size(side, "magnet side_mm", "mm")
        store(
            self,
            sides_mm=sides,
            remanence_T=finite(self.remanence_T, "magnet remanence_T", "T"),
            axis_angle_deg=finite(self.axis_angle_deg, "magnet axis_angle_deg", "deg"),
            elevation_deg=finite(self.elevation_deg, "magnet elevation_deg", "deg"),
            offset_mm=vector(self.offset_mm, "magnet offset_mm", "mm", 1e9),
        )
        if self.remanence_sd_T is not None:
            sd = within(self.remanence_sd_T, 0.0, 30.0, "magnet remanence_sd_T", "T")
            store(self, remanence_sd_T=sd)

    @classmethod
    def cube(cls, side_mm: float, remanence_T: float, **pose: float) -> Magnet:
        """Return a cube of the given side in mm and remanence in T."""
        return cls(
            sides_mm=(side_mm, side_mm, side_mm),
            remanence_T=remanence_T,
            **pose,  # type: ignore[arg-type]
        )

    def axes(self) -> tuple[Vector, Vector, Vector]:
        """Return the magnet's own x, y, z axes as unit vectors of the specimen frame.

        The magnet's x axis stays in the specimen's xy plane.
        """
        return axes_of(self.axis_angle_deg, self.elevation_deg)

    def centre_mm(self, *, length_mm: float, gap_mm: float) -> Vector:
        """Return the magnet's centre in the specimen frame, in mm.

        Parameters
        ----------
        length_mm : float
            Length of the rod: the undeformed tip is at (length_mm, 0, 0).
        gap_mm : float
            Distance from the centre of the N face to the undeformed tip, along the
            magnet's axis.
        """
        _, _, z_axis = self.axes()
        distance_mm = gap_mm + self.sides_mm[2] / 2.0
        dx, dy, dz = self.offset_mm
        return (
            length_mm - distance_mm * z_axis[0] + dx,
            -distance_mm * z_axis[1] + dy,
            -distance_mm * z_axis[2] + dz,
        )
