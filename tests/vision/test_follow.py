"""A rod followed from frame to frame: as good as a full search, and never a ghost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from magbend.vision import Setting, as_photo, extract, follow
from magbend.vision.extraction import finish as finish_module
from magbend.vision.extraction import follow as follow_module
from magbend.vision.extraction import midline as midline_module
from magbend.vision.extraction import refine as refine_module
from magbend.vision.extraction.motion import pieces_of
from magbend.vision.synthetic import Light, curve, draw, signed_distance

SIZE, AT = (900, 640), (180.0, 520.0)


def frame(bend_deg, *, length_mm=30.0, at=AT, seed=0, **options):
    return draw(
        curve("graded", angle_deg=bend_deg, length_mm=length_mm),
        np.random.default_rng(seed), px_per_mm=16.0, size_px=SIZE, clamp_px=at,
        angle_deg=4.0, **options,
    )  # fmt: skip


SETTING = Setting(calibration=frame(0.0).truth.calibration)


@pytest.fixture(scope="module")
def first():
    return follow(as_photo(frame(40.0).image), SETTING)


def error_px(found, drawn):
    distance = signed_distance(found.points_px, drawn.truth.points_px)
    return float(np.sqrt(np.mean(distance**2)))


def no_full_search(*_args):
    raise AssertionError("the whole picture was searched")


@pytest.mark.parametrize("bend_deg", [40.0, 41.0, 43.0])
def test_a_rod_near_the_last_is_as_well_measured_as_by_a_full_search(
    first, bend_deg, monkeypatch
):
    drawn = frame(bend_deg, seed=1)
    photo = as_photo(drawn.image)
    whole = extract(photo, SETTING.calibration)
    monkeypatch.setattr(follow_module, "measure", no_full_search)
    found = follow(photo, SETTING, first)
    assert error_px(found, drawn) < 0.03
    np.testing.assert_allclose(found.tip_px, whole.tip_px, atol=0.05)
    assert found.pose.angle_deg == pytest.approx(whole.pose.angle_deg, abs=0.15)


def test_a_rod_that_jumped_is_found_again(first):
    drawn = frame(-60.0, at=(300.0, 200.0))
    found = follow(as_photo(drawn.image), SETTING, first)
    assert found.ok
    assert error_px(found, drawn) < 0.03


def test_another_rod_in_the_same_place_is_not_taken_for_the_last(first):
    drawn = frame(40.0, length_mm=24.0)
    found = follow(as_photo(drawn.image), SETTING, first)
    assert found.length_mm == pytest.approx(24.0, abs=0.05)


def test_an_empty_frame_has_no_rod_and_the_next_one_is_measured(first):
    empty = as_photo(np.full(SIZE[::-1], 225, np.uint8))
    lost = follow(empty, SETTING, first)
    assert lost.flags == ("no_rod",)
    again = follow(as_photo(frame(40.0).image), SETTING, lost)
    assert again.ok


def test_a_frame_of_another_size_is_refused(first):
    other = as_photo(np.full((480, 640), 225, np.uint8))
    assert follow(other, SETTING, first).flags == ("calibration_mismatch",)


def test_light_rods_and_rods_from_the_border_are_followed(monkeypatch):
    light = Light(paper=0.05, rod=0.8, clamp=0.5, shadow_depth=0.0)
    for options in ({"light": light}, {"at": (0.0, 520.0), "clamp_height_mm": 0.0}):
        one = follow(as_photo(frame(30.0, **options).image), SETTING)
        assert one.ok, one.reason
        drawn = frame(31.0, seed=2, **options)
        with monkeypatch.context() as patch:
            patch.setattr(follow_module, "measure", no_full_search)
            found = follow(as_photo(drawn.image), SETTING, one)
        assert found.ok
        assert ("clamp_at_border" in found.flags) is ("at" in options)
        assert abs(signed_distance(found.points_px, drawn.truth.points_px)).max() < 0.2


@pytest.mark.parametrize("expected_off_px", [0.06, 1.0])
def test_where_a_rod_is_found_does_not_hang_on_where_it_was_expected(
    first, expected_off_px, monkeypatch
):
    """By a tenth of it, damping and phase of a swing would be biased.

    Nor does it take more than two passes to find.
    """
    passes, fit_midline = [], refine_module.fit_midline

    def noted(*args, **options):
        passes.append(args)
        return fit_midline(*args, **options)

    monkeypatch.setattr(refine_module, "fit_midline", noted)
    photo = as_photo(frame(40.0).image)
    s = np.linspace(0.0, 1.0, len(first.points_px))[:, None]
    along = np.gradient(first.points_px, axis=0)
    aside = along[:, ::-1] * [-1.0, 1.0] / np.linalg.norm(along, axis=1)[:, None]
    found = []
    for off_px in (-expected_off_px, expected_off_px):
        state = first.motion.state.copy()
        state[0] = pieces_of(first.points_px + off_px * s**2 * aside)
        doubt = max(0.5 * expected_off_px, 0.05)
        motion = replace(
            first.motion, state=state, covariance=doubt**2 * np.eye(3), push_px=doubt
        )
        last = replace(first, motion=motion)
        found.append(follow(photo, SETTING, last).points_px)
    apart = np.abs(np.sum((found[1] - found[0]) * aside, axis=1))
    assert apart.max() < 0.04 * 2.0 * expected_off_px
    assert len(passes) <= 4


def test_what_is_known_of_a_rod_at_rest_is_not_looked_for_again(first, monkeypatch):
    def look(*_args, **_options):
        raise AssertionError("it was looked for again")

    monkeypatch.setattr(midline_module, "find_joints", look)
    monkeypatch.setattr(finish_module, "along_rod", look)
    found = follow(as_photo(frame(40.0, seed=3).image), SETTING, first)
    assert found.motion.looked is first.motion.looked
    np.testing.assert_allclose(found.joints_px, first.joints_px, atol=1.0)


def test_ends_wait_until_a_rod_that_moved_is_found(first, monkeypatch):
    asked, find_ends = [], refine_module.find_ends

    def noted(*args, **options):
        asked.append(args)
        return find_ends(*args, **options)

    monkeypatch.setattr(refine_module, "find_ends", noted)
    monkeypatch.setattr(follow_module, "measure", no_full_search)
    drawn = frame(43.0)
    found = follow(as_photo(drawn.image), SETTING, first)
    assert error_px(found, drawn) < 0.03
    assert len(asked) == 2


def test_joints_are_sought_again_where_a_rod_is_more_bent():
    found = follow(as_photo(frame(1.0).image), SETTING)
    straight = found
    for bend_deg in np.arange(3.0, 46.0, 3.0):
        found = follow(as_photo(frame(bend_deg).image), SETTING, found)
    assert found.motion.looked is not straight
    whole = extract(as_photo(frame(45.0).image), SETTING.calibration)
    np.testing.assert_allclose(found.joints_px, whole.joints_px, atol=4.0)


@pytest.mark.parametrize("at", [0.5, 1.0])
def test_what_comes_across_a_followed_rod_or_to_its_tip_is_seen(first, at):
    image = frame(40.0, seed=4).image.copy()
    x, y = np.rint(first.points_px[int(at * (len(first.points_px) - 1))]).astype(int)
    image[y - 20 : y + 20, x - 120 : x + 120] = 40
    found = follow(as_photo(image), SETTING, first)
    if at < 1.0:
        assert "other_rod" in found.flags
    else:
        assert found.flags == extract(as_photo(image), SETTING.calibration).flags
        assert not found.ok


def swing(k):
    return 40.0 + 8.0 * float(np.cos(0.3 * k))


@pytest.fixture(scope="module")
def swinging():
    """Return the last of frames of a swing that is foreseen."""
    found = None
    for k in range(22):
        found = follow(as_photo(frame(swing(k), seed=k).image), SETTING, found)
    return found


def test_a_swing_that_is_foreseen_is_looked_at_once(swinging, monkeypatch):
    looks, look = [], refine_module._look

    def noted(*args, **options):
        looks.append(args)
        return look(*args, **options)

    monkeypatch.setattr(refine_module, "_look", noted)
    drawn = frame(swing(22), seed=22)
    assert error_px(follow(as_photo(drawn.image), SETTING, swinging), drawn) < 0.03
    assert len(looks) == 1


@pytest.mark.parametrize(
    ("at", "light"),
    [((181.2, 519.1), 1.0), ((180.0, 524.0), 1.0), (AT, 0.7)],
)
def test_a_push_of_the_camera_or_another_light_shows_in_the_same_frame(
    swinging, at, light
):
    drawn = frame(swing(22), at=at, seed=22)
    image = np.rint(drawn.image * light).astype(np.uint8)
    found = follow(as_photo(image), SETTING, swinging)
    assert error_px(found, drawn) < 0.03
    np.testing.assert_allclose(found.clamp_px, drawn.truth.clamp_px, atol=0.25)
