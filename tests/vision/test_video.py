"""Films are read in colour where they have any, and else as the light they hold."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from magbend.vision.picture.video import Video

SIZE = 64, 48
GREY = np.tile(np.arange(20, 212, 3, dtype=np.uint8), (48, 1))


def film(path, code, *, tint=0):
    writer = cv2.VideoWriter(
        str(path), cv2.VideoWriter_fourcc(*code), 25.0, SIZE, isColor=tint > 0
    )
    for k in range(4):
        picture = GREY + np.uint8(8 * k)
        if tint:
            picture = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
            picture[:24, :32, 2] -= np.uint8(tint)
        writer.write(picture)
    writer.release()
    return path


@pytest.mark.parametrize(("name", "code"), [("a.avi", "MJPG"), ("a.mp4", "mp4v")])
@pytest.mark.parametrize("frame", [0, 2])
def test_a_film_without_colour_is_read_as_grey_and_as_light_as_in_colour(
    tmp_path, name, code, frame, capfd
):
    """Both ranges of luma: MJPEG's is full, that of MPEG-4 goes from 16 to 235."""
    path = film(tmp_path / name, code)
    video, whole = Video(path), cv2.VideoCapture(str(path))
    whole.set(cv2.CAP_PROP_POS_FRAMES, frame)
    pixels = video.read(frame)
    assert (video.fps, video.count) == (25.0, 4)
    assert pixels.shape == SIZE[::-1]
    in_colour = cv2.cvtColor(whole.read()[1], cv2.COLOR_BGR2GRAY)
    assert cv2.absdiff(pixels, in_colour).max() <= 1
    assert len(list(video.frames())) == 3 - frame
    assert video.read(9) is None
    assert "WARN" not in capfd.readouterr().err


def test_a_film_keeps_its_colours(tmp_path):
    pixels = Video(film(tmp_path / "a.avi", "MJPG", tint=15)).read(1)
    assert pixels.shape == (*SIZE[::-1], 3)
    assert np.ptp(pixels[:20, :24].astype(int), axis=2).mean() > 8.0
