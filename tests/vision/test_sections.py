"""Rods of other sections than a square, seen aslant: drawn as hulls of their points."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from magbend.core import Section, Specimen
from magbend.vision import as_photo, extract
from magbend.vision.extraction.extract import measure
from magbend.vision.extraction.setting import Setting, with_specimen
from magbend.vision.synthetic import scene_camera

SIZE, FINE = (1200, 900), 8
CAMERA = scene_camera(
    size_px=SIZE, focal_px=4200.0, height_mm=300.0, tilt_deg=8.0, target_mm=(0.0, 0.0)
)
HEIGHT, LENGTH, WIDTH = 1.0, 25.0, 1.6
ALONG = np.array([np.cos(np.radians(40.0)), np.sin(np.radians(40.0))])
ACROSS = np.array([-ALONG[1], ALONG[0]])
DRAWN = WIDTH + 0.009
"""An eighth of a pixel wider: OpenCV fills the pixels, fine ones, of the edge too."""
TURN = np.linspace(0.0, 2.0 * np.pi, 73)
CIRCLE = 0.5 * np.column_stack([np.cos(TURN), np.sin(TURN)])
FLAT = np.array([[-0.5, -0.2], [0.5, -0.2], [0.5, 0.2], [-0.5, 0.2]])


def outline(ends_mm, section_mm, camera=CAMERA):
    """Return the hull, in the picture, of a section carried from end to end."""
    seen = [
        camera.to_px((s * ALONG + y * ACROSS)[None], height_mm=z)[0]
        for s in ends_mm
        for y, z in section_mm
    ]
    return cv2.convexHull(np.array(seen, np.float32))[:, 0]


def photograph(section):
    rod = outline((-12.5, LENGTH - 12.5), WIDTH * section + [0.0, HEIGHT])
    wall = np.array([[-5.0, 0.0], [5.0, 0.0], [5.0, 3.0], [-5.0, 3.0]])
    return drawn((rod, 0.03), (outline((-19.0, -12.5), wall), 0.12))


def drawn(*things):
    light = np.full(SIZE[::-1], 0.7, np.float32)
    for corners, shade in things:
        mask = np.zeros((SIZE[1] * FINE, SIZE[0] * FINE), np.uint8)
        fixed = np.round(((corners + 0.5) * FINE - 0.5) * 16).astype(np.int32)
        cv2.fillPoly(mask, [fixed.reshape(-1, 1, 2)], 255, shift=4)
        cover = cv2.resize(mask, SIZE, interpolation=cv2.INTER_AREA)
        light += (shade - light) * (cover / np.float32(255.0))
    light = cv2.GaussianBlur(light, (0, 0), 0.8)
    return as_photo(light + np.random.default_rng(1).normal(0.0, 0.004, light.shape))


def rod(**sizes):
    return Specimen(
        name="A", remanence_mT=20.0, sections=(Section(length_mm=LENGTH, E_MPa=1.0),),
        **sizes,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("section", "specimen"),
    [
        (CIRCLE, rod(shape="round", diameter_mm=WIDTH)),
        (CIRCLE, rod(shape="tube", diameter_mm=WIDTH, bore_mm=1.0)),
        (FLAT, rod(shape="rectangle", width_mm=WIDTH, height_mm=0.4 * WIDTH)),
    ],
    ids=["round", "tube", "flat"],
)
def test_width_and_length_are_those_of_the_section(section, specimen):
    photo = photograph(section)
    nobody = Setting(calibration=CAMERA, rod_height_mm=HEIGHT, clamp_height_mm=3.0)
    found = measure(photo, with_specimen(nobody, specimen))
    assert found.width_mm == pytest.approx(DRAWN, abs=0.01)
    assert found.length_mm == pytest.approx(LENGTH, abs=0.03)
    # Where nobody tells the section, it may be any.
    untold = measure(photo, nobody)
    assert 0.03 < abs(untold.width_mm - DRAWN) < untold.width_sd_mm
    assert untold.width_sd_mm > 3.0 * found.width_sd_mm


def test_a_round_rod_ends_where_the_middle_of_its_rim_does():
    """Its end face is seen as half an ellipse, on which the lanes end sooner."""
    photo = photograph(CIRCLE)
    known = Setting(calibration=CAMERA, rod_height_mm=HEIGHT, clamp_height_mm=3.0)
    round_mm, square_mm = (
        measure(photo, replace(known, is_round=is_round)).length_mm
        for is_round in (True, False)
    )
    assert abs(round_mm - LENGTH) < 0.006 < abs(square_mm - LENGTH)


@pytest.mark.parametrize("away_deg", [40.0, 220.0])
def test_the_disc_of_a_chuck_is_no_front_on_the_paper(away_deg):
    """Its rim is neither at the paper nor, beside the rod, at its top."""
    camera = scene_camera(
        size_px=SIZE, focal_px=4200.0, height_mm=300.0, tilt_deg=8.0,
        tilt_direction_deg=away_deg, target_mm=(0.0, 0.0),
    )  # fmt: skip
    height, radius = 3.5, 2.5
    rod = outline((-12.5, LENGTH - 12.5), WIDTH * CIRCLE + [0.0, height], camera)
    disc = outline((-19.0, -12.5), 2.0 * radius * CIRCLE + [0.0, height], camera)
    things = (rod, 0.03), (disc, 0.12)  # What is nearer to the camera comes last.
    found = extract(
        drawn(*(things[::-1] if away_deg < 180.0 else things)), camera, is_round=True,
        rod_height_mm=height, clamp_height_mm=height + radius,
    )  # fmt: skip
    off = abs(found.length_mm - LENGTH)
    assert 0.02 < off < 2.0 * found.length_sd_mm
