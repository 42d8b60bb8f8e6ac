"""What acts on a rod, how it is held, and what comes out: plain records.

Specimen frame and units as everywhere (`core.centreline`): mm, mT, degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..core.centreline import Centreline
from ..core.checks import shown, size, store, vector, within
from ..core.errors import InputError
from ..core.magnet import Magnet
from ..core.specimen import Specimen

FLUX_LIMIT_T = 30.0
"""Fields and remanences above this are refused as mistaken units (mT for T)."""

GRAVITY_LIMIT_M_S2 = 1000.0
"""Weight beyond about a hundred g is refused as a mistaken unit."""

STABLE = "stable"
UNSTABLE = "unstable"
PULLED_IN = "pulled in: no equilibrium"


@dataclass(frozen=True, slots=True, kw_only=True)
class UniformField:
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


@dataclass(frozen=True, slots=True, kw_only=True)
class MagnetField:
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
    def in_plane(self) -> bool:
        """Whether the magnet is symmetric about the plane z = 0 of the rod."""
        return self.magnet.elevation_deg == 0.0 and self.magnet.offset_mm[2] == 0.0


Field = UniformField | MagnetField


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
    if not isinstance(field, (UniformField, MagnetField)):
        raise InputError(
            "field must be a UniformField in mT or a MagnetField in mm; instead "
            f"received {shown(field)}"
        )
    if not isinstance(support, Support):
        raise InputError(
            f"support must be a Support; instead received {shown(support)}"
        )


def check_plain(specimen: Specimen) -> None:
    """Refuse a rod that no planar solver takes: curved, or magnetised across.

    Raises
    ------
    InputError
        If it is either.
    """
    if not specimen.is_plain:
        raise InputError(
            f"specimen {specimen.name!r} must have natural_curvature_per_mm in 1/mm "
            "and remanence_y_mT and remanence_z_mT in mT of 0 here; instead received "
            "another: solve and solve_spatial take it"
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """The equilibrium that the rod reaches when its load grows from zero.

    Parameters
    ----------
    centreline : Centreline or None
        The shape; None where there is no equilibrium.
    status : str
        ``stable``, ``unstable`` or ``pulled in: no equilibrium``.
    morse_index : int
        Number of directions, within the plane unless the solver is spatial, in which
        the equilibrium is unstable; 0 is stable, -1 where there is none.
    error_mm : float
        Bound of the numerical error of any point of the shape, in mm.
    flux_tip_mT : tuple of float
        Flux density (x, y) at the deformed tip (at the undeformed tip where there is
        no equilibrium), in mT.
    root_moment_Nm : float
        Bending moment at the clamp, in N m, counter-clockwise.
    load_limit : float
        Fraction of the load up to which the rod has an equilibrium continuously
        connected to the unloaded rod: 1 where the full load is reached.
    stable_in_space : bool or None
        Whether the equilibrium also holds against leaving the plane; None where that
        was not looked at (solid model) or there is no equilibrium.
    """

    centreline: Centreline | None
    status: str
    morse_index: int
    error_mm: float
    flux_tip_mT: tuple[float, float]
    root_moment_Nm: float
    load_limit: float = 1.0
    stable_in_space: bool | None = None
