"""Walls, distances, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from magbend.core.errors import ConfigError, InputError
from magbend.core.magnet import Magnet
from magbend.sim import Field, MagnetField, UniformField, gmc
from magbend.sim.fields import cuboid_of
from magbend.sim.navigate import (
    Lumen,
    Wall,
    channel,
    circle,
    lumen_of,
    moving,
    navigate,
    polyline,
    read_lumen,
    spline,
)
from magbend.sim.navigate.curves import outline
from magbend.sim.navigate.walls import clearances

LUMENS = Path(__file__).parents[3] / "fixtures" / "lumens"
NOTHING = UniformField(flux_mT=0.0)


def room(lumen: Lumen, points) -> np.ndarray:
    return clearances(lumen.packed(1.0, 1e9), np.array(points, dtype=float))


def test_distances_from_a_bent_channel_are_those_from_its_middle_line():
    bend = channel("bend", width_mm=3.0, legs=[(5.0, 0.0), (math.pi * 5.0, 90.0)])
    angles = np.linspace(0.1, 1.4, 7)
    rho = np.array([8.6, 9.0, 10.0, 10.7, 11.3, 11.5, 12.0])
    points = np.column_stack([5.0 + rho * np.sin(angles), 10.0 - rho * np.cos(angles)])
    assert room(bend, points) == pytest.approx(1.5 - abs(rho - 10.0), abs=1e-12)


def test_at_a_convex_corner_the_corner_is_nearest_and_in_a_concave_one_both_walls():
    corner = polyline([(0.0, 0.0), (10.0, 0.0), (10.0, -10.0)])
    outer = Lumen(name="outer", walls=(Wall("w", corner),), inside_mm=(5.0, 1.0))
    assert room(outer, [(13.0, 4.0)]) == pytest.approx([5.0])
    assert outer.pieces == ("w",)
    inner = Lumen(name="inner", walls=(Wall("w", corner),), inside_mm=(5.0, -1.0))
    assert inner.pieces == ("w", "w")
    assert room(inner, [(9.0, -3.0), (8.0, -0.5)]) == pytest.approx([1.0, 0.5])
    assert room(inner, [(5.0, 0.3)])[0] == pytest.approx(-0.3)


def test_a_circle_is_a_wall_from_either_side():
    ring = (Wall("ring", circle((0.0, 0.0), 4.0)),)
    assert room(Lumen(name="a", walls=ring, inside_mm=(0.0, 0.0)), [(3.0, 0.0)]) == (
        pytest.approx([1.0])
    )
    assert room(Lumen(name="b", walls=ring, inside_mm=(9.0, 0.0)), [(6.0, 0.0)]) == (
        pytest.approx([2.0])
    )


def test_a_spline_is_followed_to_a_ten_thousandth_of_a_millimetre():
    points = [(0.0, 0.0), (10.0, 3.0), (18.0, -2.0), (30.0, 4.0)]
    knots = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    curve = CubicSpline(knots, points, bc_type="natural")
    wall = Lumen(
        name="s", walls=(Wall("s", spline(points)),), inside_mm=(0.0, 5.0)
    )  # fmt: skip
    on_it = curve(np.linspace(0.1, knots[-1] - 0.1, 311))
    assert abs(room(wall, on_it)).max() < 2e-4


def test_a_wall_is_drawn_where_it_is():
    arcs = channel("bend", width_mm=3.0, legs=[(20.0, 120.0)]).walls[0].arcs
    radius = 20.0 / math.radians(120.0)
    off = np.hypot(*(outline(arcs) - (0.0, radius)).T) - (radius - 1.5)
    assert abs(off).max() < 1e-12


def walls(*lines):
    return tuple(Wall(f"w{k}", polyline(line)) for k, line in enumerate(lines))


TOP, BOTTOM = [(0.0, 2.0), (30.0, 2.0)], [(0.0, -2.0), (30.0, -2.0)]


def test_walls_that_cross_are_named():
    with pytest.raises(InputError, match=r"'w0' and 'w1' cross near \(15, 0\) mm"):
        Lumen(
            name="x",
            walls=walls([(0.0, 2.0), (30.0, -2.0)], [(0.0, -2.0), (30.0, 2.0)]),
            inside_mm=(1.0, 0.0),
        )


def test_a_wall_that_crosses_itself_is_named():
    loop = [(0.0, 2.0), (20.0, 2.0), (20.0, 9.0), (10.0, 9.0), (10.0, -5.0)]
    with pytest.raises(InputError, match="'w0' and itself cross"):
        Lumen(name="loop", walls=walls(loop), inside_mm=(1.0, 0.0))


def test_a_lumen_narrower_than_the_rod_is_named_with_the_place():
    lumen = Lumen(
        name="waist",
        walls=walls([(0.0, 2.0), (12.0, 0.4), (30.0, 2.0)], BOTTOM[::-1]),
        inside_mm=(1.0, 0.0),
    )
    navigate(gmc(2), lumen, NOTHING, way_mm=2.0)
    narrow = Lumen(
        name="waist",
        walls=walls([(0.0, 2.0), (12.0, -1.4), (30.0, 2.0)], BOTTOM),
        inside_mm=(1.0, 0.0),
    )
    with pytest.raises(
        InputError, match=r"0\.6 mm between 'w0' and 'w1' at \(12, -2\)"
    ):
        navigate(gmc(2), narrow, NOTHING)


@pytest.mark.parametrize(
    ("entry", "said"),
    [((0.0, 5.0), "outside the lumen"), ((1.0, 1.8), "too near to a wall")],
)
def test_a_clamp_that_is_not_inside_is_named(entry, said):
    lumen = Lumen(
        name="tube", walls=walls(TOP, BOTTOM), inside_mm=(1.0, 0.0), entry_mm=entry
    )
    with pytest.raises(InputError, match=said):
        navigate(gmc(2), lumen, NOTHING)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"friction": math.nan}, "friction must be a finite number"),
        ({"friction": -0.1}, "friction must be from 0 to 2"),
        ({"step_mm": 0.0}, "step_mm must be above zero in mm"),
        ({"way_mm": 31.0}, "way_mm must be from 0.03 to 30 mm"),
        ({"way_mm": (10.0, math.inf)}, "way_mm must be a finite number"),
        ({"elements": 1}, "elements must be from 2 to 400"),
        ({"push_limit_N": -1.0}, "push_limit_N must be above zero"),
    ],
)
def test_numbers_that_cannot_be_are_refused_in_a_sentence(given, said):
    lumen = channel("tube", width_mm=3.0, legs=[(40.0, 0.0)])
    with pytest.raises(InputError, match=said):
        navigate(gmc(2), lumen, NOTHING, **given)


def test_the_examples_are_read():
    fork = read_lumen(LUMENS / "fork.toml")
    assert [gate.name for gate in fork.gates] == ["left branch", "right branch"]
    assert {wall.name for wall in fork.walls} == {"upper", "lower", "carina"}
    assert read_lumen(LUMENS / "bend90.toml").gates[0].name == "end"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('name = "a"\n', r"a \[channel\], a \[tube\] or at least one \[\[wall"),
        ('name = "a"\n[channel]\nwidth = 3.0\n', "line 3: unknown key 'channel.width'"),
        (
            'name = "a"\n[channel]\nwidth_mm = 3.0\n[[channel.leg]]\nturn_deg = 9.0\n',
            "each leg must have straight_mm, or radius_mm and a turn_deg",
        ),
        (
            'name = "a"\n[channel]\nwidth_mm = 9.0\n[[channel.leg]]\n'
            "radius_mm = 4.0\nturn_deg = 9.0\n",
            "must bend with a radius above half its width, 4.5 mm",
        ),
        (
            'name = "a"\n[[wall]]\nname = "w"\npoints_mm = [[0.0, 0.0]]\n',
            "points_mm must hold at least 2 points",
        ),
        (
            'name = "a"\n[[wall]]\nname = "w"\npoints_mm = [[0.0, nan], [1.0, 0.0]]\n',
            "must be a finite number|finite",
        ),
        (
            'name = "a"\n[[wall]]\nname = "w"\nkind = "circle"\nradius_mm = 2.0\n',
            "a circle must have centre_mm and radius_mm",
        ),
        (
            'name = "a"\n[[wall]]\nname = "w"\n'
            "points_mm = [[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]]\n",
            "must not repeat a point",
        ),
    ],
)
def test_files_that_cannot_be_are_refused_in_a_sentence(tmp_path, text, said):
    path = tmp_path / "lumen.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=said) as caught:
        read_lumen(path)
    assert str(path) in str(caught.value)


def test_poses_are_joined_by_straight_lines():
    field = moving(
        None,
        [
            {"insertion_mm": 0.0, "flux_mT": 10.0, "angle_deg": 0.0},
            {"insertion_mm": 10.0, "flux_mT": 30.0, "angle_deg": 90.0},
        ],
    )
    assert field(5.0) == UniformField(flux_mT=20.0, angle_deg=45.0)
    assert field(99.0) == UniformField(flux_mT=30.0, angle_deg=90.0)
    with pytest.raises(InputError, match="must rise"):
        moving(None, [{"insertion_mm": 1.0, "flux_mT": 1.0}] * 2)
    with pytest.raises(InputError, match="each pose must have insertion_mm"):
        moving(None, [{"insertion_mm": 1.0, "gap_mm": 50.0}])


def test_an_entry_beside_the_lumen_of_a_file_is_named(tmp_path):
    path = tmp_path / "lumen.toml"
    path.write_text(
        'name = "tube"\n[entry]\ny_mm = 9.0\n'
        '[[wall]]\nname = "top"\npoints_mm = [[-5.0, 2.0], [40.0, 2.0]]\n'
        '[[wall]]\nname = "low"\npoints_mm = [[-5.0, -2.0], [40.0, -2.0]]\n'
    )
    with pytest.raises(InputError, match=r"\(0, 9\) mm is outside the lumen"):
        navigate(gmc(2), read_lumen(path), NOTHING)


def test_a_spline_that_turns_straight_back_is_named():
    with pytest.raises(InputError, match="must not turn straight back"):
        spline([(0.0, 2.0), (10.0, 2.0), (0.0, 2.0)])


def test_steps_without_end_are_refused():
    lumen = channel("tube", width_mm=3.0, legs=[(40.0, 0.0)])
    with pytest.raises(InputError, match=r"step_mm must be from 0\.0015"):
        navigate(gmc(2), lumen, NOTHING, step_mm=1e-6)


def test_walls_of_too_many_pieces_are_refused_before_they_are_drawn():
    with pytest.raises(InputError, match="not have more than 4000 pieces"):
        channel("long", width_mm=2.5, legs=[(1e9, 0.0)])
    points = [(0.001 * k, 2.0) for k in range(60_000)]
    with pytest.raises(InputError, match="not have more than 4000 pieces"):
        Lumen(
            name="fine", walls=(Wall("upper", polyline(points)),), inside_mm=(1.0, 0.0)
        )


def test_poses_move_a_magnet_whatever_gap_it_had():
    cube = Magnet.cube(55.0, 1.305)
    turned = Magnet.cube(55.0, 1.305, axis_angle_deg=70.0)
    pose = {"insertion_mm": 0.0, "gap_mm": 45.0, "axis_angle_deg": 70.0}
    for start in (MagnetField(magnet=cube, gap_mm=100.0), Field(cuboid_of(cube))):
        there = moving(start, [pose])(3.0)
        assert there == Field(MagnetField(magnet=turned, gap_mm=45.0).sources)


@pytest.mark.parametrize("text", ["name = 3", "name = [", 'name = "a"\n'])
def test_the_text_of_a_lumen_in_a_plan_is_refused_in_a_sentence(text):
    with pytest.raises(ConfigError, match="the lumen of the plan cannot be used"):
        lumen_of(text)
