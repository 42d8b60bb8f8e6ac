"""The step that tells tip and clamp: no bias, near the Cramer-Rao bound."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.special import erf, ndtr

from magbend.vision import Pose, as_photo, extract
from magbend.vision.curve.curve import Curve
from magbend.vision.edge.clamp import ClampLines, between
from magbend.vision.edge.crossings import EndFace, crossings_of, line_through
from magbend.vision.edge.ends import find_ends
from magbend.vision.edge.state import State
from magbend.vision.edge.step_line import _solve, fit_step
from magbend.vision.edge.tip import _rough_end
from magbend.vision.extraction.refine import _look
from magbend.vision.extraction.root import SMEARED
from magbend.vision.synthetic import (
    Block,
    Scene,
    SceneLight,
    render_scene,
    scene_camera,
)
from magbend.vision.synthetic.scoring import signed_distance
from magbend.vision.synthetic.square_view import CLEAN, curve, draw

S = np.arange(-16.0, 16.0, 0.5)
ACROSS = np.linspace(-6.0, 6.0, 13)
LOW, HIGH, BLUR = 0.1, 0.8, 1.1
LINE = EndFace(s=0.0, sigma=0.0, skew=0.0, scatter=0.0, found=1.0)


def lanes_over(
    place, skew, *, slope=0.0, noise=0.0, rng=None, blur=BLUR, across=ACROSS
):
    """Blurred steps; the paper's light changes by `slope` per px behind them."""
    t = S[None] - place - skew * across[:, None]
    step = 0.5 * (1.0 + erf(t / blur / np.sqrt(2.0)))
    bell = blur * np.exp(-0.5 * (t / blur) ** 2) / np.sqrt(2.0 * np.pi)
    light = LOW + (HIGH - LOW) * step + slope * (t * step + bell)
    return light if rng is None else light + noise * rng.standard_normal(light.shape)


def fitted(light):
    crossing = crossings_of(light, S, 0.0, 2.4, 10.0, 4.0, 6.0)
    seen = line_through(light, S, ACROSS, crossing)
    return fit_step(seen, blur=BLUR, inner=10.0, outer=6.0)


@pytest.mark.parametrize("slope", [-0.02, 0.0, 0.02])
@pytest.mark.parametrize("skew", [-0.15, 0.0, 0.1])
def test_step_on_shade_is_found_without_bias(slope, skew):
    for place in (-0.4, 0.0, 0.3):
        face = fitted(lanes_over(place, skew, slope=slope))
        assert face.s == pytest.approx(place, abs=0.003)
        assert face.skew == pytest.approx(skew, abs=0.002)
        assert face.rise == pytest.approx(HIGH - LOW, abs=0.01)


@pytest.mark.parametrize("blur", [0.9, 1.4, 1.8])
def test_a_step_tells_its_own_blur(blur):
    face = fitted(lanes_over(0.2, 0.05, slope=0.01, blur=blur))
    assert face.blur == pytest.approx(blur, rel=0.1)
    assert face.s == pytest.approx(0.2, abs=0.01)


def test_step_scatters_as_the_bound_allows():
    noise, rng = 0.02, np.random.default_rng(4)
    found = [fitted(lanes_over(0.2, 0.0, noise=noise, rng=rng)).s for _ in range(200)]
    near = (S > 0.2 - 10.0) & (S < 0.2 + 6.0)
    t = (S[near] - 0.2) / BLUR
    step = 0.5 * (1.0 + erf(t / np.sqrt(2.0)))
    bell = np.exp(-0.5 * t**2) / np.sqrt(2.0 * np.pi)
    # Place, two levels and the outer one's slope, from all lanes together.
    design = np.column_stack(
        [-(HIGH - LOW) / BLUR * bell, 1.0 - step, step, t * step + bell]
    )
    inverse = np.linalg.inv(len(ACROSS) * design.T @ design)
    bound = noise * np.sqrt(inverse[0, 0])
    assert np.std(found) < 1.2 * bound
    assert abs(np.mean(found) - 0.2) < 4.0 * bound / np.sqrt(len(found))


def test_lane_with_a_speck_at_the_end_counts_for_nothing():
    light = lanes_over(0.0, 0.0)
    light[4] = np.where(np.abs(S - 2.0) < 2.5, LOW, light[4])
    assert fitted(light).s == pytest.approx(0.0, abs=0.01)


def test_a_line_that_no_step_fits_is_no_surer_than_the_blur():
    light = lanes_over(4.0, 0.0)
    seen = line_through(light, S, ACROSS, np.zeros(len(ACROSS)))
    found = fit_step(seen, blur=BLUR, inner=10.0, outer=6.0)
    assert found.s == seen.line.s
    assert found.sigma >= BLUR


@pytest.mark.parametrize("shade", [0.05, 0.1, 0.2])
def test_a_front_in_shade_that_is_not_straight_is_as_unsure_as_it_is_off(shade):
    light = lanes_over(0.0, 0.0)
    foot = light - shade * (light - LOW) * np.exp(-np.maximum(S, 0.0) / 3.0)
    found, clean = front_of(foot), front_of(light)
    assert clean.s == pytest.approx(0.0, abs=0.003)
    assert clean.place_sd < 0.01
    assert 0.01 < abs(found.s) < 2.5 * found.place_sd


def front_of(light, across=ACROSS):
    seen = line_through(light, S, across, np.zeros(len(across)))
    return fit_step(seen, blur=BLUR, inner=4.0, outer=6.0, own=True)


def test_a_front_in_grain_that_four_lanes_share_is_as_unsure_as_it_says():
    """As many as the fit counts for one: what is counted there must not be again."""
    rng, beside = np.random.default_rng(2), np.linspace(10.0, 40.0, 13)
    across = np.append(-beside[::-1], beside)
    plain, inside = lanes_over(0.0, 0.0, across=across), []
    for _ in range(400):
        grain = rng.standard_normal((len(across) + 3, len(S)))
        shared = sum(grain[k : len(across) + k] for k in range(4)) / 2.0
        found = front_of(plain + 0.02 * shared, across)
        inside.append(abs(found.s) < found.place_sd)
    assert 0.62 < np.mean(inside) < 0.86


@pytest.mark.parametrize("share", [0.03, 0.06, 0.12])
def test_a_shade_in_one_step_with_a_front_moves_it_by_a_share_of_what_it_blurs(share):
    front, shade = lanes_over(0.0, 0.0), lanes_over(1.0, 0.0)
    found = front_of((1.0 - share) * front + share * shade)
    more = math.sqrt(found.blur**2 - BLUR**2)
    assert found.s == pytest.approx(math.sqrt(share / (1.0 - share)) * more, rel=0.1)
    assert 0.5 * SMEARED * more < found.s < 1.5 * SMEARED * more


def test_lines_at_the_clamp_weigh_as_their_steps_squared_and_as_they_are_seen():
    """The front is seen over three widths of the rod, the face over 0.6."""
    alike = ClampLines(face=LINE._replace(rise=0.2), front=LINE._replace(rise=0.2))
    assert between(1.0, 2.0, alike) == pytest.approx(1.0 + 5.0 / 6.0)
    higher = ClampLines(face=LINE._replace(rise=0.1), front=LINE._replace(rise=0.3))
    assert between(1.0, 2.0, higher) == pytest.approx(1.0 + 45.0 / 46.0)
    unknown = ClampLines(face=LINE, front=LINE)
    assert between(1.0, 2.0, unknown) == pytest.approx(1.5)


def test_blur_does_not_pull_a_bent_rod_to_its_inner_side():
    light = replace(CLEAN, blur_px=2.4, noise=0.0005)
    inwards = []
    for seed, angle in enumerate((-200.0, 200.0)):
        one = draw(
            curve("arc", length_mm=24.0, angle_deg=angle), np.random.default_rng(seed),
            px_per_mm=18.0, light=light, size_px=(760, 760), clamp_height_mm=6.0,
        )  # fmt: skip
        result = extract(as_photo(one.image), one.truth.calibration)
        off = signed_distance(result.points_px, one.truth.points_px)[10:-10]
        inwards.append(-np.sign(angle) * off.mean())
    radius = 24.0 * 18.0 / np.radians(200.0)
    pull = (2.4**2 + 0.25) / (2.0 * radius)
    assert abs(np.mean(inwards)) < 0.3 * pull


def test_a_tip_before_its_own_deep_shade_is_not_the_end_of_the_shade():
    """The shade falls straight ahead of the rod and is darker than half the paper."""
    line = curve("straight", length_mm=20.0)
    pose = Pose(x_mm=-10.0, y_mm=0.0, angle_deg=0.0, height_mm=0.9)
    camera = scene_camera(
        size_px=(800, 600), focal_px=5200.0, target_mm=(0.0, 0.0), tilt_deg=0.5
    )
    light = SceneLight(
        shadow_direction_deg=8.0, shadow_depth=0.65, slope=1.2, softness=0.15
    )
    scene = Scene(clamp=Block(pose=pose), centreline=line, light=light, dust=0)
    picture = render_scene(scene, camera, np.random.default_rng(0))
    found = extract(
        as_photo(picture), camera, rod_height_mm=0.9, clamp_height_mm=4.0
    )  # fmt: skip
    assert found.ok, found.reason
    assert found.length_mm == pytest.approx(20.0, abs=0.06)


def test_a_paler_tail_is_no_shade_but_a_level_step_is():
    """Rod 0, shade 0.28, paper 1; the end is looked for about s = 0, blur 1 px."""
    s = np.arange(-30.0, 20.0, 0.5)

    def place(light):
        return _rough_end(light, s, 0.0, 12.0, 2.2, 8.0, 0.0, 0.0)

    tail = np.clip((s + 20.0) / 36.0, 0.0, 1.0)
    assert place(tail) == pytest.approx(-2.0, abs=0.6)
    step = 0.28 * ndtr(s + 8.0) + 0.72 * ndtr(s - 6.0)
    assert place(step) == pytest.approx(-8.0, abs=0.6)


@pytest.mark.parametrize("level", [0.1, 0.8])
def test_paper_or_rod_alone_holds_no_end(level):
    """A tip sought behind its place was found on the paper, where noise rises least."""
    s = np.arange(-30.0, 20.0, 0.5)
    noise = 0.005 * np.random.default_rng(1).standard_normal(s.size)
    found = _rough_end(level + noise, s, 0.0, 12.0, 2.2, 8.0, 0.0, 0.2 * (0.8 - 0.1))
    assert np.isnan(found)


def test_a_step_of_which_nothing_is_known_is_none():
    """A lane that a levelled profile tells beyond all bounds stopped the frame."""
    endless = np.full((1, 4, 4), np.inf)
    step = np.zeros(3)
    assert not _solve(endless, np.ones(1), np.ones(1), BLUR, (BLUR, 1.0), step)
    assert not step.any()


def test_both_ends_of_a_rod_that_floats_are_sought_as_far():
    grey, short = np.full((120, 200), 0.8, np.float32), 7.0
    grey[56:64, 40:161] = 0.1  # its ends are at 39.5 and 160.5
    grey = cv2.GaussianBlur(grey, (0, 0), 0.8)
    s = np.linspace(0.0, 121.0 - 2.0 * short, 108)
    points = np.column_stack([39.5 + short + s, np.full(len(s), 59.5)])
    axis = Curve(s, points, 0.0 * s, 0.0 * s)
    state = State(axis, np.full(len(s), 4.0), 8.0, 0.0, s[-1], 0.0, rough=False)
    seen = _look(grey, state, 1.0, 1, seeking=False)
    tip, _, first = find_ends(grey, state, seen, "free", 1.0, None, fine=True)
    assert (first, tip.s) == pytest.approx((-short, s[-1] + short), abs=0.02)
