"""What stays the same on a rod's way through a lumen, in the kernels' lengths."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.specimen import Specimen
from ...core.units import rad_from_deg
from ..fields import Field
from ..scaling import field_array, stiffness_Nmm2
from .lumen import PUSH, Lumen
from .mesh import mesh
from .rod import Rod
from .walls import Walls

Array = NDArray[np.float64]
FieldOfWay = Field | Callable[[float], Field]


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A rod, a lumen, a field, and how to mesh them.

    Parameters
    ----------
    sections : ndarray, shape (k, 6)
        See `mesh.sections_of`.
    walls : Walls
        Of the lumen, in lengths of the rod.
    pieces : tuple of str
        Name of the wall of each of their pieces.
    tip : tuple of float or None
        Where the tip is held: mm, mm, degrees.
    """

    specimen: Specimen
    lumen: Lumen
    field: FieldOfWay
    sections: Array
    walls: Walls
    pieces: tuple[str, ...]
    friction: float
    elements: int
    tip: tuple[float, float, float] | None

    @property
    def length_mm(self) -> float:
        """Unit of lengths, in mm."""
        return self.specimen.length_mm

    @property
    def unit_N(self) -> float:
        """Unit of forces, in N."""
        return stiffness_Nmm2(self.specimen)[0] / self.length_mm**2

    @property
    def half(self) -> float:
        """Half the rod's largest side, in lengths of the rod."""
        return 0.5 * max(self.specimen.sides_mm) / self.length_mm

    @property
    def feeds(self) -> bool:
        """Whether the rod slides out of a guide."""
        return self.lumen.mode != PUSH

    def flux(self, insertion_mm: float) -> Array:
        """Return the field at an insertion, as the kernels take it.

        Raises
        ------
        InputError
            If it would lift the rod out of the plane.
        """
        given = self.field(insertion_mm) if callable(self.field) else self.field
        if not given.in_plane:
            raise InputError(
                "a field in a planar lumen must be within its plane (elevation_deg 0, "
                "no offset in z); instead received one that leaves it: a tube takes it"
            )
        return field_array(given, self.length_mm)

    def root(self, insertion_mm: float) -> Array:
        """Return x, y and angle of the clamp."""
        x, y = self.lumen.entry_mm
        angle = rad_from_deg(self.lumen.entry_angle_deg)
        back_mm = 0.0 if self.feeds else self.length_mm - insertion_mm
        x, y = x - back_mm * math.cos(angle), y - back_mm * math.sin(angle)
        return np.array([x / self.length_mm, y / self.length_mm, angle])

    def rod(self, insertion_mm: float) -> Rod:
        """Return the meshed rod at an insertion."""
        part = insertion_mm / self.length_mm if self.feeds else 1.0
        grip = np.zeros(4)
        if self.tip is not None:
            x, y, angle = self.tip
            grip[:] = 1.0, x / self.length_mm, y / self.length_mm, rad_from_deg(angle)
        return mesh(self.sections, part, self.root(insertion_mm), grip, self.elements)
