"""A clamp that the light which shows the rod does not show: as light as paper, say."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from magbend.vision import as_photo, extract
from magbend.vision.edge.clamp import ClampLines
from magbend.vision.edge.state import LostError
from magbend.vision.extraction.beyond_ends import check_ends
from magbend.vision.find.candidate import Candidate
from magbend.vision.find.choose import find_rod
from magbend.vision.find.held import held, seen_behind
from magbend.vision.find.sought import Sought

PAPER, WHITE, BLACK = (0.35, 0.35, 0.35), (0.75, 0.75, 0.75), (0.03, 0.03, 0.03)
BLUE, PALE = (0.6, 0.3, 0.15), (0.7, 0.65, 0.75)
WIDTH, ROOT = 20, np.array([150.0, 160.0])


def axis_of(length=420.0):
    """Return a rod's axis, from its root on: to the right, and bent downwards."""
    theta = np.radians(50.0) * np.linspace(0.0, 1.0, 400)
    steps = length / 400.0 * np.column_stack([np.cos(theta), np.sin(theta)])
    return ROOT + np.cumsum(steps, axis=0)


def scene(*, rod, clamp=None, tip_clamp=None, shade=1.0, shade_px=0, dim=(), seed=3):
    """Return a photograph of a rod: what holds it, the clamp's shade, and others."""
    light = np.empty((500, 800, 3), np.float32)
    light[:] = PAPER
    axis = axis_of()
    fixed = np.rint(16.0 * axis).astype(np.int32).reshape(-1, 1, 2)
    fixed = np.vstack([fixed[:1] - [[16 * 30, 0]], fixed])
    cv2.polylines(light, [fixed], False, rod, WIDTH, cv2.LINE_AA, 4)
    ahead = axis[-1] - axis[-2]
    ahead /= np.hypot(*ahead)
    aside = np.array([-ahead[1], ahead[0]])
    body = axis[-1] + 90.0 * np.array([-aside, aside, aside + ahead, ahead - aside])
    beyond = PAPER if tip_clamp is None else tip_clamp  # and a square end
    cv2.fillPoly(light, [np.rint(16.0 * body).astype(np.int32)], beyond, cv2.LINE_AA, 4)
    edge = int(ROOT[0])
    if clamp is None:
        light[:, :edge] = PAPER
    if shade_px:
        light[:, : edge + shade_px] *= shade
    if clamp is not None:
        light[80:240, 40:edge] = clamp
    for left, top, right, bottom in dim:
        light[top:bottom, left:right] *= 0.7
    light = cv2.GaussianBlur(light, (0, 0), 1.0)
    light += np.random.default_rng(seed).normal(0.0, 0.003, light.shape)
    code = 255.0 * (1.055 * np.clip(light, 0.004, 1.0) ** (1 / 2.4) - 0.055)
    return as_photo(np.rint(code).astype(np.uint8)), axis


def part(axis, *, without=0.0):
    """Return what was found of a rod, but for so many px at its root."""
    points = axis[int(without / 420.0 * len(axis)) : -10]
    return Candidate(
        points_px=points[::4], width_px=WIDTH, length_px=400.0 - without, root="free",
        contacts=0, ratio=0.1,
    )  # fmt: skip


@pytest.mark.parametrize("without", [0.0, 80.0], ids=["whole", "part"])
@pytest.mark.parametrize(
    ("rod", "clamp"),
    [(BLACK, WHITE), (WHITE, BLACK), (WHITE, WHITE), (BLACK, BLUE), (PALE, BLUE)],
    ids=["light", "dark", "like-the-rod", "blue", "light-rod"],
)
def test_a_rod_is_held_where_what_lies_beside_it_changes(rod, clamp, without):
    photo, axis = scene(rod=rod, clamp=clamp, shade=0.4, shade_px=60)
    for found in (part(axis, without=without), part(axis[::-1])):
        if found.points_px[0] @ [1.0, 0.0] > 300.0 and without:
            continue  # what lacks its root is looked at from there
        whole = held(photo, found)
        assert whole.root == "clamp"
        assert whole.from_front
        assert np.hypot(*(whole.points_px[0] - ROOT)) < 0.2 * WIDTH
        aside = [np.hypot(*(axis - point).T).min() for point in whole.points_px]
        assert max(aside) < 0.2 * WIDTH


def test_a_clamp_nearly_of_the_papers_colour_holds_a_rod():
    nearly = tuple(
        level * share for level, share in zip(PAPER, (1.15, 1.0, 0.86), strict=True)
    )
    photo, axis = scene(rod=BLACK, clamp=nearly)
    whole = held(photo, part(axis))
    assert np.hypot(*(whole.points_px[0] - ROOT)) < 0.2 * WIDTH
    found = extract(photo, None)
    assert found.ok
    assert np.hypot(*(np.array(found.clamp_px) - ROOT)) < 0.1 * WIDTH


def test_a_grey_picture_tells_as_well():
    photo, axis = scene(rod=BLACK, clamp=WHITE)
    found = held(as_photo(np.asarray(photo.decode())[..., 1].copy()), part(axis))
    assert np.hypot(*(found.points_px[0] - ROOT)) < 0.2 * WIDTH


@pytest.mark.parametrize("shade_px", [0, 80], ids=["bare", "shade"])
def test_a_rod_that_floats_is_held_nowhere(shade_px):
    photo, axis = scene(rod=BLACK, shade=0.5, shade_px=shade_px)
    assert held(photo, part(axis)) is None
    if not shade_px:
        assert extract(photo, None).flags == ("no_clamp",)


def test_what_lies_between_two_bodies_is_held_at_neither():
    photo, axis = scene(rod=BLACK, clamp=WHITE, tip_clamp=WHITE)
    assert held(photo, part(axis)) is None


@pytest.mark.parametrize(("share", "doubted"), [(0.4, True), (0.1, False)])
def test_what_may_be_a_shade_is_held_in_doubt(share, doubted):
    photo, axis = scene(rod=tuple(share * level for level in PAPER), clamp=WHITE)
    assert held(photo, part(axis)).rivalled is doubted


def test_a_rod_in_a_clamp_like_the_paper_is_found_beside_a_cable():
    """What leads through the picture is no rod, as dark and long as it may be."""
    photo, axis = scene(rod=BLACK, clamp=tuple(0.88 * level for level in PAPER))
    light = photo.colour().copy()
    cv2.line(light, (-20, 420), (900, 330), (0.02, 0.02, 0.02), 34, cv2.LINE_AA)
    code = 255.0 * (1.055 * np.clip(light, 0.004, 1.0) ** (1 / 2.4) - 0.055)
    found = extract(as_photo(np.rint(code).astype(np.uint8)), None)
    assert found.ok, found.reason
    assert "other_rod" in found.flags
    points = np.column_stack([found.points["x_px"], found.points["y_px"]])
    assert max(np.hypot(*(axis - point).T).min() for point in points[5:-5]) < 1.0


def test_what_touches_a_body_at_one_end_is_not_held_at_the_other():
    photo, axis = scene(rod=BLACK, clamp=WHITE)
    whole = held(photo, part(axis))
    assert whole.is_held_as(part(axis))
    assert not whole.is_held_as(part(axis[::-1]))


@pytest.mark.parametrize(
    ("rod", "clamp"), [(BLACK, WHITE), (WHITE, BLACK)], ids=["light", "dark"]
)
def test_a_rod_is_measured_from_a_clamp_on_the_other_side_of_the_paper(rod, clamp):
    photo, axis = scene(rod=rod, clamp=clamp)
    result = extract(photo, None)
    assert result.ok
    assert result.points["x_px"][0] == pytest.approx(ROOT[0] - 0.5, abs=0.5)
    points = np.column_stack([result.points["x_px"], result.points["y_px"]])
    aside = [np.hypot(*(axis - point).T).min() for point in points[5:-5]]
    assert max(aside) < 1.0


@pytest.mark.parametrize(("bar", "seen"), [(BLUE, True), (None, False)])
def test_a_rod_is_seen_behind_what_lies_across_it_and_not_within_its_clamp(bar, seen):
    photo, axis = scene(rod=BLACK, clamp=WHITE)
    if bar is not None:
        light = photo.colour().copy()
        light[:, 280:310] = bar
        photo = as_photo(light)
        axis = axis[axis[:, 0] > 310.0]
    assert seen_behind(photo, axis[::4], WIDTH) is seen
    yarn = SimpleNamespace(
        rough=True, clamp=ClampLines(face=None, front=None), typical_width=WIDTH,
        fit=SimpleNamespace(curve=SimpleNamespace(points=axis[::4])),
    )  # fmt: skip
    refused = (
        pytest.raises(LostError, match="goes on behind") if seen else nullcontext()
    )
    with refused:
        check_ends(photo, None, None, yarn, root="clamp")


def test_a_rod_is_not_forgotten_for_what_only_pale_levels_show():
    """Two shades with a thin edge each are seen where the rod's own joins it."""
    shades = [(600, 20, 660, 80), (660, 46, 760, 52)]
    shades += [
        (left, top + 400, right, bottom + 400) for left, top, right, bottom in shades
    ]
    photo, axis = scene(rod=BLACK, clamp=WHITE, dim=[(175, 90, 580, 450), *shades])
    rod, _ = find_rod(photo, Sought())
    assert rod.from_front
    assert rod.away(axis[200]) < 3.0


def test_what_is_dark_behind_a_root_in_one_light_alone_is_no_doubt(monkeypatch):
    """A chuck's flank may be as wide and as dark as the rod, not of its colours."""
    photo, _ = scene(rod=BLACK, clamp=WHITE)
    before = extract(photo, None)
    monkeypatch.setattr(
        "magbend.vision.extraction.beyond_ends._goes_on_behind", lambda _strip: True
    )
    assert extract(photo, None).flags == before.flags
