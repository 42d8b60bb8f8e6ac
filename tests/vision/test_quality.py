"""Gates that need more than a picture of one failure."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from magbend.vision import as_photo, extract
from magbend.vision.camera.calibration import scale_calibration
from magbend.vision.curve.curve import Curve
from magbend.vision.edge.clamp import ClampLines
from magbend.vision.edge.crossings import EndFace
from magbend.vision.extraction.quality import (
    DARKEST,
    _front_in_shade,
    _goes_on,
    doubts,
)
from magbend.vision.extraction.refine import refine
from magbend.vision.extraction.setting import Setting
from magbend.vision.extraction.strip import along_rod
from magbend.vision.find.binarise import binarise
from magbend.vision.find.ground import View
from magbend.vision.find.rod import find_candidates
from magbend.vision.find.track import start_curve
from magbend.vision.synthetic.square_view import STANDARD, curve, draw


def measured(seed=0):
    frame = draw(
        curve("arc", angle_deg=70.0), np.random.default_rng(seed), size_px=(1200, 1000)
    )
    photo = as_photo(frame.image)
    binary = binarise(photo.grey)
    assert binary is not None
    rod = find_candidates(binary)[0]
    start = start_curve(
        photo.grey, rod.points_px, rod.width_px, sign=1.0, follow=True
    )  # fmt: skip
    assert start is not None
    return photo, rod, refine(photo.grey, start, root=rod.root, sign=1.0)


def test_root_put_short_of_the_clamp_is_doubted():
    photo, _, refined = measured()
    view = View(grey=photo.grey, sign=1.0)
    assert not _goes_on(along_rod(view, refined), refined, 0.0, DARKEST)
    whole = refined.fit.curve
    short = Curve(
        s=whole.s[60:] - whole.s[60], points=whole.points[60:],
        theta=whole.theta[60:], kappa=whole.kappa[60:],
    )  # fmt: skip
    refined = replace(refined, fit=replace(refined.fit, curve=short))
    assert _goes_on(along_rod(view, refined), refined, 0.0, DARKEST)


def test_direction_that_leaves_the_tip_unsure_is_doubted():
    photo, rod, refined = measured()
    setting = Setting()
    found = replace(extract(photo, None), length_mm=30.0)

    def flags(sd_deg):
        line = replace(found, clamp_angle_sd_deg=sd_deg)
        return doubts(line, photo, set(), refined, rod, setting).flags

    assert "direction_doubtful" not in flags(0.2)  # 0.10 mm at the tip
    assert "direction_doubtful" in flags(0.3)  # 0.16 mm


@pytest.mark.parametrize(
    ("camera_height_mm", "rod_height_mm", "doubtful"),
    [(None, 0.0, False), (None, 0.9, True), (330.0, 6.0, False), (45.0, 2.0, True)],
)
def test_height_that_cannot_be_corrected_is_doubted(
    camera_height_mm, rod_height_mm, doubtful
):
    frame = draw(curve("arc", angle_deg=70.0), np.random.default_rng(0))
    photo = as_photo(frame.image)
    camera = scale_calibration(
        mm_per_px=0.05, image_size_px=photo.size_px, camera_height_mm=camera_height_mm
    )
    found = extract(photo, camera, rod_height_mm=rod_height_mm)
    assert found.ok
    assert ("height_doubtful" in found.flags) is doubtful


@pytest.mark.parametrize("short_of_tip", [0.5, 0.2])
def test_rod_under_a_piece_of_paper_is_not_taken_for_whole(short_of_tip):
    """What lies over the rod ends it; the rest of it beyond is a doubt."""
    frame = draw(
        curve("arc", angle_deg=30.0), np.random.default_rng(2), size_px=(1200, 1000)
    )
    plain = extract(as_photo(frame.image), None)
    assert plain.ok
    assert "other_rod" not in plain.flags
    x, y = plain.points["x_px"], plain.points["y_px"]
    at = round((1.0 - short_of_tip) * (len(x) - 1))
    image = frame.image.copy()
    centre = (round(float(x[at])), round(float(y[at])))
    cv2.circle(image, centre, 40, float(np.median(image)), cv2.FILLED)
    covered = extract(as_photo(image), None)
    assert covered.length_px < plain.length_px - 20.0
    assert "other_rod" in covered.flags


@pytest.mark.parametrize("blur_px", [5.0, 6.0])
def test_rod_far_out_of_focus_is_as_wide_as_in_focus(blur_px):
    """Taken for sharp at first, its edges must not be measured at the core alone."""
    frame = draw(
        curve("arc", angle_deg=60.0), np.random.default_rng(4), size_px=(1200, 1000),
        light=replace(STANDARD, blur_px=blur_px),
    )  # fmt: skip
    found = extract(as_photo(frame.image), None)
    assert found.width_px == pytest.approx(20.0, rel=0.1)
    assert found.blur_px == pytest.approx(blur_px, rel=0.2)
    assert "blurred" in found.flags


@pytest.mark.parametrize("rise", [0.0, 0.4])
def test_a_front_that_no_step_fits_is_doubted(rise):
    """One was 3 px off, and the direction with it by 2.6 degrees, without a doubt."""
    front = EndFace(s=0.0, sigma=1.8, skew=0.0, scatter=1.5, found=0.8, rise=rise)
    refined = SimpleNamespace(
        clamp=ClampLines(face=None, front=front), typical_width=30.0, blur=1.0,
        tip=SimpleNamespace(blur=1.0),
    )  # fmt: skip
    assert _front_in_shade(refined, 0.0) == (rise == 0.0)
