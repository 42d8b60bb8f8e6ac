"""Of two measurements of one photograph, the one that there is less against."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from magbend.vision.extraction.believed import better, is_elsewhere
from magbend.vision.find.candidate import Candidate
from magbend.vision.measurement import Measurement

SMOOTH, ROUGH = ("shadow",), ("shadow", "rough_edges", "direction_doubtful")


def line(length_px, flags):
    """Return what was measured of a rod, 20 px wide, along one line."""
    x = np.linspace(100.0, 100.0 + length_px, 50)
    return Measurement(
        status="ok", flags=flags,
        points={
            "x_px": x, "y_px": np.full(50, 80.0),
            "right_x_px": x, "right_y_px": np.full(50, 90.0),
        },
        length_px=length_px, width_px=20.0,
    )  # fmt: skip


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(
    ("longer_px", "flags"), [(1.0, SMOOTH), (40.0, ROUGH)], ids=["ends", "end missed"]
)
def test_a_rod_with_less_doubt_is_believed_unless_an_end_of_it_is_missed(
    longer_px, flags, swapped
):
    both = line(400.0, SMOOTH), line(400.0 + longer_px, ROUGH)
    assert better(*both[:: -1 if swapped else 1]).flags == flags


@pytest.mark.parametrize("beside", [True, False])
def test_of_two_things_of_which_one_has_the_other_beside_it_either_may_be_the_rod(
    beside,
):
    """One level shows one wall of a tube best, and all together the other."""
    quick = line(400.0, ("other_rod",) if beside else ())
    points = quick.points | {"y_px": np.full(50, 130.0)}
    whole = replace(line(390.0, SMOOTH), points=points)
    assert ("other_rod" in better(quick, whole).flags) is beside


@pytest.mark.parametrize(
    ("behind", "held_y", "held"),
    [(20.0, 80.0, False), (45.0, 80.0, True), (20.0, 300.0, True)],
    ids=["rod goes on behind", "bar behind", "another rod"],
)
def test_a_clamp_is_not_where_a_rod_from_the_border_leads_through(behind, held_y, held):
    whole = line(600.0, ("clamp_at_border",))
    x = whole.points["x_px"]
    whole.points["width_px"] = np.where(x < 400.0, behind, 20.0)
    part = replace(line(300.0, ROUGH), clamp_px=(400.0, held_y))
    part.points["x_px"] += 300.0
    part.points["y_px"][:] = held_y
    assert (better(whole, part) is part) == held


@pytest.mark.parametrize(("held_px", "held"), [(120.0, False), (900.0, True)])
def test_a_scrap_in_a_doubtful_clamp_is_no_rod_beside_one_from_the_border(
    held_px, held
):
    rod = line(600.0, ("clamp_at_border",))
    rod.points["width_px"] = np.full(50, 20.0)
    scrap = line(held_px, ("clamp_doubtful",))
    scrap.points["y_px"][:] = 300.0
    scrap = replace(scrap, clamp_px=(100.0, 300.0), tip_px=(100.0 + held_px, 300.0))
    assert (better(rod, scrap) is scrap) == held


@pytest.mark.parametrize(
    ("y", "width", "elsewhere"),
    [(80.0, 9.0, False), (85.5, 9.0, True), (85.0, 20.0, False), (92.0, 40.0, True)],
    ids=["dim flanks", "shade at one side", "hardly aside", "side lost"],
)
def test_sides_that_reach_out_alike_beyond_a_rods_colour_are_its_own(
    y, width, elsewhere
):
    x = np.linspace(100.0, 500.0, 40)
    points = np.column_stack([x, np.full(40, y)])
    rod = Candidate(
        points_px=points, width_px=width, length_px=400.0, root="clamp", contacts=1,
        ratio=0.5,
    )  # fmt: skip
    assert is_elsewhere(line(400.0, SMOOTH), rod) is elsewhere
