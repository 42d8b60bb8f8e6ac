"""Of the lines at a clamp those count that lie where the rod's sides end."""

from __future__ import annotations

import pytest

from magbend.vision.edge.clamp import ClampLines
from magbend.vision.edge.clamp_lines import nearest
from magbend.vision.edge.crossings import EndFace


def line(s, sigma=0.05, rise=0.3, bulge=0.0):
    return EndFace(s, sigma, 0.0, 0.05, 1.0, rise, 1.0, bulge=bulge)


def lines(face=None, front=None, end=None):
    return ClampLines(face=face, front=front, end=end)


@pytest.mark.parametrize("clear", [0.02, 0.2])
def test_a_clear_line_far_from_the_end_is_of_something_else(clear):
    """A shade's border is often clearer than the clamp's front in its shade."""
    shade, front = line(-9.0, clear), line(0.5, 0.3)
    found = nearest(lines(shade), lines(front), 0.0, 0.0, fine=True)
    assert found.face is front
    unknown = nearest(lines(shade), lines(front), None, 0.0, fine=True)
    assert unknown.face is shade


def test_a_front_may_lie_ahead_of_the_end_by_as_much_as_its_foot_does():
    top, foot, far = line(0.0), line(12.0, 0.1), line(20.0, 0.05)
    found = nearest(lines(top, far), lines(top, foot), 0.0, 13.0, fine=True)
    assert (found.face, found.front) == (top, foot)


def test_what_ends_behind_a_straight_front_is_no_rod_but_behind_a_round_one():
    face, front = line(-20.0), line(0.0)
    assert nearest(lines(None, front), lines(face), None, 0.0, fine=True).face is None
    chuck = line(0.0, bulge=8.0)
    assert nearest(lines(None, chuck), lines(face), None, 0.0, fine=True).face is face


def test_a_face_as_dark_as_the_rod_lies_ahead_of_where_its_sides_seem_to_end():
    """A light one has a line as far ahead; but there the sides go on."""
    face, front = line(0.0), line(15.0)
    for end, dark in ((None, True), (14.0, True), (1.0, False)):
        assert lines(face, front, end).is_dark_face(15.0, 30.0) is dark
    assert not lines(face, front).is_dark_face(15.0, 5.0)
    assert lines(face, front, 14.0).shifted(3.0).is_dark_face(15.0, 30.0)
