"""Gates that need more than a picture of one failure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from magbend.vision import as_photo
from magbend.vision.binarise import binarise
from magbend.vision.curve import Curve
from magbend.vision.quality import _goes_on
from magbend.vision.refine import refine
from magbend.vision.rod import find_candidates
from magbend.vision.synthetic import curve, draw
from magbend.vision.track import start_curve


def test_root_put_short_of_the_clamp_is_doubted():
    frame = draw(
        curve("arc", angle_deg=70.0), np.random.default_rng(0), size_px=(1200, 1000)
    )
    photo = as_photo(frame.image)
    binary = binarise(photo.grey)
    assert binary is not None
    rod = find_candidates(binary)[0]
    start = start_curve(
        photo.grey, rod.points_px, rod.width_px, sign=1.0, follow=True
    )  # fmt: skip
    assert start is not None
    refined = refine(photo.grey, start, root=rod.root, sign=1.0)
    assert not _goes_on(photo, refined)
    whole = refined.fit.curve
    short = Curve(
        s=whole.s[60:] - whole.s[60], points=whole.points[60:],
        theta=whole.theta[60:], kappa=whole.kappa[60:],
    )  # fmt: skip
    assert _goes_on(photo, replace(refined, fit=replace(refined.fit, curve=short)))
