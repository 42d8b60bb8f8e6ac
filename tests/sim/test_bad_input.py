"""What cannot be is refused in one sentence; nothing returns NaN, nothing hangs."""

from __future__ import annotations

import math
from collections.abc import Callable
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
    sensitivities,
    solve,
    solve_many,
)
from magbend.sim.batch.shapes import Designs, designs_of, solve_shapes
from magbend.sim.check.against import verify
from magbend.sim.equilibria.find import find_equilibria
from magbend.sim.scaling import field_array, rod_array, stations
from magbend.sim.spatial.solver import SpatialRod, SpatialSection, solve_spatial
from magbend.sim.study.sweep import sweep

CUBE = Magnet.cube(55.0, 1.305)
FIELD = UniformField(flux_mT=50.0)
SOLUTION = solve(gmc(2), FIELD)
LONGER = replace(gmc(2), sections=gmc(2).sections * 2)
MANY = {
    "length_mm": [10.0, 20.0], "E_MPa": [20.0, 10.0], "side_mm": 1.0,
    "remanence_mT": 20.0, "flux_mT": [10.0, 20.0],
}  # fmt: skip
SHAPES = {
    "length_mm": [[10.0, 20.0]], "E_MPa": [[20.0, 10.0]], "side_mm": [1.0],
    "remanence_mT": [20.0], "flux_mT": [10.0], "angle_deg": [90.0],
}  # fmt: skip
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
    "magnet": lambda v: MagnetField(magnet=v, gap_mm=60.0),
    "section": lambda v: Specimen(
        name="any", side_mm=1.0, remanence_mT=20.0, sections=v
    ),
    "GMC number": lambda v: gmc(v),
    "parameters?": lambda v: sensitivities(gmc(2), FIELD, parameters=[v]),
    "s_mm": lambda v: sensitivities(gmc(2), FIELD, parameters=["side_mm"], s_mm=[v]),
    "specimen ": lambda v: sensitivities(v, FIELD, parameters=["side_mm"]),
    "solution": lambda v: verify(gmc(2), FIELD, v),
    "degree": lambda v: verify(gmc(2), FIELD, SOLUTION, degree=v),
    "specimen  ": lambda v: verify(v, FIELD, SOLUTION),
    "study": lambda v: sweep(v, gmc(2), FIELD),
    "field|flux_mT": lambda v: sweep("field", gmc(2), FIELD, values=[v]),
    "stiffness|E_MPa": lambda v: sweep("stiffness", gmc(2), FIELD, values=[v]),
    "length|length_mm": lambda v: sweep("length", gmc(2), FIELD, values=[v]),
    "side|side_mm": lambda v: sweep("side", gmc(2), FIELD, values=[v]),
    "designs": lambda v: solve_many(v),
    "designs: (every )?E_MPa": lambda v: solve_many(MANY | {"E_MPa": v}),
    "designs: (every )?flux_mT": lambda v: solve_many(MANY | {"flux_mT": [10.0, v]}),
    "designs ": lambda v: solve_shapes(v),
    "designs: (every )?side_mm": lambda v: Designs(**(SHAPES | {"side_mm": [v]})),
    "designs: (every )?length_mm": lambda v: Designs(**(SHAPES | {"length_mm": v})),
    "points  ": lambda v: solve_shapes(designs_of(gmc(2), 50.0), points=v),
}


ALLOWED = [("poisson_ratio", None)]
"""No ratio of its own: the specimen's is taken."""

PAIRS = [
    pair for pair in ((q, value) for q in CASES for value in BAD) if pair not in ALLOWED
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


@pytest.mark.parametrize(
    ("columns", "word"),
    [
        ({"E_MPa": [20.0, 10.0, 5.0]}, "2 sections"),
        ({"length_mm": []}, "each section"),
        ({"length_mm": 30.0}, "each section"),
        ({"flux_mT": [1.0, 2.0, 3.0], "side_mm": [1.0, 1.1]}, "3 designs"),
        ({"flux_mT": np.ones((2, 2, 2))}, "flux_mT"),
        ({"colour": [1.0, 2.0]}, "colour"),
        ({"side_mm": -1.0}, "above zero"),
        ({"side_mm": 1e10}, "1e[+]09 mm"),
        ({"E_MPa": ["20", "10"]}, "E_MPa must be an array of numbers in MPa"),
        ({"E_MPa": [[1.0], [1.0, 2.0]]}, "E_MPa must be an array of numbers in MPa"),
        ({"remanence_mT": 4e4}, "30000 mT"),
        (
            {"flux_mT": np.array([1.0, np.nan])},
            "designs: every flux_mT must be a finite number in mT; instead received "
            "nan$",
        ),
    ],
)
def test_columns_that_do_not_fit_are_named(columns, word) -> None:
    with pytest.raises(InputError, match=word):
        solve_many(MANY | columns)


def test_no_designs_have_no_tips() -> None:
    assert len(solve_many(MANY | {"flux_mT": []})) == 0


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda: sensitivities(gmc(2), FIELD, parameters=["E_MPa[3]"]), "3 sections"),
        (lambda: sensitivities(gmc(2), FIELD, parameters=["gap_mm"]), "gap_mm"),
        (lambda: sensitivities(gmc(2), FIELD, parameters="side_mm"), "sequence"),
        (lambda: verify(LONGER, FIELD, SOLUTION), "rod of 60 mm"),
        (lambda: sweep("field", gmc(2), FIELD, values="10"), "sequence in mT"),
        (lambda: sweep("length", gmc(2), FIELD, values=["20-5"]), "3 lengths in mm"),
        (lambda: solve_many(MANY, threads=0), "threads"),
        (lambda: solve_many(MANY, magnet=CUBE), "gap_mm"),
        (lambda: designs_of(gmc(2), [1.0, 2.0]), "flux_mT"),
        (lambda: Designs(**(SHAPES | {"gap_mm": [9.0], "magnet": CUBE})), "either"),
    ],
)
def test_what_has_no_meaning_here_is_named(call, word) -> None:
    with pytest.raises(InputError, match=word):
        call()


def test_batches_refuse_a_magnet_off_the_plane() -> None:
    askew = replace(CUBE, elevation_deg=5.0)
    before = SHAPES | {"flux_mT": None, "gap_mm": [60.0], "magnet": askew}
    with pytest.raises(InputError, match="elevation_deg"):
        Designs(**before)


KINDS = {
    "array": np.array,
    "list": list,
    "integers": lambda v: tuple(int(value) for value in v),
    "numpy numbers": lambda v: tuple(np.float32(value) for value in v),
    "arrays without dimensions": lambda v: [np.array(value) for value in v],
}


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_vectors_of_any_kind_give_the_same_rod(kind: Callable) -> None:
    def shape(as_kind: Callable) -> np.ndarray:
        rod = section(
            remanence_mT=as_kind((1.0, 2.0, 20.0)),
            rest_curvature_per_mm=as_kind((0.0, 0.0, 0.0)),
        )
        magnet = Magnet(
            sides_mm=as_kind((55.0, 50.0, 45.0)), remanence_T=1.0,
            offset_mm=as_kind((1.0, 2.0, 3.0)),
        )  # fmt: skip
        support = Support(gravity_m_s2=as_kind((1.0, 2.0, -9.0)))
        assert all(type(value) is float for value in support.gravity_m_s2)
        field = MagnetField(magnet=magnet, gap_mm=60.0)
        assert len({field, replace(field)}) == 1
        rod = replace(rod, density_kg_m3=2600.0)
        return solve_spatial(rod, field, support=support).r_mm

    assert np.array_equal(shape(kind), shape(tuple))
    flux = solve_spatial(gmc(2), kind((0.0, 30.0, 20.0))).r_mm
    assert np.array_equal(flux, solve_spatial(gmc(2), (0.0, 30.0, 20.0)).r_mm)


@pytest.mark.parametrize("kind", [list, lambda v: np.array(v, dtype=object), iter])
def test_sections_come_in_any_sequence(kind: Callable) -> None:
    rod = replace(gmc(2), sections=kind(gmc(2).sections))
    assert rod == gmc(2)
    assert hash(rod) == hash(gmc(2))
    space = SpatialRod.from_specimen(gmc(2))
    assert hash(replace(space, sections=kind(space.sections))) == hash(space)


@pytest.mark.parametrize("number", [2, np.float64(2), np.int32(2), np.array(2.0)])
def test_single_numbers_of_any_kind_become_floats(number) -> None:
    magnet = Magnet(
        sides_mm=(55, 55, 55), remanence_T=number, axis_angle_deg=number,
        elevation_deg=number,
    )  # fmt: skip
    kept = [
        magnet.remanence_T, magnet.axis_angle_deg, magnet.elevation_deg,
        UniformField(flux_mT=number, angle_deg=number).angle_deg,
        MagnetField(magnet=magnet, gap_mm=number).gap_mm,
        Support(clamp_angle_deg=number, load_factor=number).load_factor,
        Section(length_mm=number, E_MPa=number, side_mm=number).side_mm,
        gmc(2).sections[0].E_MPa,
    ]  # fmt: skip
    assert all(type(value) is float for value in kept)
    flat = solve(gmc(2), UniformField(flux_mT=number), points=np.array(7))
    same = solve(gmc(2), UniformField(flux_mT=2.0), points=7)
    assert np.array_equal(flat.centreline.x_mm, same.centreline.x_mm)


@pytest.mark.parametrize(
    "value",
    ["123", b"abc", [[1.0], [2.0], [3.0]], np.ones((3, 1)), np.ones(2), 5.0, {1, 2, 3},
     np.array(["1", "2", "3"]), np.array([1j, 2, 3]), [1.0, None, 3.0], {}],
)  # fmt: skip
def test_what_is_no_vector_is_refused(value) -> None:
    for quantity, make in (
        ("magnet sides_mm", lambda v: Magnet(sides_mm=v, remanence_T=1.0)),
        ("magnet offset_mm", lambda v: replace(CUBE, offset_mm=v)),
        ("gravity_m_s2", lambda v: Support(gravity_m_s2=v)),
        ("section remanence_mT", lambda v: section(remanence_mT=v)),
    ):
        with pytest.raises(InputError, match=rf"{quantity} must be .* in m") as caught:
            make(value)
        assert "instead received" in str(caught.value)


def test_writing_into_an_array_spoils_no_later_solve() -> None:
    """The arrays that functions keep are never those that a caller holds."""
    before = solve(gmc(2), FIELD).centreline.points_mm.copy()
    for spoil in (
        lambda: field_array(FIELD, 30.0), lambda: rod_array(gmc(2), Support()),
        lambda: stations(61),
    ):  # fmt: skip
        spoil()[...] = 0.7
    line = solve(gmc(2), FIELD).centreline
    assert np.array_equal(line.points_mm, before)
    space = solve_spatial(gmc(2), FIELD)
    kept = space.r_mm.copy()
    for array in (space.r_mm, space.s_mm, space.directors, line.s_mm, line.x_mm):
        if array.flags.writeable:
            array[...] = 0.7
    assert np.array_equal(solve_spatial(gmc(2), FIELD).r_mm, kept)
    assert np.array_equal(solve(gmc(2), FIELD).centreline.points_mm, before)
