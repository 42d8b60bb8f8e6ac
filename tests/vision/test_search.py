"""The rod among other things, in any light: found, or refused for the true reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from magbend.vision import (
    Pose,
    Setting,
    as_photo,
    draw_overlay,
    extract,
    measure,
    specimen_to_px,
)
from magbend.vision.edge.state import LostError
from magbend.vision.find import choose
from magbend.vision.find.candidate import Candidate
from magbend.vision.find.choose import LEAST_LENGTH, likely_rods
from magbend.vision.find.rivals import are_halves, is_shade, standing_out
from magbend.vision.find.sought import Sought
from magbend.vision.find.things import Thing, without_strokes
from magbend.vision.synthetic import (
    BLACK,
    GREY,
    Block,
    Mark,
    Rod,
    Scene,
    SceneLight,
    curve,
    render_scene,
    scene_camera,
    signed_distance,
)

CAMERA = scene_camera(size_px=(800, 600), focal_px=3400.0, target_mm=(0.0, 0.0))
HEIGHT = 0.9
CLAMP = Block(
    pose=Pose(x_mm=-12.0, y_mm=-6.0, angle_deg=6.0, height_mm=HEIGHT),
    width_mm=8.0, colour=GREY,
)  # fmt: skip
LINE = curve("graded", angle_deg=50.0, length_mm=26.0)
PLAIN = Scene(clamp=CLAMP, centreline=LINE, dust=0)
GREEN_BOARD, RED = (0.16, 0.30, 0.10), (0.04, 0.04, 0.35)
GREEN, YELLOW = (0.06, 0.25, 0.05), (0.05, 0.45, 0.55)


def picture(scene, camera=CAMERA):
    return render_scene(scene, camera, np.random.default_rng(5))


def measured(scene, **known):
    return extract(
        as_photo(picture(scene)), CAMERA, rod_height_mm=HEIGHT, clamp_height_mm=4.0,
        **known,
    )  # fmt: skip


def off(found, line=LINE):
    """RMS distance from the true axis, mm."""
    points = np.column_stack([found.points["x_mm"], found.points["y_mm"]])
    return np.sqrt(np.mean(signed_distance(points, line.points_mm) ** 2))


def bar(x, y, width, height):
    corners = [[x, y], [x + width, y], [x + width, y + height], [x, y + height]]
    return np.array(corners, dtype=float)


def lying(angle_deg, x_mm, y_mm, length_mm=18.0):
    pose = Pose(x_mm=x_mm, y_mm=y_mm, angle_deg=angle_deg, height_mm=0.6)
    return Rod(line=curve("arc", angle_deg=20.0, length_mm=length_mm), pose=pose)


CLUTTER = {
    "a second rod": {"others": (lying(80.0, -14.0, 0.0, 10.0),)},
    "a pencil line": {
        "marks": (Mark(outline_mm=bar(-30.0, 11.5, 60.0, 0.4), colour=(0.3,) * 3),)
    },
    "a strip of shade": {
        "marks": (
            Mark(outline_mm=bar(-30.0, -12.0, 60.0, 3.0), cover=0.5, softness_mm=0.5),
        )
    },
    "grid paper": {
        "marks": tuple(
            Mark(outline_mm=bar(x, -20.0, 0.15, 40.0), colour=(0.8, 0.7, 0.5))
            for x in range(-20, 21, 5)
        )
    },
    "a magnet": {
        "blocks": (
            Block(
                pose=Pose(x_mm=14.0, y_mm=-10.0, angle_deg=90.0), length_mm=4.0,
                width_mm=5.0, height_mm=5.0, screws_mm=(),
            ),
        )
    },
    "gloss": {"light": SceneLight(gloss=0.5)},
    "deep shade": {"light": SceneLight(shadow_depth=0.65, softness=0.1, slope=1.2)},
    "a red rod on a green board": {"paper": GREEN_BOARD, "rod_colour": RED},
    "a striped rod": {"rod_colour": GREEN, "rod_stripe": YELLOW},
}  # fmt: skip


@pytest.mark.parametrize("what", CLUTTER)
def test_the_rod_is_measured_beside(what):
    found = measured(replace(PLAIN, **CLUTTER[what]))
    assert found.ok, found.reason
    assert off(found) < 0.08
    assert found.length_mm == pytest.approx(LINE.length_mm, abs=0.08)


def test_rods_in_two_clamps_are_refused_and_both_are_drawn():
    other = Block(
        pose=Pose(x_mm=-12.0, y_mm=8.0, angle_deg=0.0), width_mm=5.0, colour=BLACK
    )
    beside = lying(0.0, -12.0, 8.0)
    scene = replace(PLAIN, blocks=(other,), others=(beside,))
    photo = as_photo(picture(scene))
    found = extract(photo, CAMERA, rod_height_mm=HEIGHT)
    assert not found.ok
    assert "two_rods" in found.flags
    assert len(found.seen_px) >= 2
    truths = (
        specimen_to_px(CAMERA, CLAMP.pose, LINE.points_mm),
        specimen_to_px(CAMERA, beside.pose, beside.line.points_mm),
    )
    for truth in truths:
        near = [abs(signed_distance(seen, truth)).max() for seen in found.seen_px]
        assert min(near) < 20.0
    drawn = draw_overlay(photo, found).astype(int)
    orange = (drawn[..., 2] - drawn[..., 0]) > 120
    assert orange.sum() > 300


def test_a_cable_through_the_picture_is_no_rod():
    x = np.linspace(-30.0, 30.0, 40)
    y = 9.0 + np.sin(x / 9.0)
    cable = np.vstack([np.column_stack([x, y]), np.column_stack([x, y + 1.0])[::-1]])
    found = measured(
        replace(PLAIN, marks=(Mark(outline_mm=cable, colour=(0.05,) * 3),))
    )
    assert found.ok, found.reason
    assert off(found) < 0.05


def test_a_short_rod_is_found_where_a_cable_leads_through_the_picture():
    """It is 7 % of the picture's diagonal, and 10 widths."""
    short = curve("graded", angle_deg=20.0, length_mm=7.0)
    cable = Mark(outline_mm=bar(-30.0, 11.5, 60.0, 1.0), colour=(0.05,) * 3)
    found = measured(replace(PLAIN, centreline=short, side_mm=0.7, marks=(cable,)))
    assert found.ok, found.reason
    assert found.length_px < LEAST_LENGTH * np.hypot(*CAMERA.image_size_px)
    assert off(found, short) < 0.05


def test_a_specimen_tells_its_rod_from_another_in_a_clamp():
    other = Block(
        pose=Pose(x_mm=-12.0, y_mm=8.0, angle_deg=0.0), width_mm=5.0, colour=BLACK
    )
    beside = lying(0.0, -12.0, 8.0, length_mm=13.0)
    photo = as_photo(picture(replace(PLAIN, blocks=(other,), others=(beside,))))
    known = Setting(
        calibration=CAMERA, rod_height_mm=HEIGHT, clamp_height_mm=4.0,
        length_mm=26.0, side_mm=1.0,
    )  # fmt: skip
    found = measure(photo, known)
    assert found.ok, found.reason
    assert found.length_mm == pytest.approx(26.0, abs=0.1)


@pytest.mark.parametrize(("angle_deg", "x_mm", "y_mm"), [(100, 4, -14), (150, 14, -8)])
def test_a_rod_that_crosses_another_is_in_doubt(angle_deg, x_mm, y_mm):
    found = measured(replace(PLAIN, others=(lying(angle_deg, x_mm, y_mm, 24.0),)))
    assert found.ok, found.reason
    assert "other_rod" in found.flags
    assert off(found) < 0.08
    assert found.length_mm == pytest.approx(LINE.length_mm, abs=0.08)


def test_a_rod_that_leaves_the_picture_is_refused():
    camera = scene_camera(size_px=(800, 600), focal_px=3400.0, target_mm=(-36.0, 0.0))
    found = extract(as_photo(picture(PLAIN, camera)), camera, rod_height_mm=HEIGHT)
    assert not found.ok
    assert {"touches_border", "touches_object"} & set(found.flags)


def test_a_rod_that_grows_from_nothing_is_told_so():
    scene = replace(
        PLAIN, centreline=None, others=(lying(0.0, -8.0, 0.0),),
        clamp=replace(CLAMP, pose=replace(CLAMP.pose, x_mm=-90.0)),
    )  # fmt: skip
    found = measured(scene)
    assert found.flags == ("no_clamp",)
    assert found.seen_px


def test_nobody_gave_the_height_of_the_rod():
    photo = as_photo(picture(PLAIN))
    assert "height_assumed" in extract(photo, CAMERA).flags
    for known in (0.0, HEIGHT):
        assert "height_assumed" not in extract(photo, CAMERA, rod_height_mm=known).flags
        told = replace(CAMERA, rod_height_mm=known)
        assert "height_assumed" not in extract(photo, told).flags


def test_the_root_is_under_the_edge_that_a_telephone_sees_over_it():
    """Where the camera looks over the clamp from the side and from near."""
    near = scene_camera(
        size_px=(800, 600), focal_px=650.0, height_mm=32.0, tilt_deg=8.0,
        tilt_direction_deg=150.0, target_mm=(0.0, 0.0),
    )  # fmt: skip
    clamp = replace(CLAMP, pose=replace(CLAMP.pose, x_mm=-4.0, y_mm=6.0), height_mm=3.0)
    line = curve("arc", angle_deg=-30.0, length_mm=14.0)
    photo = as_photo(picture(replace(PLAIN, clamp=clamp, centreline=line), near))
    found = extract(photo, near, rod_height_mm=HEIGHT, clamp_height_mm=3.0)
    assert found.ok, found.reason
    true = specimen_to_px(near, clamp.pose, line.points_mm[:2])
    along = (true[1] - true[0]) / np.hypot(*(true[1] - true[0]))
    assert abs((found.clamp_px - true[0]) @ along) < 0.8
    assert found.clamp_sd_mm < 0.05


def test_a_rod_as_light_as_its_board_is_not_mistaken_for_its_shade():
    light = SceneLight(
        shadow_direction_deg=200.0, shadow_depth=0.6, slope=1.5, softness=0.1
    )
    scene = replace(PLAIN, rod_colour=RED, paper=GREEN_BOARD, light=light)
    found = measured(scene)
    assert found.ok, found.reason
    assert found.length_mm == pytest.approx(26.0, abs=0.1)
    assert off(found) < 0.1


def test_a_dark_rod_in_the_clamp_does_not_hide_a_striped_one():
    other = lying(-90.0, -16.0, -10.0, length_mm=8.0)
    scene = replace(PLAIN, rod_colour=GREEN, rod_stripe=YELLOW, others=(other,))
    found = measured(scene)
    assert found.ok, found.reason
    assert off(found) < 0.1


@pytest.mark.parametrize("stub_mm", [0.5, 1.0])
def test_a_stub_of_another_colour_belongs_to_the_rod(stub_mm):
    """Stripes of 5 mm leave a short one of the second colour at the end."""
    line = curve("arc", angle_deg=20.0, length_mm=15.0 + stub_mm)
    found = measured(replace(
        PLAIN, centreline=line, rod_colour=GREEN, rod_stripe=YELLOW
    ))  # fmt: skip
    assert found.ok, found.reason
    assert found.length_mm == pytest.approx(15.0 + stub_mm, abs=0.1)


def test_the_rod_ends_where_its_own_close_shade_begins():
    light = SceneLight(
        shadow_direction_deg=0.0, shadow_depth=0.65, slope=0.8, softness=0.25
    )
    line = curve("straight", length_mm=22.0)
    clamp = replace(CLAMP, pose=replace(CLAMP.pose, angle_deg=0.0))
    found = measured(replace(PLAIN, clamp=clamp, centreline=line, light=light))
    assert found.ok, found.reason
    assert found.length_mm == pytest.approx(22.0, abs=0.1)


def thing(first, last, width_px, bend=0.0):
    t = np.linspace(0.0, 1.0, 50)[:, None]
    points = (
        (1.0 - t) * np.array(first) + t * np.array(last) + np.array([0.0, bend]) * t**2
    )
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    return Thing([
        Candidate(
            points_px=points, width_px=width_px, length_px=length, root="border",
            contacts=1, ratio=0.2,
        )
    ])  # fmt: skip


def test_strokes_of_a_ruler_are_no_rods():
    """Thin and held by the border, they look liker rods than a wide one does."""
    strokes = [
        thing((40.0 + 50.0 * k, 0.0), (44.0 + 50.0 * k, 110.0 - 20.0 * (k % 2)), 4.0)
        for k in range(5)
    ]
    rod = thing((50.0, 400.0), (420.0, 400.0), 36.0, bend=-90.0)
    assert without_strokes([*strokes, rod]) == [rod]
    # Rods side by side, of which none is longer, stay rivals.
    assert without_strokes(strokes) == strokes
    assert len(without_strokes([*strokes[:2], rod])) == 3


def held(item, *, levels, contacts=1, **known):
    """Return a thing in a clamp, as so many levels show it."""
    seen = replace(item.best, root="clamp", contacts=contacts, **known)
    return Thing([seen] * levels)


def test_a_cable_that_is_held_at_both_ends_is_no_rival():
    """A rod has a tip; two that have one are refused."""
    rod = held(thing((50.0, 400.0), (420.0, 400.0), 18.0, bend=-90.0), levels=6)
    beside = thing((60.0, 90.0), (500.0, 100.0), 22.0)
    found = standing_out([rod, held(beside, levels=9, contacts=2)], Sought())
    assert found.points_px is rod.best.points_px
    assert found.rivalled
    with pytest.raises(LostError, match="two things"):
        standing_out([rod, held(beside, levels=6)], Sought())


def test_a_line_that_is_shorter_and_thinner_is_no_rod_beside_another():
    rod = held(thing((50.0, 400.0), (420.0, 400.0), 26.0, bend=-90.0), levels=3)
    lines = [
        held(thing((x, 90.0), (x + 90.0, 40.0 + 0.2 * x), 4.0), levels=3)
        for x in (30.0, 200.0, 420.0)
    ]
    found = standing_out([*lines, rod], Sought())
    assert found.points_px is rod.best.points_px
    assert found.rivalled


def test_a_pale_rod_is_no_shade_of_a_wide_cable_across_the_picture():
    """A shade lies near its rod, in widths of either."""
    cable = thing((50.0, 120.0), (500.0, 60.0), 80.0).best
    pale = replace(thing((50.0, 400.0), (420.0, 400.0), 16.0).best, ratio=0.8)
    assert not is_shade(pale, replace(cable, ratio=0.4))
    beside = pale.points_px + np.array([0.0, 40.0])
    assert is_shade(pale, replace(pale, points_px=beside, ratio=0.4))


def test_two_strokes_on_one_ground_do_not_hide_a_rod_in_a_clamp_on_another(monkeypatch):
    rod = held(thing((50.0, 400.0), (420.0, 400.0), 18.0, bend=-90.0), levels=6).best

    def two(*_):
        raise LostError("two_rods", "there are two things like a rod in the picture")
        yield

    def one(*_):
        yield rod

    looks = [(two, None, None), (one, None, None)]
    monkeypatch.setattr(choose, "_looks", lambda _photo: looks)
    rods = likely_rods(None, Sought())
    found = next(rods)
    assert found.points_px is rod.points_px
    assert found.rivalled
    with pytest.raises(LostError, match="two things"):
        next(rods)


def test_dark_sides_of_a_wide_bright_rod_are_no_two_rods():
    """They are as far apart all along and end together, as two bent rods do not."""
    theta = np.linspace(0.0, 0.8, 60)[:, None]
    outwards = np.hstack([np.sin(theta), -np.cos(theta)])

    def arc(radius, shift=0.0):
        points = radius * outwards + np.array([300.0, 700.0 + shift])
        return Candidate(
            points_px=points, width_px=10.0, length_px=0.8 * radius, root="clamp",
            contacts=1, ratio=0.1,
        )  # fmt: skip

    assert are_halves(arc(500.0), arc(536.0))
    assert not are_halves(arc(500.0), arc(500.0, shift=-36.0))
    assert not are_halves(arc(500.0), replace(arc(536.0), ratio=0.4))
    assert not are_halves(arc(500.0), arc(590.0))
