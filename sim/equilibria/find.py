"""All planar equilibria of a rod: in a uniform field scanned, before magnets sought."""

from __future__ import annotations

from ...core.checks import whole
from ...core.specimen import Specimen
from ..fields import Field, Support, as_field, check_case, check_plain
from .before_magnets import equilibria_before
from .uniform import (
    Equilibrium,
    planar_rod,
    refuse_weight,
    uniform_equilibria,
)


def find_equilibria(
    specimen: Specimen,
    field: Field,
    *,
    support: Support | None = None,
    points: int = 61,
) -> tuple[Equilibrium, ...]:
    """Return all planar equilibria, by rising tip angle.

    Parameters
    ----------
    specimen : Specimen
        Any number of sections; weightless.
    field : UniformField, MagnetField, Field or sources
        Any strength and angle; one that is not uniform must be planar, and the rod
        magnetised alike all along (`equilibria.before_magnets`, which takes seconds).
    support : Support, optional
        Clamp angle and load factor; weight must be zero.
    points : int
        Points of each centreline.

    Raises
    ------
    InputError
        If weight is asked for or the load is out of range.

    Examples
    --------
    >>> from magbend.core import Section, Specimen
    >>> from magbend.sim import UniformField
    >>> rod = Specimen(name="bar", side_mm=1.0, remanence_mT=20.0,
    ...                sections=(Section(length_mm=30.0, E_MPa=10.0),))
    >>> found = find_equilibria(rod, UniformField(flux_mT=1500.0))
    >>> [(round(e.theta_tip_rad, 3), e.morse_index) for e in found]
    [(-4.591, 0), (-3.549, 1), (1.55, 0)]
    """
    points = whole(points, 2, 1_000_000, "points")
    support = support or Support()
    field = as_field(field)
    uniform = field.uniform
    if uniform is None:
        check_case(specimen, field, support)
        check_plain(specimen)
        refuse_weight(support)
        return equilibria_before(specimen, field, support, points)
    return uniform_equilibria(planar_rod(specimen, uniform, support), points)
