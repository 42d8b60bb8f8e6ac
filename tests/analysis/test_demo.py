"""A demo goes where nobody's files lie, and again into its own folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from magbend.analysis import demo, warm_up
from magbend.core.errors import RigError, StoreError
from magbend.sim.planar.solver import solve_rows
from magbend.vision.batch import cold


def quiet(_line: str) -> None:
    """Say nothing."""


def test_a_folder_of_somebody_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(StoreError, match="was not made by magbend"):
        demo.run_demo(tmp_path, seed=2, tell=quiet)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_second_demo_gets_the_next_free_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def run(_plan: object, folder: Path, **_: object) -> None:
        folder.mkdir()
        asked.append(folder.name)
        raise RigError("enough")

    monkeypatch.setattr(demo, "is_warm", lambda: True)
    monkeypatch.setattr(demo, "run_on_twin", run)
    for _ in range(2):
        with pytest.raises(RigError, match="enough"):
            demo.run_demo(tmp_path / "demo", seed=2, tell=quiet)
    assert asked == ["run_001", "run_002"]


def test_nothing_is_called_warm_that_photographs_find_cold(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if not solve_rows.cache_folder:
        pytest.skip("no folder keeps kernels here")
    monkeypatch.setattr(cold, "is_cold", lambda: True)
    assert not warm_up.is_warm()
