"""Specimen, magnet pose, units and centreline keep what they promise."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magbend.core.centreline import Centreline
from magbend.core.errors import ConfigError, InputError
from magbend.core.magnet import Magnet
from magbend.core.specimen import Section, Specimen
from magbend.core.units import MU0, tesla_per_unit


def test_the_magnet_of_the_paper_stands_below_the_tip() -> None:
    magnet = Magnet.cube(55.0, 1.305)
    centre = magnet.centre_mm(length_mm=30.0, gap_mm=60.0)
    assert centre == pytest.approx((30.0, -87.5, 0.0))
    x_axis, y_axis, z_axis = magnet.axes()
    assert z_axis == pytest.approx((0.0, 1.0, 0.0))
    assert np.linalg.det(np.array([x_axis, y_axis, z_axis])) == pytest.approx(1.0)


@given(
    angle=st.floats(-360.0, 360.0), elevation=st.floats(-90.0, 90.0),
    gap=st.floats(1.0, 200.0),
)  # fmt: skip
def test_the_gap_is_the_distance_from_n_face_to_tip(
    angle: float, elevation: float, gap: float
) -> None:
    magnet = Magnet(
        sides_mm=(40.0, 50.0, 60.0), remanence_T=1.2, axis_angle_deg=angle,
        elevation_deg=elevation,
    )  # fmt: skip
    axes = np.array(magnet.axes())
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
    centre = np.array(magnet.centre_mm(length_mm=30.0, gap_mm=gap))
    tip_in_magnet = axes @ (np.array([30.0, 0.0, 0.0]) - centre)
    np.testing.assert_allclose(tip_in_magnet, [0.0, 0.0, 30.0 + gap], atol=1e-11)


def test_units_of_tesla_meters() -> None:
    assert tesla_per_unit("mT") == 1e-3
    assert tesla_per_unit(" kG ") == pytest.approx(0.1)
    assert tesla_per_unit("A/m") == MU0
    with pytest.raises(ValueError, match="furlong"):
        tesla_per_unit("furlong")


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_impossible_sections_are_refused(bad: float) -> None:
    with pytest.raises(InputError, match="length_mm"):
        Section(length_mm=bad, E_MPa=10.0)
    with pytest.raises(InputError, match="MPa"):
        Section(length_mm=10.0, E_MPa=bad)
    with pytest.raises(ValueError, match="at least one section"):
        Specimen(name="none", side_mm=1.0, remanence_mT=20.0, sections=())


def test_a_centreline_survives_its_csv_to_the_last_digits(tmp_path: Path) -> None:
    s = np.linspace(0.0, 30.0, 61)
    line = Centreline(
        s_mm=s, x_mm=s * math.pi / 4, y_mm=np.sin(s), theta_rad=np.cos(s),
        kappa_per_mm=1.0 / (1.0 + s),
    )  # fmt: skip
    path = tmp_path / "shape.csv"
    line.to_csv(path)
    back = Centreline.from_csv(path)
    np.testing.assert_allclose(back.x_mm, line.x_mm, rtol=1e-14)
    assert back.length_mm == 30.0
    with pytest.raises(ConfigError, match="no such file"):
        Centreline.from_csv(tmp_path / "absent.csv")
    with pytest.raises(InputError, match="increase"):
        Centreline(s_mm=s[::-1], x_mm=s, y_mm=s, theta_rad=s, kappa_per_mm=s)
    path.write_text("a,b\n1,2\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="s_mm"):
        Centreline.from_csv(path)
