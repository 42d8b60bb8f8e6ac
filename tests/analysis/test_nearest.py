"""The distance by which a library ranks shapes is the one it says: an RMS along s."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from magbend.analysis.library.build import build
from magbend.analysis.library.query import query
from magbend.analysis.library.space import read_space
from magbend.core.centreline import Centreline

pytest.importorskip("pyarrow")

SPACE = """
name = "straight rods"
method = "sobol"
designs = 16
partition_rows = 1024
side_mm = 1.0
remanence_mT = 20.0
flux_mT = { from = 0.0, to = 1e-4 }
"""
SECTION = "[[section]]\nlength_mm = 10.0\nE_MPa = { from = 6.0, to = 48.0 }\n"


def test_a_distance_is_the_rms_between_the_shapes(tmp_path: Path) -> None:
    (tmp_path / "space.toml").write_text(SPACE + 3 * SECTION)
    build(read_space(tmp_path / "space.toml"), tmp_path / "out")
    s, turn = np.linspace(0.0, 30.0, 61), 0.05
    target = Centreline(
        s_mm=s, x_mm=s * np.cos(turn), y_mm=s * np.sin(turn),
        theta_rad=np.full_like(s, turn), kappa_per_mm=np.zeros_like(s),
    )  # fmt: skip
    rows = query(tmp_path / "out", nearest=target, top=16).table.to_pylist()
    assert len(rows) == 16
    # A straight rod and one turned against it are 2 s sin(turn / 2) apart.
    rms_mm = 2.0 * 30.0 * np.sin(turn / 2.0) / np.sqrt(3.0)
    for row in rows:
        assert row["distance_mm"] == pytest.approx(rms_mm, rel=1e-3)
