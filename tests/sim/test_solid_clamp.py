"""What a fixed face does to a bent prism, by finite elements of another's making."""

from __future__ import annotations

import numpy as np
import pytest
from skfem import (
    Basis,
    ElementHex2,
    ElementVector,
    FacetBasis,
    LinearForm,
    MeshHex,
    condense,
    solve,
)
from skfem.models.elasticity import lame_parameters, linear_elasticity

from magbend.core.cross_section import CrossSection
from magbend.sim.solid.constants import solid_constants

LENGTH = 4.0
"""In sides: the end zone has died out by a factor of a million before it is read."""


def graded(pieces: int, size: float, ratio: float = 0.45) -> np.ndarray:
    """Places from 0 to size, densest at 0."""
    steps = ratio ** np.arange(pieces)[::-1]
    return size * np.concatenate([[0.0], np.cumsum(steps)]) / np.sum(steps)


def bent_prism(poisson_ratio: float) -> tuple[float, float]:
    """Turn and shift of the axis beyond the end zone, over a kappa and a^2 kappa.

    A quarter of a square prism, its face z = 0 fixed, pure bending of curvature 1 at
    the far end (sigma_zz = -E x), quadratic hexahedra graded to edges and face.
    """
    cross = 0.5 - graded(5, 0.5)[::-1]
    along = np.concatenate([graded(8, 0.75), np.linspace(0.75, LENGTH, 7)[1:]])
    mesh = MeshHex.init_tensor(cross, cross, along)
    element = ElementVector(ElementHex2())
    basis = Basis(mesh, element, intorder=4)
    stiffness = linear_elasticity(*lame_parameters(1.0, poisson_ratio)).assemble(basis)
    far = mesh.facets_satisfying(lambda x: np.isclose(x[2], LENGTH))

    @LinearForm
    def pull(v, w):
        return -w.x[0] * v[2]

    load = pull.assemble(FacetBasis(mesh, element, facets=far, intorder=4))
    fixed = [
        basis.get_dofs(lambda x: np.isclose(x[2], 0.0)).all(),
        basis.get_dofs(lambda x: np.isclose(x[0], 0.0)).all(["u^2", "u^3"]),
        basis.get_dofs(lambda x: np.isclose(x[1], 0.0)).all(["u^2"]),
    ]
    moved = solve(*condense(stiffness, load, D=np.unique(np.concatenate(fixed))))
    z = np.linspace(2.4, 3.7, 6)
    axis = np.vstack([np.full_like(z, 1e-9), np.full_like(z, 1e-9), z])
    across = (basis.probes(axis) @ moved)[: len(z)]
    turn, shift = np.polyfit(z, across - 0.5 * z**2, 1)
    return -turn, shift


def test_the_clamp_turns_and_shifts_a_prism_as_finite_elements_say() -> None:
    turn, shift = bent_prism(0.3)
    square = CrossSection(shape="square", width_mm=1.0, height_mm=1.0)
    constants = solid_constants(square, 0.3)
    # The mesh's own error is 0.4 % of the turn; of the shift 0.2 %, and the constant
    # is a fit with 1.7 % left.
    assert constants.turn[1] == pytest.approx(turn, rel=0.01)
    assert constants.shift[1] == pytest.approx(shift, rel=0.03)
