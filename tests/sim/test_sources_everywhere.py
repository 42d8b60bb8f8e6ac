"""Every kind of source in every solver: halves add up, scenes turn, maps agree."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from magbend.core.errors import InputError
from magbend.sim import (
    Coil,
    Cuboid,
    Cylinder,
    Designs,
    Dipole,
    Field,
    FieldMap,
    Gradient,
    Support,
    Uniform,
    find_equilibria,
    flux_mT,
    follow_path,
    gmc,
    sensitivities,
    solve,
    solve_many,
    solve_shapes,
    solve_spatial,
    verify,
)
from magbend.sim.batch import OUTCOMES, STATUS

ROD = gmc(2)
G = np.array([[0.4, 0.9, 0.0], [0.9, -0.6, 0.0], [0.0, 0.0, 0.2]])
X, Y = np.meshgrid(np.arange(-2.0, 34.0, 4.0), np.arange(-14.0, 15.0, 4.0))
GRID = np.column_stack([X.ravel(), Y.ravel(), 0.0 * X.ravel()])


def map_of(field: Field, share: float = 1.0) -> Field:
    """Return readings of a planar field as a map, times a share."""
    readings = share * flux_mT(field, GRID, length_mm=ROD.length_mm)
    readings[:, 2] = 0.0
    return Field(FieldMap(points_mm=GRID, flux_mT=readings))


def stacked(build: Callable[..., object], key: str, size_mm: float) -> Field:
    """Return two halves of a body, one behind the other along its axis."""
    half = size_mm / 2.0
    value = (40.0, 40.0, half) if key == "sides_mm" else half
    return Field(build(**{key: value}, gap_mm=g) for g in (40.0, 40.0 + half))


CUBE = Cuboid(sides_mm=40.0, remanence_T=1.2, gap_mm=40.0)
ROUND = partial(Cylinder, diameter_mm=40.0, remanence_T=1.2)
LAYER = partial(Coil, diameter_mm=60.0, current_A=40.0)
PUSH = Uniform(flux_mT=5.0)
AT = {"centre_mm": (25.0, -50.0, 0.0), "axis_angle_deg": 110.0}
HALVES = {
    "cuboid": (
        Field(CUBE), stacked(partial(Cuboid, remanence_T=1.2), "sides_mm", 40.0)
    ),
    "cylinder": (
        Field(ROUND(length_mm=30.0, gap_mm=40.0)), stacked(ROUND, "length_mm", 30.0)
    ),
    "coil": (
        Field(LAYER(length_mm=30.0, turns=600, gap_mm=40.0)),
        stacked(partial(LAYER, turns=300), "length_mm", 30.0),
    ),
    "sphere": (
        Field(Dipole(remanence_T=1.2, diameter_mm=40.0, **AT)),
        Field([Dipole(moment_A_m2=16.0, **AT)] * 2),  # 1.2 T / mu0 pi / 6 (40 mm)^3 / 2
    ),
    "uniform": (
        Field(Uniform(flux_mT=40.0, angle_deg=70.0)),
        Field([Uniform(flux_mT=20.0, angle_deg=70.0)] * 2),
    ),
    "gradient": (
        Field(Gradient(gradient_mT_per_mm=G), PUSH),
        Field(*[Gradient(gradient_mT_per_mm=G / 2.0)] * 2, PUSH),
    ),
    "map": (map_of(Field(CUBE)), Field(*[map_of(Field(CUBE), 0.5).sources[0]] * 2)),
}  # fmt: skip


def many_tip(field: Field) -> tuple[float, float]:
    (row,) = solve_many(
        {"length_mm": [10.0, 10.0, 10.0], "E_MPa": [20.0, 15.0, 10.0], "side_mm": 1.0,
         "remanence_mT": 20.07}, magnet=field,
    )  # fmt: skip
    assert OUTCOMES[row["outcome"]] == "stable"
    return row["tip_x_mm"], row["tip_y_mm"]


def shapes_tip(field: Field) -> np.ndarray:
    designs = Designs(
        length_mm=[[10.0, 10.0, 10.0]], E_MPa=[[20.0, 15.0, 10.0]], side_mm=[1.0],
        remanence_mT=[20.07], angle_deg=[90.0], magnet=field,
    )  # fmt: skip
    return solve_shapes(designs).points[0, -1, 1:3]


def path_tip(field: Field) -> tuple[float, float]:
    path = follow_path(ROD, field, load_factor=(0.4, 1.0), steps=2)
    return path.points[-1].centreline.tip_mm


SAME_TIP = {
    "batch": many_tip,
    "shapes": shapes_tip,
    "space": lambda field: solve_spatial(ROD, field).r_mm[-1, :2],
    "path": path_tip,
    "derivatives": lambda field: (
        sensitivities(ROD, field, parameters=["E_MPa[1]"]).solution.centreline.tip_mm
    ),
}
OWN = {
    "solid": lambda field: solve(ROD, field, model="solid").centreline.tip_mm,
    "slope": lambda field: sensitivities(ROD, field, parameters=["E_MPa[0]"]).dy_mm,
}


@pytest.mark.parametrize("name", HALVES)
def test_halves_bend_as_the_whole_in_every_solver(name: str) -> None:
    whole, halves = HALVES[name]
    tip = solve(ROD, whole).centreline.tip_mm
    assert abs(tip[1]) > 1.0
    same = 1e-3 if name == "map" else 1e-9  # two maps are two fits
    assert math.dist(tip, solve(ROD, halves).centreline.tip_mm) < same
    for field in (whole, halves):
        assert verify(ROD, field, solve(ROD, field)) < 1e-7
        for solver in SAME_TIP.values():
            assert math.dist(solver(field), tip) < max(same, 1e-5)
    for solver in OWN.values():
        one, two = np.array(solver(whole)), np.array(solver(halves))
        np.testing.assert_allclose(two, one, atol=same * np.abs(one).max())


@pytest.mark.parametrize("name", ["cuboid", "cylinder", "coil", "sphere", "gradient"])
def test_a_map_bends_as_what_it_was_read_of(name: str) -> None:
    field = HALVES[name][0]
    mapped = map_of(field)
    off_mT = mapped.sources[0].between_mT
    true = np.array(solve(ROD, field).centreline.tip_mm)
    rise = abs(true[1]) / np.linalg.norm(flux_mT(field, [25.0, 0, 0], length_mm=30.0))
    for solver in SAME_TIP.values():
        assert math.dist(solver(mapped), true) < 5.0 * rise * off_mT + 1e-5


@pytest.mark.parametrize("name", ["cuboid", "cylinder", "coil", "sphere", "gradient"])
def test_a_turned_scene_gives_a_turned_rod(name: str) -> None:
    turn = 35.0
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    Q = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def turned(source: object) -> object:
        if isinstance(source, Gradient):
            return Gradient(gradient_mT_per_mm=Q @ source.gradient_mT_per_mm @ Q.T)
        if isinstance(source, Uniform):
            return replace(source, angle_deg=source.angle_deg + turn)
        axis = np.array(source.axes()[2])
        centre = source.centre_mm
        if centre is None:
            centre = np.array([30.0, 0, 0]) - (source.half_mm + source.gap_mm) * axis
        return replace(
            source, gap_mm=None, centre_mm=tuple(Q @ centre),
            axis_angle_deg=source.axis_angle_deg + turn,
        )  # fmt: skip

    field = HALVES[name][0]
    around = Field(turned(source) for source in field.sources)
    held = Support(clamp_angle_deg=turn)
    tip = Q[:2, :2] @ solve(ROD, field).centreline.tip_mm
    for found in (
        solve(ROD, around, support=held).centreline.tip_mm,
        solve_spatial(ROD, around, support=held).r_mm[-1, :2],
        sensitivities(
            ROD, around, support=held, parameters=["clamp_angle_deg"]
        ).solution.centreline.tip_mm,
    ):
        assert math.dist(found, tip) < 1e-5


def test_all_equilibria_of_halves_are_those_of_the_whole() -> None:
    tips = [
        [one.tip_mm for one in find_equilibria(ROD, field)]
        for field in HALVES["cylinder"]
    ]
    np.testing.assert_allclose(tips[1], tips[0], atol=1e-7)


FAR = {"length_mm": [[10.0] * 3, [40.0] * 3], "E_MPa": [20.0, 15.0, 10.0],
       "side_mm": 1.0, "remanence_mT": 20.07}  # fmt: skip


def test_batches_tell_of_each_design_whether_it_leaves_a_map() -> None:
    field = map_of(Field(CUBE))
    with pytest.raises(InputError, match="leaves the box of the map"):
        solve(replace(ROD, sections=[replace(one, length_mm=40.0)
                                     for one in ROD.sections]), field)  # fmt: skip
    found = solve_many(FAR, magnet=field)
    assert [OUTCOMES[k] for k in found["outcome"]] == ["stable", "leaves the map"]
    assert np.isnan(found["tip_x_mm"][1])
    designs = Designs(
        length_mm=FAR["length_mm"], E_MPa=[FAR["E_MPa"]] * 2, side_mm=[1.0] * 2,
        remanence_mT=[20.07] * 2, angle_deg=[90.0] * 2, magnet=field,
    )  # fmt: skip
    shapes = solve_shapes(designs)
    assert [STATUS[k] for k in shapes.status] == ["stable", "leaves the map"]
    assert np.all(np.isnan(shapes.points[1]))
    with pytest.raises(InputError, match="leaves the box of the map"):
        follow_path(ROD, field, insertion_mm=(10.0, 40.0), steps=3)


THROUGH = Coil(diameter_mm=20.0, current_A=1.0, wire_mm=2.0, centre_mm=(10.0, 0, 0))
IN_EACH_OTHER = Field(
    Cuboid(sides_mm=40.0, remanence_T=1.2),
    Cylinder(diameter_mm=9.0, length_mm=9.0, remanence_T=1.2, centre_mm=(30, -80, 0)),
)
WOUND_THROUGH = Field(CUBE, Coil(diameter_mm=30.0, current_A=1.0, gap_mm=60.0))


@pytest.mark.parametrize(
    "solver",
    [
        lambda field: solve(ROD, field),
        lambda field: solve_spatial(ROD, field),
        lambda field: solve(ROD, field, model="solid"),
        lambda field: sensitivities(ROD, field, parameters=["side_mm"]),
        lambda field: find_equilibria(ROD, field),
        path_tip,
        many_tip,
        shapes_tip,
    ],
)
def test_bodies_in_each_other_are_refused_in_every_solver(
    solver: Callable[[Field], object],
) -> None:
    for field in (IN_EACH_OTHER.at_gap(45.0), WOUND_THROUGH):
        with pytest.raises(InputError, match=r"must not overlap.*\) mm") as error:
            solver(field)
        assert "\n" not in str(error.value)


def test_a_batch_refuses_the_gap_at_which_bodies_meet() -> None:
    columns = {**FAR, "length_mm": [10.0] * 3, "gap_mm": np.linspace(90.0, 60.0, 31)}
    with pytest.raises(InputError, match="must not overlap"):
        solve_many(columns, magnet=IN_EACH_OTHER)
    columns["gap_mm"] = columns["gap_mm"][:2]
    with pytest.raises(InputError, match="must not overlap"):
        solve_many(columns | {"gap_mm": [200.0, 60.0]}, magnet=IN_EACH_OTHER)


def test_a_rod_through_a_winding_is_refused_or_told() -> None:
    for solver in (lambda f: solve(ROD, f), lambda f: solve_spatial(ROD, f), path_tip):
        with pytest.raises(InputError, match="clear of"):
            solver(Field(THROUGH))
    columns = {**FAR, "length_mm": [10.0] * 3}
    (row,) = solve_many(columns, magnet=Field(THROUGH))
    assert OUTCOMES[row["outcome"]] == "touches the magnet"
