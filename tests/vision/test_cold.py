"""Before the kernels are compiled photographs are measured in plain Python."""

from __future__ import annotations

import numpy as np
import pytest

from magbend.core import jit
from magbend.core.jit import once
from magbend.vision import as_photo, extract
from magbend.vision.batch import cold
from magbend.vision.synthetic import CLEAN, curve, draw


def test_plain_python_measures_what_compiled_kernels_do():
    frame = draw(
        curve("arc", angle_deg=50.0), np.random.default_rng(0), px_per_mm=9.0,
        size_px=(480, 360), light=CLEAN, clamp_px=(100.0, 280.0), angle_deg=5.0,
    )  # fmt: skip
    photo, camera = as_photo(frame.image), frame.truth.calibration
    plain = once(lambda: extract(photo, camera), patience=cold.PATIENCE)
    compiled = extract(photo, camera)
    assert plain.ok
    assert plain.flags == compiled.flags
    np.testing.assert_allclose(plain.points_px, compiled.points_px, atol=1e-3)
    assert plain.clamp_angle_sd_deg == pytest.approx(
        compiled.clamp_angle_sd_deg, rel=1e-2
    )


def test_nothing_is_done_in_plain_python_once_all_is_compiled(monkeypatch):
    monkeypatch.setattr(jit, "PLAIN_FIRST", True)
    monkeypatch.setattr(cold, "is_cold", lambda: False)
    assert not list(cold.while_cold(str, [1, 2, 3]))


@pytest.fixture
def cold_start(monkeypatch):
    """Pretend that nothing is compiled."""
    monkeypatch.setattr(jit, "PLAIN_FIRST", True)
    monkeypatch.setattr(cold, "is_cold", lambda: True)


@pytest.mark.usefixtures("cold_start")
def test_few_are_done_without_a_helper_and_in_their_order(monkeypatch):
    monkeypatch.setattr(cold, "multiprocessing", None)  # no process may start
    assert list(cold.while_cold(str, [3, 1, 2])) == ["3", "1", "2"]


@pytest.mark.usefixtures("cold_start")
def test_many_are_left_to_the_kernels_as_soon_as_these_are_compiled(monkeypatch):
    class Helper:
        left = 2

        def __init__(self, **_options):
            pass

        def start(self):
            pass

        def is_alive(self):
            self.left -= 1
            return self.left >= 0

        def terminate(self):
            pass

        join = terminate

    context = type("Context", (), {"Process": Helper})
    monkeypatch.setattr(cold.multiprocessing, "get_context", lambda _kind: context)
    assert list(cold.while_cold(str, range(9))) == ["0", "1"]
