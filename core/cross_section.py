"""Cross-sections of rods: square, rectangle, round and tube."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .checks import shown, size
from .errors import InputError

SIZES = {
    "square": ("side_mm",),
    "rectangle": ("width_mm", "height_mm"),
    "round": ("diameter_mm",),
    "tube": ("diameter_mm", "bore_mm"),
}
"""Shapes, and the sizes each is given by."""
ALL_SIZES = ("side_mm", "width_mm", "height_mm", "diameter_mm", "bore_mm")
ODD_FIFTHS = 1.004523762795139616133
"""Sum of 1 / k^5 over odd k: 31/32 zeta(5)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CrossSection:
    """The cross-section of a rod.

    Parameters
    ----------
    shape : str
        One of `SIZES`.
    width_mm, height_mm : float
        Extent within the specimen's xy plane (which the camera sees), and along z.
    bore_mm : float
        Inner diameter of a tube, else 0.
    """

    shape: str
    width_mm: float
    height_mm: float
    bore_mm: float = 0.0

    @property
    def is_round(self) -> bool:
        """Whether it is bounded by circles."""
        return self.shape in ("round", "tube")

    @property
    def is_isotropic(self) -> bool:
        """Whether it bends as easily in all directions."""
        return self.width_mm == self.height_mm

    @property
    def area_mm2(self) -> float:
        """Area of the material, in mm2."""
        if self.is_round:
            return math.pi / 4.0 * (self.width_mm**2 - self.bore_mm**2)
        if self.is_isotropic:
            return self.width_mm**2
        return self.width_mm * self.height_mm

    @property
    def in_plane_mm4(self) -> float:
        """Second moment of area for bending within the xy plane, in mm4."""
        if self.is_round:
            return math.pi / 64.0 * (self.width_mm**4 - self.bore_mm**4)
        if self.is_isotropic:
            return self.width_mm**4 / 12.0
        return self.height_mm * self.width_mm**3 / 12.0

    @property
    def across_mm4(self) -> float:
        """Second moment of area for bending out of that plane, in mm4."""
        if self.is_isotropic:
            return self.in_plane_mm4
        return self.width_mm * self.height_mm**3 / 12.0

    @property
    def torsion_mm4(self) -> float:
        """Torsion constant J, in mm4."""
        if self.is_round:
            return 2.0 * self.in_plane_mm4
        return torsion_constant_mm4(self.width_mm, self.height_mm)

    def shear_factor(self, poisson_ratio: float) -> float:
        """Return Cowper's k: the shear stiffness is k G A.

        Notes
        -----
        J. Appl. Mech. 33, 335 (1966): rectangles 10 (1 + nu) / (12 + 11 nu); circles
        6 (1 + nu) / (7 + 6 nu); tubes, with m the bore over the diameter, 6 (1 + nu)
        (1 + m^2)^2 / ((7 + 6 nu) (1 + m^2)^2 + (20 + 12 nu) m^2).
        """
        nu = poisson_ratio
        if not self.is_round:
            return 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu)
        m2 = (self.bore_mm / self.width_mm) ** 2
        wall = (1.0 + m2) ** 2
        return (
            6.0
            * (1.0 + nu)
            * wall
            / ((7.0 + 6.0 * nu) * wall + (20.0 + 12.0 * nu) * m2)
        )

    def change(self, name: str) -> tuple[float, float]:
        """Return the derivatives of area (mm) and in-plane moment (mm3) by a size.

        ``side_mm`` of a rod that is no square stands for its size as a whole: all its
        sizes grow in proportion to the extent in the plane.
        """
        w, h, b = self.width_mm, self.height_mm, self.bore_mm
        if name == "side_mm":
            return 2.0 * self.area_mm2 / w, 4.0 * self.in_plane_mm4 / w
        return {
            "width_mm": (h, h * w**2 / 4.0),
            "height_mm": (w, w**3 / 12.0),
            "diameter_mm": (math.pi / 2.0 * w, math.pi / 16.0 * w**3),
            "bore_mm": (-math.pi / 2.0 * b, -math.pi / 16.0 * b**3),
        }[name]


def torsion_constant_mm4(width_mm: float, height_mm: float) -> float:
    """Return the torsion constant J of a rectangle, in mm4.

    Notes
    -----
    Saint-Venant's series, J = b t^3 [1/3 - (64 / pi^5) (t / b) sum tanh(k pi b / 2 t) /
    k^5 over odd k], t the shorter side. The sum of 1 / k^5 is known, 31/32 zeta(5), and
    what the tanh lack of 1 falls as exp(-k pi b / t): six terms leave rounding. A
    square: 0.1405770150 a^4.
    """
    t, b = sorted((width_mm, height_mm))
    lacking = sum(
        (1.0 - math.tanh(k * math.pi * b / (2.0 * t))) / k**5 for k in range(1, 13, 2)
    )
    series = ODD_FIFTHS - lacking
    return b * t**3 * (1.0 / 3.0 - 64.0 / math.pi**5 * t / b * series)


def cross_section(shape: object, whose: str, **sizes_mm: float | None) -> CrossSection:
    """Return the cross-section that sizes describe.

    Parameters
    ----------
    shape : str
        One of `SIZES`.
    whose : str
        Whose it is, for the message: ``"specimen 'A'"``.
    sizes_mm : float or None
        By their names (`ALL_SIZES`); None or 0 where not given.

    Raises
    ------
    InputError
        If the shape is none of these, a size is missing, does not belong to it or is
        not above zero, or a bore is not within the diameter.
    """
    if not isinstance(shape, str) or shape not in SIZES:
        raise InputError(
            f"shape of {whose} must be one of {', '.join(SIZES)}; instead received "
            f"{shown(shape)}"
        )
    wanted = SIZES[shape]
    for name in ALL_SIZES:
        if name not in wanted and sizes_mm.get(name):
            raise InputError(
                f"{name} in mm does not belong to {whose}, whose shape is {shape}: "
                f"it is given by {' and '.join(wanted)}"
            )
    width = size(sizes_mm.get(wanted[0]) or 0.0, f"{wanted[0]} of {whose}", "mm")
    if len(wanted) == 1:
        return CrossSection(shape=shape, width_mm=width, height_mm=width)
    second = size(sizes_mm.get(wanted[1]) or 0.0, f"{wanted[1]} of {whose}", "mm")
    if shape == "rectangle":
        return CrossSection(shape=shape, width_mm=width, height_mm=second)
    if second >= width:
        raise InputError(
            f"bore_mm of {whose} must be below its diameter_mm of {width:g} mm; "
            f"instead received {second:g} mm"
        )
    return CrossSection(shape=shape, width_mm=width, height_mm=width, bore_mm=second)
