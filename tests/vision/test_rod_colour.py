"""The colour that a specimen states: it chooses the rod, and doubts what is not it."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from magbend.core import Section, Specimen
from magbend.core.errors import InputError
from magbend.vision import as_photo, extract, read_photo
from magbend.vision.camera.calibrate import calibrate_known_length
from magbend.vision.extraction.setting import Setting, with_specimen

SCALE = calibrate_known_length(
    (800, 500), from_px=(0.0, 0.0), to_px=(400.0, 0.0), length_mm=20.0
)
TAN, BLUE, BLACK = "#c8af8c", "#233c96", "#232326"


def photograph(rods, *, lamp=(1.0, 1.0, 1.0), shade=None, grey=False):
    """Return clamped rods of given colours, one below the other, 300 px long.

    `lamp` are red, green and blue of the light; `shade` is how much of it is left right
    below the last rod.
    """
    light = np.full((500, 800, 3), 0.7)
    for k, colour in enumerate(rods):
        y = 120 + 200 * k
        cv2.rectangle(light, (60, y - 70), (200, y + 70), (0.12,) * 3, -1)
        if shade is not None:
            cv2.rectangle(light, (201, y + 11), (500, y + 24), (0.7 * shade,) * 3, -1)
        code = np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)]) / 255.0
        linear = np.where(
            code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4
        )
        cv2.rectangle(light, (201, y - 10), (500, y + 10), (0.7 * linear).tolist(), -1)
    light = cv2.GaussianBlur(light * lamp, (0, 0), 1.0)
    light += np.random.default_rng(3).normal(0.0, 0.004, light.shape)
    pixels = 255.0 * (1.055 * np.clip(light, 0.004, 1.0) ** (1 / 2.4) - 0.055)
    pixels = np.rint(pixels).astype(np.uint8)
    if grey:
        return as_photo(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY))
    return as_photo(np.ascontiguousarray(pixels[..., ::-1]))


@pytest.mark.parametrize(("colour", "y"), [(BLACK, 120.0), (BLUE, 320.0)])
def test_it_tells_which_of_two_rods_is_meant(colour, y):
    both = photograph([BLACK, BLUE])
    assert extract(both, SCALE, rod_height_mm=0.0).flags == ("two_rods",)
    found = extract(both, SCALE, rod_height_mm=0.0, colour=colour)
    assert found.ok, found.reason
    assert found.clamp_px[1] == pytest.approx(y, abs=0.1)
    assert "colour_mismatch" not in found.flags


@pytest.mark.parametrize("lamp", [(1.0, 1.0, 1.0), (1.0, 0.85, 0.6), (0.6, 0.6, 0.6)])
@pytest.mark.parametrize("colour", [TAN, BLUE, BLACK])
def test_a_rod_keeps_its_colour_in_any_light(colour, lamp):
    photo = photograph([colour], lamp=lamp)
    for told in (TAN, BLUE, BLACK):
        found = extract(photo, SCALE, rod_height_mm=0.0, colour=told)
        assert ("colour_mismatch" in found.flags) == (told != colour)


def test_a_shade_that_is_measured_for_the_rod_is_in_doubt():
    photo = photograph([TAN], shade=0.3)
    found = extract(photo, SCALE, rod_height_mm=0.0, colour=TAN)
    right = abs(found.clamp_px[1] - 120.0) < 0.5 and abs(found.width_mm - 1.05) < 0.1
    assert right or "colour_mismatch" in found.flags


def test_of_a_grey_photograph_only_the_lightness_tells():
    grey = photograph([BLACK], grey=True)
    told = {
        colour: extract(grey, SCALE, rod_height_mm=0.0, colour=colour).flags
        for colour in (BLACK, TAN)
    }
    assert "colour_mismatch" not in told[BLACK]
    assert "colour_mismatch" in told[TAN]


def test_a_grey_file_has_no_colour_that_could_be_wrong(tmp_path):
    file = tmp_path / "grey.png"
    cv2.imwrite(str(file), (255.0 * photograph([BLUE]).grey ** (1 / 2.4)).astype("u1"))
    found = extract(read_photo(file), SCALE, rod_height_mm=0.0, colour=BLUE)
    assert found.ok, found.reason
    assert "colour_mismatch" not in found.flags


def test_a_refusal_does_not_ask_for_what_was_told():
    found = extract(photograph([BLUE, BLUE]), SCALE, rod_height_mm=0.0, colour=BLUE)
    assert found.flags == ("two_rods",)
    assert "--specimen" not in found.reason
    assert "(its colour) does not tell" in found.reason


def test_a_specimen_tells_its_colour_to_the_setting():
    rod = Specimen(
        name="tan", side_mm=1.0, remanence_mT=20.0, colour=TAN,
        sections=(Section(length_mm=15.0, E_MPa=1.0),),
    )  # fmt: skip
    assert with_specimen(Setting(), rod).colour == TAN
    assert with_specimen(Setting(colour=BLUE), rod).colour == BLUE
    with pytest.raises(InputError, match="#c8af8c; instead received 'tan'"):
        replace(rod, colour="tan")
