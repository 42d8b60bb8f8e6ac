"""Ours against what everybody uses: thresholding and scikit-image's skeletonize."""

from __future__ import annotations

import numpy as np
import pytest
from skimage.measure import label
from skimage.morphology import skeletonize

from magbend.vision import as_photo, extract, score
from magbend.vision.synthetic.scoring import signed_distance
from magbend.vision.synthetic.square_view import STANDARD, curve, draw


@pytest.mark.parametrize(("kind", "angle"), [("arc", 90.0), ("graded", -60.0)])
def test_ten_times_closer_than_a_skeleton_and_to_the_very_tip(kind, angle):
    frame = draw(
        curve(kind, angle_deg=angle), np.random.default_rng(2), light=STANDARD,
        size_px=(1200, 1000),
    )  # fmt: skip
    photo = as_photo(frame.image)
    ours = score(extract(photo, None), frame.truth)

    dark = photo.grey < 0.35
    labels = label(dark)
    x, y = np.round(frame.truth.points_px[600]).astype(int)
    skeleton = np.argwhere(skeletonize(labels == labels[y, x]))[:, ::-1].astype(float)
    truth = frame.truth.points_px
    near = np.array([np.argmin(np.sum((truth - p) ** 2, axis=1)) for p in skeleton])
    inner = skeleton[(near > 60) & (near < len(truth) - 60)]
    theirs = np.sqrt(np.mean(signed_distance(inner, truth) ** 2))
    end = np.hypot(*(skeleton - truth[-1]).T).min()

    assert ours.rms_px < theirs / 10.0
    assert np.hypot(ours.tip_along_px, ours.tip_across_px) < end / 10.0
