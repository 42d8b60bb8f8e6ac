"""Every kind of rod in every solver: one shape, or one sentence that refuses it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from magbend.core.cross_section import SIZES
from magbend.core.errors import InputError
from magbend.sim import (
    Cuboid,
    Field,
    Rod,
    Section,
    UniformField,
    find_equilibria,
    follow_path,
    profile_sections,
    sensitivities,
    solve,
    solve_many,
    solve_spatial,
    verify,
)

SECTIONS = (Section(length_mm=12.0, E_MPa=18.0), Section(length_mm=18.0, E_MPa=8.0))


def rod(**more: object) -> Rod:
    given = {"side_mm": 1.0, "sections": SECTIONS, **more}
    if "shape" in given:
        del given["side_mm"]
    return Rod(name="rod", remanence_mT=40.0, **given)


def parts(*remanences_mT: float) -> tuple[Section, ...]:
    return tuple(
        replace(one, remanence_mT=mT)
        for one, mT in zip(SECTIONS, remanences_mT, strict=True)
    )


PLAIN = {
    "square": rod(),
    "rectangle": rod(shape="rectangle", width_mm=0.8, height_mm=1.3),
    "round": rod(shape="round", diameter_mm=1.1),
    "tube": rod(shape="tube", diameter_mm=1.3, bore_mm=0.6),
    "reversed": rod(sections=parts(40.0, -30.0)),
    "off": rod(sections=parts(40.0, 0.0)),
    "profile": rod(sections=profile_sections([0, 30], E_MPa=[20, 6], pieces=10)),
}
CURVED = {
    "curved": rod(natural_curvature_per_mm=0.01),
    "tilted": rod(remanence_y_mT=15.0),
}
FIELDS = {
    "uniform": UniformField(flux_mT=40.0, angle_deg=70.0),
    "cuboid": Field(Cuboid(sides_mm=40.0, remanence_T=1.2, gap_mm=40.0)),
}


def many_tip(one: Rod, field: Field) -> tuple[float, float]:
    columns: dict[str, object] = {
        "length_mm": [part.length_mm for part in one.sections],
        "E_MPa": [part.E_MPa for part in one.sections],
        "remanence_mT": [one.remanences_mT],
    }
    columns |= {name: getattr(one, name) for name in SIZES[one.shape]}
    uniform = field.uniform
    if uniform:
        columns |= {"flux_mT": uniform.flux_mT, "angle_deg": uniform.angle_deg}
    (row,) = solve_many(columns, magnet=None if uniform else field)
    return row["tip_x_mm"], row["tip_y_mm"]


@pytest.mark.parametrize("field", FIELDS.values(), ids=FIELDS)
@pytest.mark.parametrize("one", PLAIN.values(), ids=PLAIN)
def test_plain_rods_have_one_shape_in_every_solver(one: Rod, field: Field) -> None:
    found = solve(one, field)
    tip = found.centreline.tip_mm
    assert found.status == "stable"
    assert verify(one, field, found, degree=24) < 1e-5
    assert math.dist(many_tip(one, field), tip) < 1e-5
    assert math.dist(solve_spatial(one, field).r_mm[-1, :2], tip) < 1e-5
    path = follow_path(one, field, load_factor=(0.5, 1.0), steps=2)
    assert math.dist(path.points[-1].centreline.tip_mm, tip) < 1e-9
    slope = sensitivities(one, field, parameters=["E_MPa[0]"]).dy_mm[-1, 0]
    ends = []
    for E in (1.001, 0.999):
        first = replace(one.sections[0], E_MPa=one.sections[0].E_MPa * E)
        other = replace(one, sections=(first, *one.sections[1:]))
        ends.append(solve(other, field).centreline.tip_mm[1])
    step = 0.002 * one.sections[0].E_MPa
    assert slope == pytest.approx((ends[0] - ends[1]) / step, rel=1e-4)


@pytest.mark.parametrize(
    ("one", "cause"),
    [(CURVED["curved"], "natural_curvature"), (CURVED["tilted"], "remanence_y_mT")],
    ids=CURVED,
)
def test_curved_and_tilted_rods_are_solved_in_space_and_refused_elsewhere(
    one: Rod, cause: str
) -> None:
    field = FIELDS["uniform"]
    space = solve_spatial(one, field)
    assert math.dist(space.r_mm[-1, :2], solve(one, field).centreline.tip_mm) < 1e-12
    straight = solve(rod(), field).centreline.tip_mm
    assert math.dist(space.r_mm[-1, :2], straight) > 0.5
    for task in (
        lambda: follow_path(one, field, load_factor=(0.5, 1.0)),
        lambda: find_equilibria(one, field),
    ):
        with pytest.raises(InputError, match=cause) as error:
            task()
        assert "\n" not in str(error.value)


def test_many_sections_take_time_in_proportion() -> None:
    """By steps, not by the clock: the march takes one step a section or more."""
    tips = []
    for pieces in (50, 500):
        sections = tuple(
            Section(length_mm=30.0 / pieces, E_MPa=9.0) for _ in range(pieces)
        )
        tips.append(solve(rod(sections=sections), FIELDS["cuboid"]).centreline.tip_mm)
    np.testing.assert_allclose(tips[1], tips[0], atol=1e-9)
