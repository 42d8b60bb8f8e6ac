"""E from a rod that rings, beside E of a fit: factors, deviations, and a film."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from magbend.analysis import apart, fit_factor, ring_factor
from magbend.cli.main import app
from magbend.core import Section, Specimen
from magbend.core.errors import ConfigError, InputError
from magbend.sim import first_mode
from magbend.vision import write_calibration
from magbend.vision.synthetic import CLEAN, curve, draw

ROD = Specimen(
    name="rod", side_mm=1.0, remanence_mT=20.0, density_kg_m3=2640.0,
    density_sd_kg_m3=26.4, side_sd_mm=0.01, length_sd_mm=0.06,
    sections=tuple(Section(length_mm=10.0, E_MPa=E) for E in (6.0, 4.5, 3.0)),
)  # fmt: skip


def fit_file(path, factors, sd=0.03):
    E = [factor * s.E_MPa for factor, s in zip(factors, ROD.sections, strict=True)]
    data = {
        "E_MPa": E, "E_sd_MPa": [sd * value for value in E],
        "correlation": np.eye(3).tolist(),
    }  # fmt: skip
    path.write_text(json.dumps(data))
    return path


def test_a_rod_that_is_stiffer_by_a_fifth_is_found_so():
    stiffer = tuple(replace(s, E_MPa=1.2 * s.E_MPa) for s in ROD.sections)
    true = first_mode(replace(ROD, sections=stiffer)).frequency_Hz
    damped = true * math.sqrt(1.0 - 0.1**2)
    found = ring_factor(ROD, damped, frequency_sd_Hz=0.01 * damped, damping_ratio=0.1)
    assert found.value == pytest.approx(1.2, rel=1e-9)
    assert found.E_MPa == pytest.approx([s.E_MPa for s in stiffer])
    parts = (2.0 * 0.01, 0.01, 2.0 * 0.01, 4.0 * 0.002)
    assert found.relative_sd == pytest.approx(math.hypot(*parts))
    assert found.not_stated == ()
    bare = replace(ROD, side_sd_mm=None, length_sd_mm=None)
    assert ring_factor(bare, true).not_stated == ("side_sd_mm", "length_sd_mm")


def test_the_deviations_are_those_of_what_goes_into_the_frequency():
    def factor(rod):
        return ring_factor(rod, 10.0).value

    longer = tuple(replace(s, length_mm=1.001 * s.length_mm) for s in ROD.sections)
    changed = {
        4.0: replace(ROD, sections=longer),
        -2.0: replace(ROD, side_mm=1.001),
        1.0: replace(ROD, density_kg_m3=1.001 * 2640.0),
    }
    for power, rod in changed.items():
        gain = math.log(factor(rod) / factor(ROD)) / math.log(1.001)
        assert gain == pytest.approx(power, abs=1e-6)


def test_a_fit_is_seen_from_the_vibration(tmp_path):
    rung = ring_factor(ROD, first_mode(ROD).frequency_Hz)
    same = fit_factor(ROD, fit_file(tmp_path / "fit.json", (1.0, 1.0, 1.0)))
    assert same.value == pytest.approx(1.0)
    assert 0.01 < same.relative_sd < 0.03
    assert apart(rung, same) < 0.1
    other = fit_factor(ROD, fit_file(tmp_path / "fit.json", (1.3, 1.3, 1.3)))
    assert other.value == pytest.approx(1.3)
    assert apart(rung, other) > 5.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{}", "is no fit.json"),
        ('{"E_MPa": [1], "E_sd_MPa": [1], "correlation": [[1]]}', "1 sections"),
        (
            '{"E_MPa": [1, 1, 1], "E_sd_MPa": [1, null, 1], "correlation": '
            "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]}",
            "does not tell all moduli",
        ),
    ],
)
def test_files_that_tell_no_moduli_are_refused(tmp_path, text, words):
    path = tmp_path / "fit.json"
    path.write_text(text)
    with pytest.raises(ConfigError, match=words):
        fit_factor(ROD, path)


def test_frequencies_that_cannot_be_are_refused():
    with pytest.raises(InputError, match="frequency"):
        ring_factor(ROD, 0.0)
    with pytest.raises(InputError, match="damped by a ratio"):
        ring_factor(ROD, 5.0, damping_ratio=1.0)


def test_a_film_tells_the_modulus_and_whether_the_fit_agrees(tmp_path):
    softer = replace(
        ROD, sections=tuple(replace(s, E_MPa=0.8 * s.E_MPa) for s in ROD.sections)
    )
    frequency, rate = first_mode(softer).frequency_Hz, 90.0
    film = cv2.VideoWriter(
        str(tmp_path / "swing.avi"), cv2.VideoWriter_fourcc(*"MJPG"), rate, (420, 300),
        isColor=False,
    )  # fmt: skip
    for k in range(45):
        swing = np.exp(-k / 60.0) * np.cos(2.0 * np.pi * frequency * k / rate)
        frame = draw(
            curve("arc", angle_deg=20.0 + 9.0 * swing), np.random.default_rng(k),
            px_per_mm=8.0, size_px=(420, 300), light=CLEAN, clamp_px=(90.0, 210.0),
            angle_deg=0.0,
        )  # fmt: skip
        film.write(frame.image)
    film.release()
    write_calibration(frame.truth.calibration, tmp_path / "calibration.json")
    sections = "".join(
        f"[[section]]\nlength_mm = {s.length_mm}\nE_MPa = {s.E_MPa}\n"
        for s in ROD.sections
    )
    rod = tmp_path / "rod.toml"
    head = 'name = "rod"\nside_mm = 1.0\nremanence_mT = 20.0\n'
    rod.write_text(f"{head}density_kg_m3 = 2640.0\n{sections}")
    fit = fit_file(tmp_path / "fit.json", (0.8, 0.8, 0.8))
    command = [
        "analysis", "ring", str(tmp_path / "swing.avi"), "--calibration",
        str(tmp_path / "calibration.json"), "--specimen", str(rod), "--fit", str(fit),
    ]  # fmt: skip
    told = CliRunner().invoke(app, [*command, "--json"])
    data = json.loads(told.stdout)
    assert data["E_ring"]["value"] == pytest.approx(0.8, rel=0.02)
    assert data["agree"] is True
    fit_file(fit, (1.2, 1.2, 1.2))
    words = CliRunner().invoke(app, command)
    assert "THEY DISAGREE" in words.stdout
    assert "density_sd_kg_m3" in words.stderr
    rod.write_text(head + sections)
    refused = CliRunner().invoke(app, command)
    assert refused.exit_code == 1
