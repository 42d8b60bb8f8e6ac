"""What shape and Poisson's ratio make of a solid's section.

Interpolated in `sections.csv`, which `benchmarks/solid_sections.py` computes: the law
by a neo-Hookean prism in uniform bending, torsion and tension (a problem of the
section's plane), the clamp by linear finite elements of a fixed face.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.checks import within
from ...core.cross_section import CrossSection
from ...core.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class SolidConstants:
    """Constants of a section, dimensionless; 1 is its d1 (in the plane), 2 its d2.

    Of pairs the first is for bending about d1, the second about d2, which the camera
    sees. Sizes are the extents that this bending stretches: (height, width), and
    sqrt(height width) in torsion; x are linear curvatures times them.

    Parameters
    ----------
    shear : float
        Cowper's shear coefficient k.
    tension_bending, tension_torsion : float
        Increase of curvature and twist, at a given moment, per axial strain.
    tension_twice, bending_twice : float
        Increase of the axial compliance per axial strain, and of the bending compliance
        per its square.
    soften : tuple of float
        Increase of curvature per x^2 at a given moment.
    stiff : tuple of float
        s in the energy's sixth order, E A (s_1 x_1^2 + s_2 x_2^2)^3 / 6.
    soften_twist : float
        The same of torsion: increase of twist per x_3^2 at a given moment.
    cross : tuple of float
        c in the energy E A c x_i^2 x_j^2 / 2 of the pairs 12, 13, 23.
    twisted_shear : tuple of float
        Shear, without a force, of a section bent and twisted: per x_i x_3.
    bow : tuple of float
        b in the energy N (x_1^2 + x_2^2) (b_1 x_1^2 + b_2 x_2^2) / 4.
    turn, shift : tuple of float
        Seen from afar the rod starts turned by -turn kappa(0) of a size, and shifted by
        shift kappa(0) of a size squared.
    twist_turn : float
        As `turn`, of torsion: a fixed face cannot warp.
    turn_cubed : tuple of float
        Increase of the turn, per x^3.
    turn_mixed : float
        c in the energy E A sqrt(height width) c x_1 x_2 x_3 of a fixed face.
    """

    shear: float
    tension_bending: float
    tension_torsion: float
    tension_twice: float
    bending_twice: float
    soften: tuple[float, float]
    soften_twist: float
    stiff: tuple[float, float]
    cross: tuple[float, float, float]
    twisted_shear: tuple[float, float]
    bow: tuple[float, float]
    turn: tuple[float, float]
    shift: tuple[float, float]
    twist_turn: float
    turn_cubed: tuple[float, float]
    turn_mixed: float


def solid_constants(across: CrossSection, poisson_ratio: float) -> SolidConstants:
    """Return the constants of a section.

    Parameters
    ----------
    across : CrossSection
        Square, round, a rectangle of sides at most 3 to 1, or a tube of a bore of at
        most 0.6 of its diameter.
    poisson_ratio : float
        From 0 to 0.5.

    Raises
    ------
    InputError
        If one of them lies outside.

    Notes
    -----
    A neo-Hookean fibre gives what tension does, whatever the shape: its compliance
    grows by (14 + 28 nu - 40 nu^2) / 9 per strain, that of bending by 2 nu more, since
    fibres come nearer to the axis, and by (31 - 6 nu + 228 nu^2 - 320 nu^3) / 9 per
    strain squared.
    """
    nu = within(poisson_ratio, 0.0, 0.5, "poisson_ratio", "")
    family, place = _place(across)
    ahead = _interpolated(family, place, nu)
    aside = _interpolated(family, -place, nu) if family == "rectangle" else ahead
    fibre = (14.0 + nu * (28.0 - nu * 40.0)) / 9.0
    return SolidConstants(
        shear=across.shear_factor(nu),
        tension_bending=fibre + 2.0 * nu,
        tension_torsion=ahead["tension_torsion"],
        tension_twice=fibre,
        bending_twice=(31.0 - nu * (6.0 - nu * (228.0 - nu * 320.0))) / 9.0,
        soften=(aside["soften"], ahead["soften"]),
        soften_twist=ahead["soften_twist"],
        stiff=(aside["stiff"], ahead["stiff"]),
        cross=(ahead["cross_bending"], aside["cross_torsion"], ahead["cross_torsion"]),
        twisted_shear=(aside["twisted_shear"], ahead["twisted_shear"]),
        bow=(aside["bow"], ahead["bow"]),
        turn=(aside["turn"], ahead["turn"]),
        shift=(aside["shift"], ahead["shift"]),
        twist_turn=ahead["twist_turn"],
        turn_cubed=(aside["turn_cubed"], ahead["turn_cubed"]),
        turn_mixed=ahead["turn_mixed"],
    )


def joint_share(E_ratio: float) -> float:
    """Return how much of a fixed face's turn a joint has, for its softer side.

    Parameters
    ----------
    E_ratio : float
        Softer over stiffer modulus, 0 to 1: 0 is a rigid neighbour, the clamp.

    Notes
    -----
    The factor 1.4 fits linear finite elements of two blocks at moduli 1 to 1.33, 1.5,
    2, 3 and 10 within 4 % of the turn of the clamp.
    """
    r = within(E_ratio, 0.0, 1.0, "E_ratio", "")
    return (1.0 - r) ** 2 / (1.0 + 1.4 * r)


def _place(across: CrossSection) -> tuple[str, float]:
    """Return the family of a section, and its place there."""
    if not across.is_round:
        ratio = across.width_mm / across.height_mm
        if not 1.0 / 3.0 <= ratio <= 3.0:
            raise InputError(
                "the solid model takes rectangles of sides at most 3 to 1; instead "
                f"received {across.width_mm:g} mm x {across.height_mm:g} mm: use model "
                "'rod'"
            )
        return "rectangle", math.log(ratio)
    bore = across.bore_mm / across.width_mm
    if bore > 0.6:
        raise InputError(
            "the solid model takes tubes of bores to 0.6 of the diameter; instead "
            f"received {across.bore_mm:g} mm of {across.width_mm:g} mm: use model 'rod'"
        )
    return "round", bore**2


def _interpolated(family: str, place: float, nu: float) -> dict[str, float]:
    names, places, ratios, values = _tables()[family]
    found = _lagrange(places, place) @ (_lagrange(ratios, nu) @ values)
    return dict(zip(names, found.tolist(), strict=True))


def _lagrange(nodes: Array, x: float) -> Array:
    """Return the weights of values at the nodes in the polynomial through them."""
    weights = np.ones_like(nodes)
    for i, node in enumerate(nodes):
        others = np.delete(nodes, i)
        weights[i] = np.prod((x - others) / (node - others))
    return weights


@lru_cache(maxsize=1)
def _tables() -> dict[str, tuple[list[str], Array, Array, Array]]:
    """Return of each family the names, places, Poisson's ratios, and values.

    The values have the shape (places, ratios, names).
    """
    with Path(__file__).with_name("sections.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    tables = {}
    for family in {row[0] for row in rows}:
        numbers = np.array([row[1:] for row in rows if row[0] == family], dtype=float)
        places, ratios = np.unique(numbers[:, 0]), np.unique(numbers[:, 1])
        ordered = numbers[np.lexsort((numbers[:, 1], numbers[:, 0]))]
        values = ordered[:, 2:].reshape(len(places), len(ratios), -1)
        tables[family] = (head[3:], places, ratios, values)
    return tables
