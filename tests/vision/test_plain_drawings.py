"""Drawings by plain OpenCV, not by our renderer: shade, gloss, bars, pale rods."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from magbend.vision import as_photo, extract
from magbend.vision.camera.calibrate import calibrate_known_length
from magbend.vision.edge.state import LostError
from magbend.vision.extraction.best_light import measure_candidate
from magbend.vision.extraction.setting import Setting
from magbend.vision.find.candidate import Candidate
from magbend.vision.find.ground import View, best_view
from magbend.vision.synthetic import signed_distance

SIZE, FINE, WIDTH = (800, 500), 2, 20.0
BLACK, RED, GREEN = (0.025,) * 3, (0.05, 0.04, 0.45), (0.06, 0.25, 0.05)
TAN, ORANGE, BLUE = (0.26, 0.43, 0.58), (0.03, 0.4, 0.9), (0.5, 0.25, 0.06)
ROOT = np.array([200.0, 240.0])
CLAMP = ROOT + np.array([[0, 90], [0, -90], [-110, -90], [-110, 90]])
SCALE = calibrate_known_length(
    SIZE, from_px=(0.0, 0.0), to_px=(400.0, 0.0), length_mm=20.0
)


def covered(corners):
    mask = np.zeros((SIZE[1] * FINE, SIZE[0] * FINE), np.uint8)
    fixed = np.round(((corners + 0.5) * FINE - 0.5) * 16).astype(np.int32)
    cv2.fillPoly(mask, [fixed.reshape(-1, 1, 2)], 255, shift=4)
    return cv2.resize(mask, SIZE, interpolation=cv2.INTER_AREA)[..., None] / 255.0


def axis(turn_deg, length=400.0):
    theta = np.radians(turn_deg) * np.linspace(0.0, 1.0, 400)
    step = length / 400.0 * np.column_stack([np.cos(theta), np.sin(theta)])
    return ROOT + np.cumsum(step, axis=0), theta


def strip(turn_deg, low, high):
    """Return the corners of what lies along a rod between two offsets, in widths.

    They are numbers, or one for each of the 400 points of the axis.
    """
    points, theta = axis(turn_deg)
    aside = WIDTH * np.column_stack([-np.sin(theta), np.cos(theta)])
    low, high = np.reshape(low, (-1, 1)), np.reshape(high, (-1, 1))
    return np.vstack([points + low * aside, (points + high * aside)[::-1]])


def drawn(
    *, rod, turn_deg, shade_px=(0, 0), deep=0.0, clamp=0.2, over=(), blur_px=1.0,
    board=0.7, thin=1.0,
):  # fmt: skip
    """Return a photograph of a rod whose shade is moved by `shade_px`.

    `over` are pairs of a colour and corners, drawn over all else. The rod tapers to
    `thin` of its width.
    """
    half = np.linspace(0.5, 0.5 * thin, 400)
    body = strip(turn_deg, -half, half)
    moved = np.asarray(shade_px, float)
    both = np.vstack([CLAMP, CLAMP + 1.8 * moved]).astype(np.float32)
    shade = np.maximum(
        covered(body + moved), covered(cv2.convexHull(both)[:, 0].astype(float))
    )
    light = np.full((SIZE[1], SIZE[0], 3), board) * (1.0 - deep * shade)
    for colour, corners in ((rod, body), ((clamp,) * 3, CLAMP), *over):
        light += (np.array(colour) - light) * covered(corners)
    light = cv2.GaussianBlur(light, (0, 0), blur_px)
    light += np.random.default_rng(3).normal(0.0, 0.004, light.shape)
    pixels = 255.0 * (1.055 * np.clip(light, 0.004, 1.0) ** (1 / 2.4) - 0.055)
    return as_photo(np.rint(pixels).astype(np.uint8))


def measured(**what):
    found = extract(drawn(**what), SCALE, rod_height_mm=0.0)
    assert found.ok, found.reason
    assert len(set(found.flags)) == len(found.flags)
    return found


@pytest.mark.parametrize(
    ("shade_px", "clamp"), [((10, 2), 0.05), ((11, 9), 0.05), ((8, 30), 0.2)]
)
def test_the_front_of_a_clamps_shade_is_not_the_clamp(shade_px, clamp):
    found = measured(rod=RED, turn_deg=25.0, shade_px=shade_px, deep=0.55, clamp=clamp)
    assert abs(found.clamp_px[0] - ROOT[0]) < 1.5
    assert abs(found.length_mm - 20.0) < 0.08


@pytest.mark.parametrize(
    ("rod", "turn_deg", "shade_px", "deep", "clamp"),
    [
        ((0.3, 0.1, 0.05), 80.0, (4, 11), 0.65, 0.12),
        ((0.1, 0.1, 0.1), 25.0, (6, 8), 0.49, 0.05),
        ((0.3, 0.1, 0.05), 5.0, (4, -10), 0.61, 0.12),
    ],
)
def test_nor_is_that_of_a_shade_shorter_than_half_a_width(
    rod, turn_deg, shade_px, deep, clamp
):
    found = measured(
        rod=rod, turn_deg=turn_deg, shade_px=shade_px, deep=deep, clamp=clamp
    )
    assert abs(found.clamp_px[0] - ROOT[0]) < 1.5
    assert abs(found.length_mm - 20.0) < 0.08


@pytest.mark.parametrize(("clamp", "on_rod"), [(0.02, 14), (0.1, 22), (0.2, 30)])
def test_nor_is_it_where_that_shade_falls_on_a_coloured_rod(clamp, on_rod):
    """In the rod's own colour a dark clamp is as light as paper, its shade half."""
    part = strip(20.0, -0.5, 0.5)[np.r_[:on_rod, 800 - on_rod : 800]]
    found = measured(
        rod=RED, turn_deg=20.0, shade_px=(12, 9), deep=0.6, clamp=clamp,
        over=[(0.4 * np.array(RED), part)],
    )  # fmt: skip
    assert abs(found.clamp_px[0] - ROOT[0]) < 0.7
    assert abs(found.length_mm - 20.0) < 0.03


@pytest.mark.parametrize(("rod", "deep"), [(RED, 0.66), (BLACK, 0.68)])
def test_a_rod_is_measured_without_the_shade_along_it(rod, deep):
    found = measured(rod=rod, turn_deg=5.0, shade_px=(-6, 17), deep=deep)
    assert found.width_px == pytest.approx(WIDTH, rel=0.03)
    truth, _ = axis(5.0)
    away = [np.hypot(*(truth - point).T).min() for point in found.points_px[:-1]]
    assert max(away) < 1.0


@pytest.mark.parametrize("rod", [RED, TAN])
def test_a_colour_tells_a_rod_from_a_shade_that_is_as_dark_or_darker(rod):
    found = measured(rod=rod, turn_deg=40.0, shade_px=(4, 9), deep=0.66)
    assert not {"direction_doubtful", "clamp_doubtful"} & set(found.flags)
    assert found.width_px == pytest.approx(WIDTH, rel=0.03)
    assert np.hypot(*(found.tip_px - axis(40.0)[0][-1])) < 0.5
    assert found.length_mm == pytest.approx(20.0, abs=0.06)


@pytest.mark.parametrize(
    "coloured",
    [{"rod": RED}, {"rod": GREEN}, {"rod": ORANGE, "board": BLUE, "clamp": 0.03}],
)
def test_a_rod_is_as_wide_in_any_colour(coloured):
    """Grey values made before the light was linear: 0.3 to 1.2 px off in such blurs."""
    black, other = (
        measured(**each, turn_deg=30.0, blur_px=1.5).width_px
        for each in ({"rod": BLACK}, coloured)
    )
    assert other == pytest.approx(black, abs=0.06)


def test_it_tells_a_clamps_front_from_a_shade_that_blur_makes_one_with_it():
    found = measured(rod=RED, turn_deg=9.0, shade_px=(4, 12), deep=0.5, blur_px=3.2)
    assert abs(found.clamp_px[0] - ROOT[0]) < 1.5
    assert found.length_mm == pytest.approx(20.0, abs=0.06)


@pytest.mark.parametrize("deep", [0.0, 0.5])
def test_a_front_that_is_blurred_into_its_shade_is_in_doubt(deep):
    found = measured(rod=BLACK, turn_deg=30.0, shade_px=(6, 14), deep=deep, blur_px=5.0)
    assert ("clamp_doubtful" in found.flags) == (deep > 0.0)
    assert (abs(found.clamp_px[0] - ROOT[0]) < 1.5) == (deep == 0.0)


def test_a_tip_ends_where_a_shade_as_dark_as_itself_nearly_begins():
    """It keeps 0.15 of the light, straight ahead: the rod was 1.3 mm too long."""
    found = measured(rod=BLACK, turn_deg=1.0, shade_px=(26, 0), deep=0.85)
    assert np.hypot(*(found.tip_px - axis(1.0)[0][-1])) < 1.0


@pytest.mark.parametrize("deep", [0.0, 0.58])
def test_a_clamp_whose_front_is_more_blurred_than_its_rod_is_in_doubt(deep):
    """Its short shade straight ahead moves no side of the rod, but the root by 6 px."""
    found = measured(
        rod=BLACK, turn_deg=15.0, shade_px=(4.8, -2.3), deep=deep, clamp=0.05,
        blur_px=2.3,
    )  # fmt: skip
    off_mm = abs(found.clamp_px[0] - ROOT[0]) / 20.0
    assert (off_mm > 0.2) == ("clamp_doubtful" in found.flags) == (deep > 0.0)
    assert off_mm < max(0.04, 2.0 * found.clamp_sd_mm)


def test_a_black_rod_ends_before_its_deep_shade():
    shade_px = (12.0 * np.cos(np.radians(40.0)), 12.0 * np.sin(np.radians(40.0)))
    found = measured(rod=BLACK, turn_deg=40.0, shade_px=shade_px, deep=0.69)
    assert np.hypot(*(found.tip_px - axis(40.0)[0][-1])) < 1.0


def test_a_paler_half_beside_its_darker_shade_is_not_lost_without_a_word():
    low, high = strip(20.0, -0.5, 0.5).reshape(2, -1, 2)
    pale = np.vstack([low[200:], high[:200]])
    light = {"rod": BLACK, "turn_deg": 20.0, "shade_px": (2, 9), "deep": 0.4}
    assert "tip_goes_on" in measured(**light, over=[((0.5,) * 3, pale)]).flags
    assert "tip_goes_on" not in measured(**light).flags


def test_a_white_half_whose_dim_side_looks_like_paper_is_not_lost_without_a_word():
    lit, dim = (
        np.vstack([low[200:], high[:200]])
        for low, high in (
            strip(20.0, *sides).reshape(2, -1, 2) for sides in ((-0.5, 0.2), (0.2, 0.5))
        )
    )
    white = [((0.75,) * 3, lit), ((0.61,) * 3, dim)]
    light = {"rod": RED, "turn_deg": 20.0, "board": 0.6}
    assert "tip_goes_on" in measured(**light, over=white).flags
    assert "tip_goes_on" not in measured(**light).flags


def test_a_red_rod_in_a_jpeg_is_no_wider_than_it_is_beside_its_deep_shade():
    """JPEG keeps every other pixel's colour, which alone tells the rod from shade."""
    photo = drawn(
        rod=(0.016, 0.013, 0.155), turn_deg=30.0, shade_px=(-14, -36), deep=0.7
    )
    colour = np.asarray(photo.decode())
    half = [cv2.IMWRITE_JPEG_QUALITY, 90, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, 0x221111]
    _, data = cv2.imencode(".jpg", colour, half)
    found = extract(as_photo(cv2.imdecode(data, cv2.IMREAD_COLOR)), SCALE)
    assert found.ok, found.reason
    assert found.width_px == pytest.approx(WIDTH, rel=0.03)
    assert np.hypot(*(np.array(found.tip_px) - axis(30.0)[0][-1])) < 0.6


def bar(at, angle_deg, length, width):
    """Return the corners of a bar about a point."""
    t = np.radians(angle_deg)
    along, aside = np.array([np.cos(t), np.sin(t)]), np.array([-np.sin(t), np.cos(t)])
    corners = 0.5 * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
    return at + corners @ np.array([length * along, width * aside])


def is_measured(photo, turn_deg, doubt="other_rod"):
    found = extract(photo, SCALE, rod_height_mm=0.0)
    assert found.ok, found.reason
    assert doubt in {*found.flags, ""}
    truth, _ = axis(turn_deg)
    away = [np.hypot(*(truth - point).T).min() for point in found.points_px[:-1]]
    assert max(away) < 1.0
    assert abs(found.length_mm - 20.0) < 0.08


@pytest.mark.parametrize("clamp", [0.3, 0.42])
def test_a_bar_over_a_rod_is_not_its_clamp(clamp):
    points, theta = axis(45.0)
    across = np.degrees(theta[150]) + 65.0
    over = ((0.05,) * 3, bar(points[150], across, 200, 30))
    photo = drawn(rod=RED, turn_deg=45.0, clamp=clamp, over=[over])
    is_measured(photo, 45.0)


def test_a_wire_that_crosses_a_rod_does_not_grow_from_it():
    points, theta = axis(-100.0)
    across = np.degrees(theta[316]) + 60.0
    over = ((0.14,) * 3, bar(points[316], across, 420, 12.4))
    photo = drawn(rod=GREEN, turn_deg=-100.0, over=[over])
    found = extract(photo, SCALE, rod_height_mm=0.0)
    assert not found.ok  # it leaves the picture


@pytest.mark.parametrize("wide", [4, 8, 20, 44])
@pytest.mark.parametrize("above", [True, False])
@pytest.mark.parametrize("aslant_deg", [50, -80])
def test_a_rod_goes_on_across_a_bar(wide, above, aslant_deg):
    points, theta = axis(60.0)
    across = bar(points[220], np.degrees(theta[220]) + aslant_deg, 240, wide)
    over = [((0.03,) * 3, across)]
    if not above:
        over.append((RED, strip(60.0, -0.5, 0.5)))
    photo = drawn(rod=RED, turn_deg=60.0, over=over)
    is_measured(photo, 60.0, "other_rod" if wide >= 0.5 * WIDTH else "")


def test_a_bar_as_wide_and_as_dark_is_not_taken_for_the_rod_it_crosses():
    points, theta = axis(80.0)
    over = (BLACK, bar(points[200], np.degrees(theta[200]) + 35.0, 380, WIDTH))
    is_measured(drawn(rod=BLACK, turn_deg=80.0, over=[over]), 80.0)


def test_a_white_rod_in_a_black_clamp_on_a_dark_board_is_measured():
    board = np.array([[-1.0, -1.0], [801.0, -1.0], [801.0, 501.0], [-1.0, 501.0]])
    body = strip(40.0, -0.5, 0.5)
    over = [((0.05,) * 3, board), ((0.8,) * 3, body), ((0.02,) * 3, CLAMP)]
    is_measured(drawn(rod=RED, turn_deg=40.0, over=over), 40.0, "")


def test_a_wire_to_the_border_is_not_where_the_rod_leaves_the_picture():
    points, theta = axis(50.0)
    wire = bar(points[200], np.degrees(theta[200]) + 80.0, 1500, 5)
    photo = drawn(rod=RED, turn_deg=50.0, over=[((0.05,) * 3, wire)])
    is_measured(photo, 50.0, "")


def test_a_sharp_bend_is_no_crossing():
    """A worm turns in a radius of one width."""
    theta = np.pi * np.clip(np.linspace(-2.0, 3.0, 500), 0.0, 1.0)
    points = ROOT + np.cumsum(0.8 * np.column_stack([np.cos(theta), np.sin(theta)]), 0)
    aside = 0.5 * WIDTH * np.column_stack([-np.sin(theta), np.cos(theta)])
    body = (BLACK, np.vstack([points + aside, (points - aside)[::-1]]))
    photo = drawn(rod=(0.7,) * 3, turn_deg=0.0, clamp=0.7, over=[body])
    found = extract(photo, SCALE, rod_height_mm=0.0, clamp="none")
    assert found.ok, found.reason
    assert found.length_px == pytest.approx(400.0, abs=4.0)


def test_a_shade_nearly_as_dark_is_no_second_rod():
    photo = drawn(rod=(0.17,) * 3, turn_deg=60.0, shade_px=(-30, 45), deep=0.6)
    is_measured(photo, 60.0)


def test_a_rod_that_ends_at_a_bar_is_refused():
    points, theta = axis(30.0)
    over = (BLACK, bar(points[-1], np.degrees(theta[-1]) + 90.0, 200, WIDTH))
    found = extract(drawn(rod=BLACK, turn_deg=30.0, over=[over]), SCALE)
    assert "touches_object" in found.flags


@pytest.mark.parametrize(
    ("light", "low", "high"),
    [(0.65, 0.0, 0.2), (0.9, -0.1, 0.1), (0.65, 0.25, 0.44), (1.2, -0.42, -0.2)],
)
def test_a_streak_of_gloss_all_along_moves_no_edge(light, low, high):
    matt = measured(rod=BLACK, turn_deg=50.0)
    over = [((light,) * 3, strip(50.0, low, high))]
    glossy = extract(
        drawn(rod=BLACK, turn_deg=50.0, over=over), SCALE, rod_height_mm=0.0
    )
    assert glossy.ok, glossy.reason
    assert not {"other_rod", "rough_edges", "ragged_tip"} & set(glossy.flags)
    assert glossy.width_px == pytest.approx(matt.width_px, abs=0.15)
    assert glossy.length_px == pytest.approx(matt.length_px, abs=0.25)
    aside = signed_distance(glossy.points_px[1:-1], matt.points_px)
    assert np.abs(aside).max() < 0.2


def test_the_colour_that_tells_a_light_rod_may_be_cut_off():
    def on_blue(red):
        photo = drawn(
            rod=(0.03, 0.4, red), turn_deg=50.0, board=BLUE,
            clamp=0.03, blur_px=1.5,
        )  # fmt: skip
        points, _ = axis(50.0)
        rod = Candidate(
            points_px=points, width_px=WIDTH, length_px=400.0, root="clamp",
            contacts=1, ratio=1.3,
        )  # fmt: skip
        view = best_view(photo, points, WIDTH)
        return measure_candidate(photo, Setting(calibration=SCALE), rod, view)

    whole, cut_off = on_blue(0.9), on_blue(1.2)
    assert "clipped" in cut_off.flags
    assert "overexposed" not in cut_off.flags
    assert cut_off.width_px == pytest.approx(whole.width_px, abs=0.1)


@pytest.mark.parametrize(("rod", "blur_px"), [(BLACK, 5.0), (GREEN, 7.5), (RED, 6.5)])
def test_blur_moves_no_edge(rod, blur_px):
    sharp = measured(rod=BLACK, turn_deg=50.0)
    soft = extract(
        drawn(rod=rod, turn_deg=50.0, blur_px=blur_px), SCALE, rod_height_mm=0.0
    )
    assert soft.ok, soft.reason
    assert set(soft.flags) == {"blurred"}
    assert soft.width_px == pytest.approx(sharp.width_px, abs=0.25)
    aside = signed_distance(soft.points_px[1:-1], sharp.points_px)
    assert np.abs(aside).max() < 0.1
    assert np.hypot(*np.subtract(soft.tip_px, sharp.tip_px)) < 0.5


def test_a_thin_rim_of_a_glossy_rod_tells_its_clamp_too():
    over = [((0.5, 0.49, 0.8), strip(50.0, 0.25, 0.4))]
    photo = drawn(rod=RED, turn_deg=50.0, clamp=0.08, over=over)
    rim = Candidate(
        points_px=strip(50.0, 0.45, 0.45)[:400], width_px=2.0, length_px=390.0,
        root="clamp", contacts=1, ratio=0.3,
    )  # fmt: skip
    view = View(grey=photo.grey, sign=1.0)
    glossy = measure_candidate(photo, Setting(calibration=SCALE), rim, view)
    matt = measured(rod=RED, turn_deg=50.0, clamp=0.08)
    assert np.hypot(*np.subtract(glossy.clamp_px, matt.clamp_px)) < 0.5


@pytest.mark.parametrize("layers", [0.115, 0.13])
def test_a_rod_is_not_followed_between_the_layers_of_a_clamp_as_dark(layers):
    across = WIDTH * np.array([-3.5, -2.0, -1.0, 0.5, 1.5, 3.0])
    corners = WIDTH * np.array([[-5.4, 0.0], [-0.2, 0.0], [-0.2, 0.5], [-5.4, 0.5]])
    over = [((layers,) * 3, ROOT + corners + (0.0, y)) for y in across]
    found = measured(rod=(0.1,) * 3, turn_deg=30.0, clamp=0.1, over=over)
    assert np.hypot(*(found.clamp_px - ROOT)) < 1.0
    assert found.length_mm == pytest.approx(20.0, abs=0.05)


@pytest.mark.parametrize("shade", [0.7, 0.35, 0.25])
def test_a_tip_that_is_blurred_into_its_shade_is_doubted(shade):
    """Without a calibration nothing tells such a shade from the rod's end face."""
    points, theta = axis(30.0)
    along = np.array([np.cos(theta[-1]), np.sin(theta[-1])])
    side = 0.5 * WIDTH * np.array([-along[1], along[0]])
    near, far = points[-1], points[-1] + 6.0 * along
    beyond = np.array([near - side, near + side, far + side, far - side])
    photo = drawn(
        rod=(0.05,) * 3, turn_deg=30.0, over=[((shade,) * 3, beyond)], blur_px=2.0
    )
    assert ("ragged_tip" in extract(photo, None).flags) == (shade < 0.7)


def test_two_rods_side_by_side_are_doubted():
    shared = np.array([0.0, 1.4 * WIDTH])
    second = strip(0.0, -0.5, 0.5) + shared
    photo = drawn(rod=BLACK, turn_deg=0.0, over=[(BLACK, second)])
    found = extract(photo, SCALE, rod_height_mm=0.0)
    assert not found.ok or "other_rod" in found.flags


def test_of_two_rods_in_a_clamp_the_known_length_tells_which():
    points, theta = axis(30.0)
    aside = 0.5 * WIDTH * np.column_stack([-np.sin(theta), np.cos(theta)])[:280]
    beside = points[:280] + np.array([0.0, 60.0])
    second = (BLACK, np.vstack([beside + aside, (beside - aside)[::-1]]))
    photo = drawn(rod=BLACK, turn_deg=30.0, over=[second])
    assert "two_rods" in extract(photo, SCALE, rod_height_mm=0.0).flags
    for length_mm in (20.0, 14.0):
        found = extract(photo, SCALE, rod_height_mm=0.0, length_mm=length_mm)
        assert found.ok, found.reason
        assert found.length_mm == pytest.approx(length_mm, abs=0.1)


def test_a_rod_nearly_as_light_as_its_paper_is_found():
    found = measured(rod=(0.57,) * 3, turn_deg=30.0)
    assert found.length_mm == pytest.approx(20.0, abs=0.1)
    assert found.width_px == pytest.approx(WIDTH, rel=0.05)


def blind(shape):
    return np.full(shape, 0.5)


def grainy(shape):
    grain = cv2.GaussianBlur(np.random.default_rng(5).normal(size=shape), (0, 0), 4.0)
    return 0.12 * grain / grain.std()


def colour_shows(monkeypatch, light, kept, aside):
    """Let a rod's colour show it so many widths aside, in a light that is no better."""

    def in_its_colour(photo, rod, view):
        grey = kept * photo.grey + light(photo.grey.shape)
        points = rod.points_px + np.array([0.0, aside * rod.width_px])
        view = replace(view, grey=grey.astype(np.float32), mix=(1.0, 1.0, -2.0))
        return replace(rod, points_px=points), view

    for room in ("extract", "best_light"):
        monkeypatch.setattr(
            f"magbend.vision.extraction.{room}.in_its_colour", in_its_colour
        )


@pytest.mark.parametrize(("light", "kept"), [(blind, 0.0), (grainy, 1.0)])
@pytest.mark.parametrize("aside", [0.0, 0.25])
def test_a_rod_whose_colour_does_not_tell_it_is_measured_in_plain_light(
    monkeypatch, light, kept, aside
):
    """Coarse colours of a JPEG may hide a clamp, or make a smooth rod rough.

    Where they show the rod all the same, plain light that shows it there is no doubt.
    """
    plain = measured(rod=RED, turn_deg=30.0)
    colour_shows(monkeypatch, light, kept, aside)
    found = measured(rod=RED, turn_deg=30.0)
    assert found.length_mm == pytest.approx(plain.length_mm, abs=0.05)
    assert found.mix is None
    assert ("other_rod" in found.flags) == (aside > 0.0)


def test_plain_light_is_not_believed_where_colour_shows_the_rod_elsewhere(monkeypatch):
    colour_shows(monkeypatch, blind, 0.0, 0.8)
    found = extract(drawn(rod=RED, turn_deg=30.0), SCALE, rod_height_mm=0.0)
    assert not found.ok


@pytest.mark.parametrize("aside", [0.0, 0.8])
def test_edges_farther_aside_are_not_believed_where_colour_shows_the_rod_elsewhere(
    monkeypatch, aside
):
    """A rod too thin to be measured by its colour had its shade given for it."""

    def wide_alone(photo, setting, rod, view):
        if rod.width_px < 1.5 * WIDTH:
            raise LostError("edges_lost", "there are none")
        return plain

    plain = measured(rod=RED, turn_deg=30.0)
    colour_shows(monkeypatch, blind, 0.0, aside)
    monkeypatch.setattr(
        "magbend.vision.extraction.extract.measure_candidate", wide_alone
    )
    found = extract(drawn(rod=RED, turn_deg=30.0), SCALE, rod_height_mm=0.0)
    assert found.ok == (aside == 0.0)


@pytest.mark.parametrize(("shade_px", "alone"), [((-17, 3), True), ((-16, 6), False)])
def test_a_front_that_shade_beside_the_root_leaves_unchecked_is_in_doubt(
    shade_px, alone
):
    """The rod's own direction was unsure by 4.6 degrees, the front off by 1.4."""
    found = measured(rod=(0.1, 0.1, 0.1), turn_deg=20.0, shade_px=shade_px, deep=0.5)
    assert ("direction_doubtful" in found.flags) == alone


@pytest.mark.parametrize("aside", [0.0, 3.0 * WIDTH], ids=["both", "no rod"])
def test_a_rod_wider_than_what_was_told_from_its_shade_is_in_doubt(monkeypatch, aside):
    """It may be rod and shade, or a rod of which a streak left but a rim."""

    def rim(_, candidate, width):
        points = candidate.points_px + np.array([0.0, aside])
        return replace(candidate, points_px=points, width_px=0.5 * width)

    photo = drawn(rod=BLACK, turn_deg=30.0)
    plain = extract(photo, SCALE)
    monkeypatch.setattr("magbend.vision.extraction.best_light.rod_alone", rim)
    found = extract(photo, SCALE)
    assert found.ok, found.reason
    assert found.length_mm == pytest.approx(plain.length_mm, abs=0.05)
    assert "other_rod" in found.flags
    assert "other_rod" not in plain.flags


def test_a_rod_that_is_found_and_not_measured_is_shown(monkeypatch):
    def refuse(*_):
        raise LostError("no_tip", "the free end of the rod shows no edge")

    monkeypatch.setattr("magbend.vision.extraction.extract.measure_candidate", refuse)
    found = extract(drawn(rod=BLACK, turn_deg=30.0), SCALE)
    assert "no_tip" in found.flags
    points, _ = axis(30.0)
    middle = found.seen_px[0][len(found.seen_px[0]) // 2]
    assert np.hypot(*(points - middle).T).min() < 0.5 * WIDTH


@pytest.mark.parametrize("thin", [0.35, 0.2])
def test_a_taper_is_measured_to_its_thin_end(thin):
    found = measured(rod=BLACK, turn_deg=40.0, thin=thin)
    assert not set(found.flags) & {"tip_goes_on", "ragged_tip", "clamp_lines_differ"}
    assert abs(found.length_mm - 20.0) < found.length_sd_mm < 0.2
    points, _ = axis(40.0)
    assert np.abs(signed_distance(found.points_px, points)[2:-2]).max() < 0.3
    width = found.points["width_mm"]
    drawn_mm = np.linspace(1.0, thin, len(width))  # WIDTH is 1 mm
    assert np.nanmax(np.abs(width - drawn_mm)[5:-5]) < 0.1
