"""What cannot be is refused in one sentence; nothing returns NaN, nothing hangs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from magbend.core.errors import InputError
from magbend.core.magnet import Magnet
from magbend.core.specimen import Section, Specimen
from magbend.sim import (
    MagnetField,
    Support,
    UniformField,
    fit_magnet,
    gmc,
    magnet_flux_mT,
    solve,
)
from magbend.sim.equilibria import find_equilibria
from magbend.sim.spatial import SpatialRod, SpatialSection, solve_spatial

CUBE = Magnet.cube(55.0, 1.305)
FIELD = UniformField(flux_mT=50.0)
BAD = (math.nan, math.inf, -math.inf, 1e300, -1e300, 10**400, "5 mm", None, [], 1j)


def section(**changes) -> SpatialRod:
    sizes = {"length_mm": 10.0, "E_MPa": 20.0, "width_mm": 1.0, "height_mm": 1.0}
    return SpatialRod(sections=(SpatialSection(**(sizes | changes)),))


CASES = {
    "flux_mT": lambda v: UniformField(flux_mT=v),
    "angle_deg": lambda v: UniformField(flux_mT=1.0, angle_deg=v),
    "gap_mm": lambda v: MagnetField(magnet=CUBE, gap_mm=v),
    "sides?_mm": lambda v: Magnet.cube(v, 1.3),
    "sides?_mm  ": lambda v: Magnet(sides_mm=v, remanence_T=1.3),
    "remanence_T": lambda v: MagnetField(magnet=Magnet.cube(55.0, v), gap_mm=60.0),
    "offset_mm": lambda v: replace(CUBE, offset_mm=(0.0, v, 0.0)),
    "clamp_angle_deg": lambda v: Support(clamp_angle_deg=v),
    "load_factor": lambda v: solve(gmc(2), FIELD, support=Support(load_factor=v)),
    "gravity_m_s2": lambda v: Support(gravity_m_s2=(0.0, v, 0.0)),
    "length_mm": lambda v: Section(length_mm=v, E_MPa=1.0),
    "E_MPa": lambda v: Section(length_mm=1.0, E_MPa=v),
    "poisson_ratio": lambda v: solve(gmc(2), FIELD, model="solid", poisson_ratio=v),
    "points": lambda v: solve(gmc(2), FIELD, points=v),
    "specimen": lambda v: solve(v, FIELD),
    "field": lambda v: solve(gmc(2), v),
    "support": lambda v: solve(gmc(2), FIELD, support=v),
    "model": lambda v: solve(gmc(2), FIELD, model=v),
    "width_mm": lambda v: section(width_mm=v),
    "remanence_mT": lambda v: section(remanence_mT=(0.0, 0.0, v)),
    "rest_curvature_per_mm": lambda v: section(rest_curvature_per_mm=(0.0, v, 0.0)),
    "three floats": lambda v: solve_spatial(gmc(2), v),
    "flux_mT ": lambda v: solve_spatial(gmc(2), (0.0, v, 0.0)),
    "gap_mm ": lambda v: fit_magnet([v, 60.0], [50.0, 40.0]),
    "sides?_mm ": lambda v: fit_magnet([50.0, 60.0], [50.0, 40.0], sides_mm=v),
    "gap_mm  ": lambda v: magnet_flux_mT(CUBE, (30, 0, 0), length_mm=30.0, gap_mm=v),
    "points ": lambda v: find_equilibria(gmc(2), FIELD, points=v),
}


PLAIN_NUMBERS = ("poisson_ratio", "points", "points ")
"""A list in their place is Python's own TypeError."""
PAIRS = [
    (quantity, value)
    for quantity in CASES
    for value in BAD
    if not (isinstance(value, list) and quantity in PLAIN_NUMBERS)
]


@pytest.mark.parametrize(
    ("quantity", "value"), PAIRS, ids=lambda value: repr(value)[:20]
)
def test_what_cannot_be_is_named(quantity: str, value: object) -> None:
    with pytest.raises(InputError, match=quantity.strip()) as caught:
        CASES[quantity](value)
    assert len(str(caught.value)) < 300


def test_rods_and_curvatures_beyond_reason_do_not_hang() -> None:
    with pytest.raises(InputError, match="rest_curvature_per_mm"):
        solve_spatial(section(rest_curvature_per_mm=(0.0, 100.0, 0.0)), (0.0, 1.0, 0.0))
    thin = Specimen(
        name="thread", side_mm=1e-9, remanence_mT=20.0,
        sections=(Section(length_mm=30.0, E_MPa=1.0),),
    )  # fmt: skip
    with pytest.raises(InputError, match="stiffness"):
        solve(thin, FIELD)
    assert np.isfinite(solve(gmc(2), UniformField(flux_mT=1e-300)).error_mm)
