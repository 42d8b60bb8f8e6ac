"""What messages say of rods and fields that a solver does not take."""

from __future__ import annotations

from dataclasses import replace

import pytest

from magbend.core.errors import InputError
from magbend.sim import Coil, Cuboid, Field, follow_path, gmc, pull_in_gaps

PLACED = Field(
    Cuboid(sides_mm=20.0, remanence_T=1.3, gap_mm=60.0),
    Coil(diameter_mm=80.0, current_A=5.0, centre_mm=(0.0, -90.0, 0.0)),
)


def test_sources_are_named_by_their_kinds() -> None:
    with pytest.raises(InputError, match=r"instead received cuboid, coil$"):
        pull_in_gaps(gmc(2), PLACED, {"E_MPa": [5.0], "remanence_mT": [20.0]})
    with pytest.raises(InputError, match=r"has the sources cuboid, coil$"):
        follow_path(gmc(2), PLACED, flux_mT=(1.0, 2.0))


@pytest.mark.parametrize(
    ("number", "said"),
    [
        ({"natural_curvature_per_mm": 0.01}, "natural_curvature_per_mm 0.01 1/mm:"),
        ({"remanence_z_mT": -3.0}, "remanence_z_mT -3 mT:"),
    ],
)
def test_the_number_that_is_not_planar_is_named(number: dict, said: str) -> None:
    with pytest.raises(InputError, match=f"instead received {said}"):
        follow_path(replace(gmc(2), **number), PLACED, clamp_angle_deg=(0.0, 1.0))
