"""Lines, rod and front tell the clamp's place and direction together."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from magbend.vision import Pose, as_photo, extract
from magbend.vision.curve.curve import Curve
from magbend.vision.edge.clamp import ClampLines
from magbend.vision.edge.crossings import EndFace
from magbend.vision.extraction.clamp_fit import APART, joint
from magbend.vision.extraction.root import root_place, together
from magbend.vision.extraction.setting import Setting
from magbend.vision.synthetic import (
    Block,
    Mark,
    Scene,
    curve,
    render_scene,
    scene_camera,
)

NO_FRONT = 0.0, np.inf
SEEN = 60.0
LINE = EndFace(0.0, 0.02, 0.0, 0.05, 1.0, 0.3, 1.0)
ANGLE = 4.0
CAMERA = scene_camera(
    size_px=(900, 720), focal_px=1000.0, height_mm=56.0, tilt_deg=11.0,
    tilt_direction_deg=20.0, target_mm=(0.0, 0.0),
)  # fmt: skip


def test_without_a_front_the_place_turns_the_direction_with_it():
    shift, covariance, apart = joint(0.5, 1e-3, 4e-3, *NO_FRONT, SEEN)
    assert shift.tolist() == [0.0, 0.0]
    assert apart == 0.0
    turned = 4e-3 * 0.5
    assert covariance[0, 0] == pytest.approx(0.25)
    assert covariance[0, 1] == pytest.approx(4e-3 * 0.25)
    assert covariance[1, 1] == pytest.approx(turned**2 + 1e-6)


def test_two_readings_of_a_straight_rod_are_weighed_by_their_squares():
    shift, covariance, _ = joint(0.1, 2e-3, 0.0, 1e-3, 1e-3, SEEN)
    assert shift == pytest.approx([0.0, 0.8e-3])
    assert covariance[1, 1] == pytest.approx(1.0 / (1.0 / 4e-6 + 1.0 / 1e-6))


def test_where_a_bent_rod_looks_tells_where_it_leaves_its_clamp():
    """A place in doubt by 5 px, and a direction known to what the rod turns on 1 px."""
    bend, true = 4e-3, 3.0
    shift, covariance, _ = joint(5.0, 1e-4, bend, bend * true, bend, SEEN)
    assert shift[0] == pytest.approx(true, rel=0.1)
    assert shift[1] == pytest.approx(bend * true, rel=0.1)
    assert np.sqrt(covariance[0, 0]) < 1.05


@pytest.mark.parametrize(("rod_sd", "believed"), [(1e-3, "rod"), (2e-2, "front")])
def test_what_disagrees_is_not_averaged_away(rod_sd, believed):
    turn, turn_sd = 0.1, 5e-3
    shift, covariance, apart = joint(0.05, rod_sd, 0.0, turn, turn_sd, SEEN)
    assert apart > APART
    assert shift[1] == pytest.approx(
        turn if believed == "front" else 0.0, abs=0.1 * turn
    )
    agreed = joint(0.05, rod_sd, 0.0, 0.0, turn_sd, SEEN)[1]
    assert covariance[1, 1] > 1.5 * agreed[1, 1]


def test_a_front_askew_by_more_than_is_known_puts_its_place_in_doubt():
    rod_sd, turn_sd, place_sd = 1e-3, 4e-3, 0.05
    as_known = joint(place_sd, rod_sd, 0.0, 3e-3, turn_sd, SEEN)[1]
    assert np.sqrt(as_known[0, 0]) == pytest.approx(place_sd)
    for turn in (0.02, 0.2):
        covariance = joint(place_sd, rod_sd, 0.0, turn, turn_sd, SEEN)[1]
        assert np.sqrt(covariance[0, 0]) > 0.9 * turn * SEEN


def test_an_end_on_the_rod_that_no_front_checks_is_doubted_more():
    end = EndFace(0.0, 0.1, 0.0, 0.15, 1.0, 0.3, 1.0)
    ends = SimpleNamespace(rise_along=np.zeros(2), along=np.full(2, 20.0))

    def place(front):
        seen = SimpleNamespace(
            clamp=ClampLines(face=end, front=front), blur=1.0, typical_width=20.0,
            tip=SimpleNamespace(blur=1.0),
        )  # fmt: skip
        return root_place(seen, ends, Setting(), 0.5)

    assert place(None).s == place(end).s == 0.0
    assert place(None).sd > 2.0 * place(end).sd


def straight_rod(face, front):
    s = np.linspace(0.0, 300.0, 31)
    points = np.column_stack([400.0 + s, np.full(31, 350.0)])
    curve = Curve(s=s, points=points, theta=np.zeros(31), kappa=np.zeros(31))
    return SimpleNamespace(
        clamp=ClampLines(face=face, front=front), blur=1.0, typical_width=20.0,
        tip=SimpleNamespace(blur=1.0), fit=SimpleNamespace(curve=curve),
    )  # fmt: skip


def test_a_line_at_another_height_is_known_no_better_than_the_camera_s_tilt():
    """The clamp's front on the paper, 3 mm below the axis, at 20 px/mm."""
    ends = SimpleNamespace(rise_along=np.zeros(2), along=np.full(2, 20.0))

    def sd(height_mm, tilt_sd_deg):
        camera = replace(CAMERA, tilt_sd_deg=tilt_sd_deg)
        setting = Setting(calibration=camera, rod_height_mm=height_mm)
        return root_place(straight_rod(None, LINE), ends, setting, 0.5).sd

    assert sd(0.0, 0.5) == sd(0.0, 0.0)
    more = np.sqrt(sd(3.0, 0.5) ** 2 - sd(3.0, 0.0) ** 2)
    assert more == pytest.approx(np.radians(0.5) * 3.0 * 20.0)


def test_a_line_seen_aslant_is_known_no_better_than_the_camera_s_height():
    """A front on the paper, 3 mm below the axis, leans by 0.15 of that: 9 px."""
    ends = SimpleNamespace(rise_along=np.full(2, -3.0), along=np.full(2, 20.0))

    def sd(relative):
        height = CAMERA.camera_height_mm
        camera = replace(CAMERA, camera_height_sd_mm=relative * height)
        setting = Setting(calibration=camera, rod_height_mm=3.0)
        return root_place(straight_rod(None, LINE), ends, setting, 0.5).sd

    assert np.sqrt(sd(0.05) ** 2 - sd(0.0) ** 2) == pytest.approx(0.05 * 9.0)


def test_two_lines_under_one_tilt_tell_more_than_either():
    """The higher leans to one side by as much as the lower to the other."""
    tilt_sd, above = 0.01, np.array([30.0, -30.0])
    seen = 0.3 * above / 30.0
    lines = [(float(s), 0.05, float(h)) for s, h in zip(seen, above, strict=True)]
    place, sd = together(lines, tilt_sd)
    assert place == pytest.approx(0.0, abs=1e-9)
    assert sd == pytest.approx(0.05 / np.sqrt(2.0))
    assert together(lines[:1], tilt_sd)[1] == pytest.approx(np.hypot(0.05, 0.3))
    # The same lines under a camera whose tilt is known contradict each other.
    assert together(lines, 0.0)[1] == pytest.approx(0.3)


def test_what_hides_a_root_without_a_front_may_be_the_face_of_a_chuck():
    """Then the rod ends where it is seen to, not where a top as high would hide it."""
    ends = SimpleNamespace(rise_along=np.full(2, 3.0), along=np.full(2, 20.0))
    setting = Setting(calibration=CAMERA, rod_height_mm=3.0, clamp_height_mm=5.0)
    boxed = root_place(straight_rod(LINE, LINE), ends, setting, 0.5)
    alone = root_place(straight_rod(LINE, None), ends, setting, 0.5)
    assert alone.s == boxed.s != 0.0
    assert boxed.sd < 0.1 < 0.5 * abs(alone.s) < alone.sd


def photographed(shape, *, skew_deg=0.0):
    """Photograph a rod by a near, tilted lens; the clamp's foot may look askew."""
    pose = Pose(x_mm=-12.0, y_mm=-6.0, angle_deg=ANGLE, height_mm=1.4)
    corners = np.array([[-3.0, -5.0], [0.5, -5.0], [0.5, 5.0], [-3.0, 5.0]])
    askew = Pose(x_mm=0.0, y_mm=0.0, angle_deg=skew_deg).to_board(corners)
    foot = Mark(outline_mm=pose.to_board(askew), colour=(0.3, 0.3, 0.3))
    scene = Scene(
        clamp=Block(pose=pose, width_mm=10.0, height_mm=4.0), centreline=shape,
        marks=(foot,) if skew_deg else (), dust=0,
    )  # fmt: skip
    return as_photo(render_scene(scene, CAMERA, np.random.default_rng(5)))


def measured(photo, **known):
    found = extract(photo, CAMERA, rod_height_mm=1.4, clamp_height_mm=4.0, **known)
    assert found.ok, found.reason
    return found, abs(found.pose.angle_deg - ANGLE)


def test_a_square_front_steadies_the_direction_of_a_rod_that_is_bent_both_ways():
    photo = photographed(curve("s", angle_deg=45.0, length_mm=20.0))
    alone, off_alone = measured(photo, clamp_square_sd_deg=1e3)
    found, off = measured(photo)
    assert "direction_doubtful" in alone.flags
    assert "direction_doubtful" not in found.flags
    assert off < 0.45 * off_alone
    assert found.clamp_angle_sd_deg < 0.6 * alone.clamp_angle_sd_deg
    assert off < 2.0 * found.clamp_angle_sd_deg


def test_a_front_that_is_not_square_is_named_and_not_believed():
    photo = photographed(curve("straight", length_mm=20.0), skew_deg=6.0)
    found, off = measured(photo)
    assert "clamp_lines_differ" in found.flags
    assert off < 3.0 * found.clamp_angle_sd_deg < 1.0
    # The foot lies half a millimetre ahead of the face, and the rod is dim on it.
    off_mm = np.hypot(found.pose.x_mm + 12.0, found.pose.y_mm + 6.0)
    assert off_mm < 3.0 * found.clamp_sd_mm
