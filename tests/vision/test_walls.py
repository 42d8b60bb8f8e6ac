"""The side walls of a rod seen obliquely: where they end, and what light they give."""

from __future__ import annotations

import math

import numpy as np
import pytest

from magbend.core.centreline import Centreline
from magbend.vision import as_photo, extract, synthetic
from magbend.vision.curve.curve import Curve
from magbend.vision.edge import edges, wall_light
from magbend.vision.edge.state import Seen, State
from magbend.vision.edge.wall_light import short_of_end
from magbend.vision.measurement import Pose
from magbend.vision.synthetic import drawing

S = np.linspace(0.0, 30.0, 301)
ZERO = np.zeros_like(S)
STRAIGHT = Centreline(
    s_mm=S, x_mm=S, y_mm=ZERO, theta_rad=ZERO, kappa_per_mm=ZERO
)  # fmt: skip


def phi(z):
    return 0.5 * (1.0 + math.erf(z / math.sqrt(2.0)))


@pytest.mark.parametrize("wall", [0.3, 1.0, 2.2, 4.0])
@pytest.mark.parametrize("light", [0.17, 0.5, -0.2])
def test_half_level_of_two_steps(wall, light):
    gap, window, blur = 1.0, 4.0, 0.9
    (x,) = short_of_end(np.array([wall]), np.array([light]), blur, gap, window)
    level = (1.0 - light) * phi(-x / blur) + light * phi((wall - x) / blur)
    inside = gap + window * (np.arange(400) + 0.5) / 400
    part = np.mean([phi((wall - t) / blur) - phi(-t / blur) for t in inside])
    assert level == pytest.approx(0.5 * (1.0 + light * part), abs=1e-5)
    assert 0.0 <= x / light <= wall * 1.7


def test_no_wall_and_a_wall_wider_than_where_the_rods_level_is_taken():
    walls = np.array([0.0, 40.0])
    short = short_of_end(walls, np.full(2, 0.17), 0.9, 2.0, 4.0)
    assert short == pytest.approx(0.0, abs=2e-3)


def test_reflectance_is_fresnels():
    n = wall_light.REFRACTION
    steep = np.tan(np.radians([1e-4, 90.0 - 1e-4]))
    grazing, upright = wall_light.reflectance(steep)
    assert grazing == pytest.approx(1.0, abs=1e-4)
    assert upright == pytest.approx(((n - 1.0) / (n + 1.0)) ** 2, rel=1e-6)
    # At Brewster's angle only the light across the plane of incidence is left.
    (brewster,) = wall_light.reflectance(np.array([1.0 / n]))
    assert brewster == pytest.approx(0.5 * ((n**2 - 1.0) / (n**2 + 1.0)) ** 2, rel=1e-6)


def share(paper, slope=0.0, mirrors=0.35, wall=2.0):
    one = np.ones(1)
    return float(
        wall_light.wall_light(
            wall * one,
            3.0 * one,
            20.0,
            0.05 * one,
            paper * one,
            slope * one,
            mirrors * one,
            0.5,
        )[0]
    )


def test_a_wall_mirrors_the_paper_it_faces():
    lit, shaded = share(0.6), share(0.15)
    assert lit > shaded
    assert shaded < 0.1
    assert share(0.15, slope=0.02) > shaded  # the shade ends near by
    assert share(0.6, wall=1.0) > lit  # seen at a more grazing angle
    assert share(0.6, mirrors=0.2) < lit
    assert share(float("nan")) == 0.0


def measured(toward_deg, seed=0):
    """Return the error of the midline, px, and the width, mm, of a straight rod."""
    camera = synthetic.scene_camera(tilt_deg=6.0, tilt_direction_deg=toward_deg)
    pose = Pose(x_mm=16.0, y_mm=-25.0, angle_deg=0.0, height_mm=0.9)
    clamp = synthetic.Block(pose=pose)
    light = synthetic.SceneLight(shadow_depth=0.0, noise=5e-4)
    bench = synthetic.Scene(clamp=clamp, centreline=STRAIGHT, light=light, dust=0)
    picture = synthetic.render_scene(bench, camera, np.random.default_rng(seed))
    found = extract(as_photo(picture), camera, rod_height_mm=0.9)
    true = camera.to_px(clamp.pose.to_board(STRAIGHT.points_mm), height_mm=0.9)
    x, y = found.points["x_px"], found.points["y_px"]
    error = (y - np.interp(x, true[:, 0], true[:, 1]))[found.points["s_mm"] > 4.0]
    return float(np.median(error)), found.width_mm


@pytest.mark.parametrize("toward_deg", [90.0, -90.0])
def test_the_middle_is_the_axis_from_either_side(toward_deg):
    error, width = measured(toward_deg)
    assert abs(error) < 0.04
    assert width == pytest.approx(1.0, abs=0.004)


@pytest.mark.parametrize("toward_deg", [90.0, -90.0])
def test_scenes_draw_walls_as_dark_as_the_top_where_they_are(monkeypatch, toward_deg):
    monkeypatch.setattr(drawing, "SHEEN", 0.0)
    monkeypatch.setattr(drawing, "WALL_SKY", 1.0)
    monkeypatch.setattr(wall_light, "MIRRORED", 0.0)
    monkeypatch.setattr(wall_light, "SKY", 1.0)
    error, width = measured(toward_deg)
    assert abs(error) < 0.02
    assert width == pytest.approx(1.0, abs=0.003)


def test_edges_are_of_use_where_no_wall_is_seen_on_a_bent_rod():
    width = np.concatenate([np.linspace(27.0, 29.0, 60), np.full(240, 29.0)])
    level = np.full(300, 1.0)
    found = edges.Edges(
        low=-0.5 * width, high=0.5 * width, slope_low=level, slope_high=level,
        inner=0.0 * level, outer_low=level, outer_high=level, shade_low=0.0 * level,
        shade_high=0.0 * level, growth=0.0 * level,
    )  # fmt: skip
    assert not found.usable().all()
    assert found.usable(width - 27.0).all()


@pytest.mark.parametrize("is_round", [True, False])
def test_edges_of_one_width_are_used_by_whichever_section(is_round):
    """Of a bent round rod no wall comes in sight, though one would of a square rod."""
    s = np.linspace(0.0, 200.0, 201)
    points, angle = np.column_stack([s, np.zeros(201)]), np.zeros(201)
    state = State(Curve(s, points, angle, angle), np.full(201, 10.0), 20.0, 0.0, 200.0,
                  0.0, False)  # fmt: skip
    wall, one = np.maximum(3.0 - 0.05 * s, 0.0), np.ones(201)
    wide = 20.0 * one if is_round else 20.0 + wall
    sides = edges.Edges(
        low=-10.0 * one, high=wide - 10.0, slope_low=0.3 * one, slope_high=0.3 * one,
        inner=0.1 * one, outer_low=0.8 * one, outer_high=0.8 * one, shade_low=0.0 * s,
        shade_high=0.0 * s, growth=0.0 * s,
    )  # fmt: skip
    seen = wall_light.to_wall_ends(
        state, Seen(s, angle, sides, one > 0.0),
        lambda at, *_: (np.interp(at[:, 0], s, wall), np.zeros(len(at))),
    )  # fmt: skip
    assert seen.good.all()
