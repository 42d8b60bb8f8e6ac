"""A descriptor of another package becomes a column of the library."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from magbend.analysis.library.build import build
from magbend.analysis.library.query import query
from magbend.analysis.library.space import read_space
from magbend.analysis.shapes.descriptors import describe_by
from magbend.core.errors import ConfigError, InputError

pytest.importorskip("pyarrow")

SPACE = """
name = "hooks"
method = "sobol"
designs = 32
partition_rows = 1024
descriptors = ["hook_mm", "tip_again_mm"]
side_mm = 1.0
remanence_mT = 20.0
flux_mT = { from = 10.0, to = 90.0 }
"""
SECTION = "[[section]]\nlength_mm = 10.0\nE_MPa = { from = 6.0, to = 48.0 }\n"
CODE = """
import numpy as np
from hook_descriptor import hook_mm
def tip_again_mm(shapes): return shapes[:, -1, 2]
def too_few(shapes): return np.zeros(3)
def broken(shapes): return 1 / 0
"""


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "examples")
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "lab_of_hooks.py").write_text(CODE)
    info = tmp_path / "lab_of_hooks-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: lab-of-hooks\nVersion: 1.0\n")
    names = ("hook_mm", "tip_again_mm", "too_few", "broken")
    lines = "".join(f"{name} = lab_of_hooks:{name}\n" for name in names)
    (info / "entry_points.txt").write_text("[magbend.descriptors]\n" + lines)


@pytest.mark.usefixtures("lab")
def test_a_column_of_another_package_stands_beside_ours(tmp_path: Path) -> None:
    (tmp_path / "space.toml").write_text(SPACE + 3 * SECTION)
    build(read_space(tmp_path / "space.toml"), tmp_path / "out")
    table = query(tmp_path / "out", where="tip_again_mm > 4", top=32).table.to_pandas()
    assert 0 < len(table) < 32
    np.testing.assert_array_equal(table.tip_again_mm, table.tip_y_mm)
    assert (table.hook_mm >= 0.0).all()


@pytest.mark.usefixtures("lab")
def test_a_descriptor_that_fails_is_one_sentence() -> None:
    shapes = np.zeros((5, 61, 5))
    with pytest.raises(InputError, match="'broken' fails: ZeroDivisionError"):
        describe_by("broken", shapes)
    with pytest.raises(InputError, match=r"must return 5 numbers.*\(3,\)"):
        describe_by("too_few", shapes)
    with pytest.raises(ConfigError, match=r"hook_mm.*instead 'unknown'"):
        describe_by("unknown", shapes)
