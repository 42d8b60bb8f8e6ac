"""Vibrations: the numbers that made a path come out of it, and films are followed."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from magbend.core.errors import VisionError
from magbend.vision import Setting, extract_files, ring_down, ring_of_film
from magbend.vision.batch import run as batch_run
from magbend.vision.batch.tables import read_frames
from magbend.vision.synthetic import CLEAN, curve, draw, scene_camera

SIZE, SCALE = (480, 320), 8.0


def path(frequency, ratio, *, rate=120.0, seconds=2.0, noise=0.0, before=0.2):
    t = np.arange(round(rate * seconds)) / rate
    omega = 2.0 * np.pi * frequency
    after = np.maximum(t - before, 0.0)
    decay = ratio * omega / np.sqrt(1.0 - ratio**2)
    swing = 3.0 * np.exp(-decay * after) * np.cos(omega * after)
    rng = np.random.default_rng(3)
    tip = np.column_stack([20.0 - 0.5 * swing, 4.0 + 0.8 * swing])
    return t, tip + noise * rng.standard_normal(tip.shape)


@pytest.mark.parametrize(
    ("frequency", "ratio"), [(6.0, 0.01), (17.3, 0.08), (3.0, 0.3)]
)
def test_a_vibration_is_found_within_its_deviations(frequency, ratio):
    t, tip = path(frequency, ratio, noise=0.02)
    found = ring_down(t, tip, settle_mm=0.1)
    assert abs(found.frequency_Hz - frequency) < 4.0 * found.frequency_sd_Hz
    assert abs(found.damping_ratio - ratio) < 4.0 * found.damping_ratio_sd
    assert found.frequency_sd_Hz < 0.05 * frequency
    # From the first frame on in which it is surely let go: half way to its rest.
    assert 0.2 < found.first_s < 0.2 + 0.25 / frequency + 1.0 / 120.0
    decay = ratio * 2.0 * np.pi * frequency / np.sqrt(1.0 - ratio**2)
    settle = np.log(found.amplitude_mm / 0.1) / decay
    assert found.settle_s == pytest.approx(settle, rel=0.1)
    assert abs(found.settle_s - settle) < 4.0 * found.settle_sd_s
    assert found.settle_sd_s < 0.1 * settle


@pytest.mark.parametrize("bent", [False, True])
def test_deviations_hold_from_the_release_on_and_for_large_swings(bent):
    z = []
    for seed in range(24):
        rng = np.random.default_rng([5, seed])
        frequency, ratio = rng.uniform(3.0, 12.0), np.exp(rng.uniform(-5.0, -2.3))
        t, tip = path(frequency, ratio, seconds=1.2, before=rng.uniform(0.05, 0.2))
        if bent:  # the tip of an arc that swings by 24 degrees
            turn = 0.5 + 0.14 * (tip[:, 1] - 4.0) / 0.8
            tip = 30.0 * np.column_stack([np.sin(turn), 1.0 - np.cos(turn)])
            tip /= turn[:, None]
        found = ring_down(t, tip + 0.003 * rng.standard_normal(tip.shape))
        z.append((
            (found.frequency_Hz - frequency) / found.frequency_sd_Hz,
            (found.damping_ratio - ratio) / found.damping_ratio_sd,
        ))  # fmt: skip
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    assert np.all((rms > 0.7) & (rms < 1.35)), rms


def test_frames_that_were_not_measured_are_left_out():
    t, tip = path(6.0, 0.02)
    tip[::7] = np.nan
    assert ring_down(t, tip).frequency_Hz == pytest.approx(6.0, abs=0.01)


def test_a_tip_at_rest_does_not_ring():
    t, tip = path(6.0, 0.02)
    rest = tip[:1] + 0.01 * np.random.default_rng(0).standard_normal(tip.shape)
    with pytest.raises(VisionError, match="does not ring"):
        ring_down(t, rest)
    with pytest.raises(VisionError, match="needs 12 measured frames"):
        ring_down(t, np.full_like(tip, np.nan))


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """Return a film of an arc that swings at 5 Hz, 60 frames/s, and its setting."""
    path = tmp_path_factory.mktemp("film") / "swing.avi"
    writer = cv2.VideoWriter(
        str(path), cv2.VideoWriter_fourcc(*"MJPG"), 60.0, SIZE, isColor=False
    )
    truth = None
    for k in range(40):
        bend = 30.0 + 12.0 * np.exp(-k / 40.0) * np.cos(2.0 * np.pi * 5.0 * k / 60.0)
        frame = draw(
            curve("arc", angle_deg=bend), np.random.default_rng(k), px_per_mm=SCALE,
            size_px=SIZE, light=CLEAN, clamp_px=(100.0, 240.0), angle_deg=0.0,
        )  # fmt: skip
        truth = frame.truth
        writer.write(frame.image)
    writer.release()
    return path, Setting(calibration=truth.calibration)


def test_the_swing_of_a_film_is_measured(film):
    path, setting = film
    found = ring_of_film(path, setting)
    assert found.frequency_Hz == pytest.approx(5.0, abs=0.05)
    assert found.damping_ratio == pytest.approx(1.5 / (2.0 * np.pi * 5.0), rel=0.1)
    slow = ring_of_film(path, setting, fps=240.0)
    assert slow.frequency_Hz == pytest.approx(20.0, abs=0.2)
    other = Setting(calibration=scene_camera())
    with pytest.raises(VisionError, match=r"no frame could be measured.*1600"):
        ring_of_film(path, other)
    with pytest.raises(VisionError, match="no such file"):
        ring_of_film(path.with_name("none.avi"), setting)


def test_frames_of_a_film_are_followed_and_none_is_lost(film, tmp_path, monkeypatch):
    path, setting = film
    priors = []
    follow = batch_run.follow

    def watched(photo, setting, last):
        priors.append(last is not None)
        return follow(photo, setting, last)

    monkeypatch.setattr(batch_run, "follow", watched)
    extract_files([path], tmp_path, setting=setting, overlays=False, workers=2)
    rows = read_frames(tmp_path / "frames.csv")
    assert len(rows) == 40
    assert all(row.ok for row in rows)
    assert priors == [False] + 39 * [True]
