"""The solid in space: a rod whose sections have a solid's law."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...core.cross_section import CrossSection
from ...core.errors import InputError
from ...core.specimen import Specimen
from ...core.units import MU0
from ..fields import Field, Support
from ..spatial import law
from ..spatial.march import C1, C3, WIDTH, H
from ..spatial.rod import SpatialRod, rod_table
from ..spatial.solver import SpatialSolution, solve_table
from .constants import SolidConstants, joint_share, solid_constants

Array = NDArray[np.float64]


def solve_in_space(
    specimen: Specimen, field: Field, support: Support, poisson_ratio: float,
    points: int,
) -> SpatialSolution:  # fmt: skip
    """Return the equilibrium in space of a straight solid magnetised along its axis."""
    table, shown = solid_tables(specimen, support, poisson_ratio)
    L = specimen.length_mm
    across = specimen.cross_sections
    margin = 0.5 * max(min(part.width_mm, part.height_mm) for part in across) / L
    unit_Nmm = specimen.sections[0].E_MPa * across[0].in_plane_mm4 / L
    return solve_table(table, margin, L, unit_Nmm, field, support, points, shown)


def largest_strain(
    specimen: Specimen, support: Support, solution: SpatialSolution
) -> float:
    """Return the largest strain at the points of a solution: of bending and tension."""
    kappa = np.abs(solution.curvature_per_mm)
    joints = np.array(specimen.joints_mm)
    place = np.searchsorted(joints, solution.s_mm, side="right")
    w, h, round_ = np.array(
        [
            (part.width_mm, part.height_mm, part.is_round)
            for part in specimen.cross_sections
        ]
    )[place].T
    bent = np.where(
        round_,
        np.hypot(kappa[:, 0], kappa[:, 1]) * w,
        kappa[:, 0] * h + kappa[:, 1] * w,
    )
    flux = float(np.linalg.norm(solution.flux_tip_mT))
    pull = max(
        abs(remanence) * flux * 1e-12 / MU0 / section.E_MPa * support.load_factor
        for remanence, section in zip(
            specimen.remanences_mT, specimen.sections, strict=True
        )
    )
    return 0.5 * float(np.max(bent, initial=0.0)) + pull


@lru_cache(maxsize=256)
def solid_tables(
    specimen: Specimen, support: Support, poisson_ratio: float
) -> tuple[Array, Array]:
    """Return the rod as `spatial.march` takes it, tip first, (n, 40), and its sections.

    What a fixed face does to the rod, and a stiffer neighbour beyond a joint, is that
    of a short stiffer piece: as long as is needed for the shift that comes with the
    turn. There are more rows than sections for that; the second array has, in the place
    of each piece, the section that it is a piece of.
    """
    given = replace(specimen, poisson_ratio=poisson_ratio)
    rod = rod_table(SpatialRod.from_specimen(given), support)[::-1]
    sections = given.cross_sections
    found = [solid_constants(across, poisson_ratio) for across in sections]
    table = np.zeros((len(rod), law.SOLID_WIDTH))
    table[:, :WIDTH] = rod
    for row, across, constants in zip(table, sections, found, strict=True):
        _write_law(row, across, constants, poisson_ratio, specimen.length_mm)
    rows: list[Array] = []
    shown: list[Array] = []
    L = specimen.length_mm
    last = len(table) - 1
    for i, row in enumerate(table):
        E_MPa = specimen.sections[i].E_MPa
        ends = []
        for side in (-1, 1):
            k = i + side
            share = 1.0 if k < 0 else 0.0
            if 0 <= k <= last and sections[k] == sections[i]:
                share = joint_share(min(E_MPa / specimen.sections[k].E_MPa, 1.0))
            ends.append(_end(row, sections[i], found[i], share, side, L))
        pieces = _with_ends(row, ends[0], ends[1], specimen.sections[i].length_mm)
        rows += pieces
        shown += [row] * len(pieces)
    return np.array(rows[::-1]), np.array(shown[::-1])


def _write_law(
    row: Array, across: CrossSection, constants: SolidConstants, nu: float, L: float
) -> None:
    """Write the columns of `law` into a row, in units of the rod's length L in mm."""
    w, h = across.width_mm / L, across.height_mm / L
    sizes = np.array([h, w, math.sqrt(w * h)]) ** 2
    radii = np.array([across.across_mm4, across.in_plane_mm4]) / across.area_mm2 / L**2
    row[law.T] = radii[1] * row[C1 + 1]
    row[law.R1 : law.R3 + 1] = row[law.T] / row[C1 : C3 + 1]
    row[law.G1] = row[law.G2] = row[law.T] * 2.0 * (1.0 + nu) / constants.shear
    row[law.BEND], row[law.TWIST] = constants.tension_bending, constants.tension_torsion
    row[law.STRETCH] = constants.tension_twice
    row[law.BEND2] = constants.bending_twice
    row[law.A1 : law.A2 + 1] = sizes[:2]
    row[law.B1 : law.B2 + 1] = constants.bow * sizes[:2]
    row[law.M1 : law.M2 + 1] = constants.twisted_shear * np.sqrt(sizes[:2] * sizes[2])
    row[law.P11 : law.P22 + 1] = constants.soften * radii * sizes[:2]
    pairs = sizes[[0, 0, 1]] * sizes[[1, 2, 2]]
    row[law.P12 : law.P23 + 1] = constants.cross * pairs
    row[law.P33] = constants.soften_twist * row[law.R3] * sizes[2]
    row[law.S1 : law.S2 + 1] = constants.stiff * sizes[:2]
    corner = np.sqrt(radii) if across.is_round else np.array([w, h]) / math.sqrt(12.0)
    row[law.FACE1], row[law.FACE2] = corner


def _end(
    row: Array, across: CrossSection, constants: SolidConstants, share: float,
    side: int, L: float,
) -> Array | None:  # fmt: skip
    """Return the stiffer piece at an end of a section, or None.

    `share` is how much of a fixed face's turn it has; `side` is -1 at the root's end,
    1 at the tip's, whose twist is the other way round. The piece is so long that its
    turn acts where it brings the tip to the right place: 0.4 of the shift, since a
    shear force at the face turns the rod a little less than the shift by a moment
    would have it.
    """
    if share == 0.0:
        return None
    sizes = np.array([across.height_mm, across.width_mm]) / L
    turn, shift = np.array(constants.turn), np.array(constants.shift)
    turns = np.append(turn * sizes, constants.twist_turn * sizes.prod() ** 0.5)
    lengths = np.minimum(0.8 * shift, turn) / np.where(turn > 0.0, turn, 1.0)
    piece = row.copy()
    piece[H] = max(*(np.where(turn > 0.0, lengths, 1.0) * sizes), 1.25 * turns[2])
    left = 1.0 - share * turns / piece[H]
    piece[C1 : C3 + 1] *= left
    piece[law.R1 : law.R3 + 1] /= left
    softens = row[law.P11 : law.P22 + 1] / row[law.R1 : law.R2 + 1]
    cubic = share * np.array(constants.turn_cubed) * sizes**3 / piece[H]
    bends = (softens - cubic) / left[:2] ** 3
    piece[law.P11 : law.P22 + 1] = bends * piece[law.R1 : law.R2 + 1]
    if across.is_round:  # bent about any axis alike
        piece[law.P12] = piece[law.P11]
    # What three turns one after the other do already depends on the piece's length.
    stiff = row[law.R1 : law.R3 + 1] / row[law.T]
    own = 0.5 * piece[H] * stiff @ (np.roll(turns, -1) - np.roll(turns, 1))
    mixed = sizes.prod() ** 2 / row[law.T] * constants.turn_mixed - own
    piece[law.D] = -side * share * mixed / (piece[H] * left.prod())
    return piece


def _with_ends(
    row: Array, root: Array | None, tip: Array | None, length_mm: float
) -> list[Array]:
    """Return a section's rows, root first, with its ends taken from its length."""
    ends = [piece for piece in (root, tip) if piece is not None]
    rest = row.copy()
    rest[H] -= sum(piece[H] for piece in ends)
    if rest[H] <= 0.0:
        raise InputError(
            "sections must be longer than what their ends feel for the solid model; "
            f"instead received one of {length_mm:g} mm, shorter than its "
            f"{(row[H] - rest[H]) / row[H] * length_mm:.3g} mm: use model 'rod'"
        )
    return [piece for piece in (root, rest, tip) if piece is not None]
