"""From rod to solid: a rod that predicts three-dimensional finite elements.

A plain rod is 0.3 to 0.6 % too soft at the tip against a hard-magnetic neo-Hookean
solid whose root face is fixed. Five effects, each a term of the rod's equations, close
the gap; `docs/explanations/solid.md` tells what each is worth and how its constant
was found.

* Stretch EA, and shear k GA with Cowper's k (J. Appl. Mech. 33, 335, 1966).
* The magnetic energy is -(1/mu0) (F Br).B: it follows r', stretched and sheared, not
  the unit tangent. The pole reduction stays exact: the load is the traction Br B / mu0
  on the end face, taken at four Gauss points of the face.
* A fixed face cannot contract sideways, so that bending cannot bow it: seen from afar
  the rod starts turned back by c a kappa(0) and shifted by d a^2 kappa(0).
* The same, smaller, at joints where E jumps.
* Finite strain: tension stiffens against bending, bending stretches the axis, and large
  curvature softens.

Small strains in the plane have a quick march of their own (`plane`); all else is
marched in space (`space`).
"""

from __future__ import annotations

from ...core.checks import within
from ...core.errors import InputError, SolverError
from ...core.specimen import Specimen
from ..fields import PULLED_IN, Field, Support, as_field, check_case, check_plain
from ..solution import Solution
from ..spatial.solver import SpatialSolution, solve_spatial
from .plane import solve_in_plane
from .space import largest_strain, solve_in_space

STRAIN_LIMIT = 0.2
"""Largest strain up to which the model was compared with finite elements."""
TWISTED_LIMIT = 0.1
"""The same of rectangles that leave their planes: of what a fixed face does to one that
is bent both ways and twisted the model has the leading term; the rest grows with the
square of strain."""
SMALL_STRAIN = 0.1
"""Largest strain for which the march in the plane is used; of tubes none, whose turn
at a fixed face grows sooner."""


def solve_solid(
    specimen: Specimen,
    field: Field,
    *,
    support: Support | None = None,
    poisson_ratio: float | None = None,
    points: int = 61,
) -> Solution:
    """Return the equilibrium of the solid, as `solve` does of the plain rod.

    Parameters
    ----------
    specimen, field, support, points
        As of `solve`; the rod straight and magnetised along its axis.
    poisson_ratio : float, optional
        Of all sections, from 0 to 0.5; that of the specimen by default.

    Returns
    -------
    Solution
        `s_mm` of the centreline counts undeformed material, so that its length along
        the curve differs from `length_mm` by the stretch; `theta_rad` is the direction
        of the deformed axis, `kappa_per_mm` its derivative by `s_mm`.

    Raises
    ------
    InputError
        If the rod is curved or magnetised across, the load or the strain is beyond the
        model, or the ratio is not from 0 to 0.5.
    SolverError
        If no answer was found that could be vouched for.
    """
    support = support or Support()
    field = as_field(field)
    check_case(specimen, field, support)
    check_plain(specimen)
    given = specimen.poisson_ratio if poisson_ratio is None else poisson_ratio
    ratio = within(given, 0.0, 0.5, "poisson_ratio", "")
    limit = STRAIN_LIMIT
    sections = specimen.cross_sections
    in_plane = support.in_plane and field.in_plane
    if in_plane and not any(across.bore_mm for across in sections):
        solution, strain = solve_in_plane(specimen, field, support, ratio, points)
        if strain <= SMALL_STRAIN:
            return solution
        if strain > 2.0 * STRAIN_LIMIT:  # whatever finer steps would say
            raise _too_strained(strain, STRAIN_LIMIT)
    elif not in_plane and not all(across.is_isotropic for across in sections):
        limit = TWISTED_LIMIT
    found: SpatialSolution | SolverError
    try:
        found = solve_in_space(specimen, field, support, ratio, points)
    except SolverError as error:
        found = error
    shape = found
    if isinstance(shape, SolverError) or shape.status == PULLED_IN:
        # Where the law softens beyond its range a solid may seem to give way.
        shape = solve_spatial(specimen, field, support=support)
    strain = largest_strain(specimen, support, shape)
    if strain > limit:
        raise _too_strained(strain, limit)
    if isinstance(found, SolverError):
        raise found
    return found.seen_from_above()


def _too_strained(strain: float, limit: float) -> InputError:
    twisted = " of rectangles out of the plane" if limit < STRAIN_LIMIT else ""
    return InputError(
        f"the largest strain{twisted} must be below {limit:g} for the solid model; "
        f"instead received {strain:.3g}: the rod is too thick or too soft for a "
        "rod model; model 'rod' gives a rough answer"
    )
