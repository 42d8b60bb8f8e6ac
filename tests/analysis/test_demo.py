"""A demo goes where nobody's files lie, and again into its own folder."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from magbend.analysis import demo, warm_up
from magbend.core import jit
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


@pytest.mark.parametrize("warm", [True, False])
def test_a_cold_demo_shows_its_report_and_then_has_kernels_compiled(
    warm: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []

    def in_plain_python(name: str) -> None:
        assert (jit._calls_left.get() is None) is warm
        told.append(name)

    step = SimpleNamespace(support=None, of=lambda _model: [])
    files = SimpleNamespace(html=tmp_path / "report.html", figures=())
    done = SimpleNamespace(steps_done=3, rms_px=0.1)
    replaced = {
        "is_warm": lambda: warm,
        "warm_up_beside": lambda: told.append("compile"),
        "run_on_twin": lambda *_, **__: (None, done),
        "calibrate_twin": lambda *_: done,
        "measure_twin": lambda *_: 3,
        "load_run": lambda _: None,
        "compare_run": lambda _: step,
        "write_comparison": lambda *_: None,
        "try_fit": lambda *_: in_plain_python("fit"),
        "write_report": lambda *_, **__: in_plain_python("page") or files,
    }
    for name, stand_in in replaced.items():
        monkeypatch.setattr(demo, name, stand_in)
    demo.run_demo(tmp_path / "demo", seed=2, tell=lambda line: told.append(line[:6]))
    shown = told.index("report")
    assert told[shown - 2 : shown] == ["fit", "page"]
    assert told[shown + 1 :] == ([] if warm else ["kernel", "compile"])


def test_nothing_is_called_warm_that_photographs_find_cold(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if not solve_rows.cache_folder:
        pytest.skip("no folder keeps kernels here")
    monkeypatch.setattr(cold, "stored", lambda: (11, 12))
    assert cold.is_cold()
    assert not warm_up.is_warm()
